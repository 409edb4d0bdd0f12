"""Captions: reStructuredText to HTML, and their first sentence as plain text."""

from __future__ import annotations

import html
import re
from typing import Any
from urllib.parse import urlsplit

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


# What a caption may be made of. No directive and no role makes anything else of text: no picture,
# no other file, no class or name that the page has given.
_ALLOWED = {
    *("document", "paragraph", "Text", "emphasis", "strong", "literal", "subscript"),
    *("superscript", "title_reference", "bullet_list", "enumerated_list", "list_item"),
    *("block_quote", "definition_list", "definition_list_item", "term", "definition"),
    *("literal_block", "line_block", "line", "reference", "target", "comment"),
}
_LINKS = ("http", "https")


def to_html(path: str, text: str) -> str:
    """A caption as HTML, whose links lead to the web; what would lead elsewhere is plain text.

    Raises
    ------
    InputError
        If it is no reStructuredText, or holds more than paragraphs, lists and inline markup.
    """
    from docutils.core import publish_parts
    from docutils.utils import SystemMessage
    from docutils.writers.html5_polyglot import Writer

    class CheckedWriter(Writer):  # type: ignore[misc]  # docutils has no types
        def translate(self) -> None:
            _check(path, self.document)
            super().translate()

    try:
        parts = publish_parts(text, writer=CheckedWriter(), settings_overrides=_SETTINGS)
    except SystemMessage as error:
        reason = str(error).removeprefix("<string>:")
        raise InputError(path, f"is no reStructuredText (line {reason})") from None
    body: str = parts["body"]
    return body


def _check(path: str, document: Any) -> None:
    """Refuse what a caption must not hold; take away links that do not lead to the web."""
    from docutils import nodes

    for node in list(document.findall()):
        kind = type(node).__name__
        if kind not in _ALLOWED:
            raise InputError(
                path, f"holds a {kind}; a caption has paragraphs, lists, emphasis and links"
            )
        if isinstance(node, nodes.Element):
            node["classes"], node["ids"] = [], []  # those of the page are the page's
        if isinstance(node, nodes.reference) and not _leads_to_the_web(node):
            node.replace_self(node.children)
        if isinstance(node, nodes.target):
            node.parent.remove(node)


def _leads_to_the_web(reference: Any) -> bool:
    return urlsplit(reference.get("refuri", "")).scheme.lower() in _LINKS


def without_title(text: str, title: str) -> tuple[str, str]:
    """A caption in HTML without the title that stands over the figure, and the figure's source.

    Captions begin with the title in bold and the source in brackets; others are left as they are.
    Cut from the HTML: "(a)" at the beginning of reStructuredText would be a list.
    """
    bold = re.escape(html.escape(" ".join(title.split()), quote=False))
    found = re.match(rf"<p><strong>{bold}</strong>\s+\((.+?)\)[.,;]?\s+", text)
    if found is None:
        return text, ""
    rest = text[found.end() :]
    return f"<p>{rest[:1].upper()}{rest[1:]}", html.unescape(found[1])


def first_sentence(text: str) -> str:
    """The first sentence of HTML, as plain text."""
    plain = " ".join(html.unescape(re.sub(r"<[^>]+>", "", text)).split())
    return re.split(r"(?<=[a-z0-9)%][.!?]) (?=[A-Z(])", plain, maxsplit=1)[0]
