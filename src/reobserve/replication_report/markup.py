"""Captions: reStructuredText to HTML, and their first sentence as plain text."""

from __future__ import annotations

import html
import re

from reobserve.errors import InputError

# Nothing of the machine, no other file and no raw HTML gets into the page by a caption.
_SETTINGS = {
    "_disable_config": True,
    "file_insertion_enabled": False,
    "raw_enabled": False,
    "warning_stream": False,
    "halt_level": 2,
    "initial_header_level": 5,
    "smart_quotes": False,
}


def to_html(path: str, text: str) -> str:
    """A caption as HTML; `InputError` if it is no reStructuredText."""
    from docutils.core import publish_parts
    from docutils.utils import SystemMessage

    try:
        parts = publish_parts(text, writer="html5", settings_overrides=_SETTINGS)
    except SystemMessage as error:
        reason = str(error).removeprefix("<string>:")
        raise InputError(path, f"is no reStructuredText (line {reason})") from None
    body: str = parts["body"]
    return body


def without_title(text: str, title: str) -> tuple[str, str]:
    """A caption in HTML without the title that stands over the figure, and the figure's source.

    Captions begin with the title in bold and the source in brackets; others are left as they are.
    Cut from the HTML: "(a)" at the beginning of reStructuredText would be a list.
    """
    bold = re.escape(html.escape(title, quote=False))
    found = re.match(rf"<p><strong>{bold}</strong>\s+\((.+?)\)[.,;]?\s+", text)
    if found is None:
        return text, ""
    rest = text[found.end() :]
    return f"<p>{rest[:1].upper()}{rest[1:]}", html.unescape(found[1])


def first_sentence(text: str) -> str:
    """The first sentence of HTML, as plain text."""
    plain = " ".join(html.unescape(re.sub(r"<[^>]+>", "", text)).split())
    return re.split(r"(?<=[a-z0-9)%][.!?]) (?=[A-Z(])", plain, maxsplit=1)[0]
