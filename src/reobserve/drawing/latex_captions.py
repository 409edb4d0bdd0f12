"""Captions in LaTeX, from what they are in reStructuredText."""

from __future__ import annotations

import re
from collections.abc import Iterator
from typing import Any

from reobserve.errors import InputError
from reobserve.plain_data.latex import latex

_SETTINGS = {
    "_disable_config": True,
    "file_insertion_enabled": False,
    "raw_enabled": False,
    "warning_stream": False,
    "halt_level": 2,
    "smart_quotes": False,
}

# The command for each kind of inline markup; nothing for what LaTeX says of itself in a caption.
_INLINE = {
    "strong": r"\textbf",
    "emphasis": r"\emph",
    "title_reference": r"\emph",
    "literal": r"\texttt",
    "subscript": r"\textsubscript",
    "superscript": r"\textsuperscript",
    "reference": "",
}
_ITEMS = ("bullet_list", "enumerated_list", "definition_list")
_BLOCKS = (*_ITEMS, "document", "list_item", "definition_list_item", "definition", "block_quote")
_LINES = ("paragraph", "term", "line", "literal_block")


def caption_in_latex(path: str, text: str) -> str:
    r"""The command ``\caption`` for a caption; its first sentence is that of a list of figures.

    Lists become paragraphs: LaTeX takes no others in a caption.

    Raises
    ------
    InputError
        If it is no reStructuredText, or holds more than paragraphs, lists and inline markup.
    """
    from docutils.core import publish_doctree
    from docutils.utils import SystemMessage

    try:
        document = publish_doctree(text, settings_overrides=_SETTINGS)
    except SystemMessage as error:
        reason = str(error).removeprefix("<string>:")
        raise InputError(path, f"is no reStructuredText (line {reason})") from None
    paragraphs = list(_paragraphs(path, document))
    short = ""
    if paragraphs:
        plain = " ".join(next(iter(document.children)).astext().split())
        short = re.split(r"(?<=[a-z0-9)%][.!?]) (?=[A-Z(])", plain, maxsplit=1)[0]
    return f"\\caption[{latex(short)}]{{%\n" + "\n\\par\n".join(paragraphs) + "%\n}\n"


def _paragraphs(path: str, node: Any) -> Iterator[str]:
    """The paragraphs below a block, those of lists among them."""
    for child in node.children:
        kind = type(child).__name__
        if kind in _LINES:
            yield "".join(_inline(path, child)).strip()
        elif kind == "line_block" or kind in _BLOCKS:
            bullet = r"\textbullet\ " if kind == "list_item" else ""
            first, *others = [*_paragraphs(path, child), ""]
            yield from (one for one in (bullet + first, *others) if one)
        elif kind not in ("comment", "target"):
            raise InputError(
                path, f"holds a {kind}; a caption has paragraphs, lists, emphasis and links"
            )


def _inline(path: str, node: Any) -> Iterator[str]:
    """The text of a paragraph with its markup."""
    for child in node.children:
        kind = type(child).__name__
        if kind == "Text":
            yield _spaced(child.astext())
        elif kind in _INLINE:
            inner = "".join(_inline(path, child))
            yield f"{_INLINE[kind]}{{{inner}}}"
        elif kind != "target":
            raise InputError(path, f"holds a {kind}; a caption has emphasis and links")


def _spaced(text: str) -> str:
    """Text in LaTeX with the blanks at its ends."""
    before = " " if text[:1].isspace() else ""
    after = " " if text[-1:].isspace() and text.strip() else ""
    return before + latex(text) + after
