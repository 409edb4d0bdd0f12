"""Captions: reStructuredText to HTML, and their first sentence as plain text."""

from __future__ import annotations

import html
import re
from urllib.parse import urlsplit

from reobserve_papers.plotting.captions import SETTINGS, parse

_LINKS = ("http", "https")


def to_html(path: str, text: str) -> str:
    """Return a caption as HTML, with links that lead to the web, and others as plain text."""
    from docutils import nodes
    from docutils.core import publish_from_doctree
    from docutils.writers.html5_polyglot import Writer

    document = parse(path, text)
    for link in list(document.findall(nodes.reference)):
        if urlsplit(link.get("refuri", "")).scheme.lower() not in _LINKS:
            link.replace_self(link.children)
    writer = Writer()
    publish_from_doctree(document, writer=writer, settings_overrides=SETTINGS)
    body: str = writer.parts["body"]
    return body


def without_title(text: str, title: str) -> tuple[str, str]:
    """A caption in HTML without the title that stands over the figure, and the figure's source.

    Captions begin with the title in bold and the source in brackets; others are left as they are.
    Cut from the HTML: "(a)" at the beginning of reStructuredText would be a list.
    """
    bold = re.escape(html.escape(" ".join(title.split()), quote=False))
    head = re.match(rf"<p><strong>{bold}</strong>\s+\((.+?)\)[.,;]?\s+", text)
    if head is None:
        return text, ""
    rest = text[head.end() :]
    return f"<p>{rest[:1].upper()}{rest[1:]}", html.unescape(head[1])


def first_sentence(text: str) -> str:
    """The first sentence of HTML, as plain text."""
    plain = " ".join(html.unescape(re.sub(r"<[^>]+>", "", text)).split())
    return re.split(r"(?<=[a-z0-9)%][.!?]) (?=[A-Z(])", plain, maxsplit=1)[0]
