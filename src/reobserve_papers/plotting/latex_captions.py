"""Captions in LaTeX, from what they are in reStructuredText."""

from __future__ import annotations

import re
from typing import Any

from reobserve_papers.plotting.captions import parse
from reobserve_papers.plotting.latex_text import latex

# The command for each kind of inline markup; LaTeX has none for links in a caption.
_INLINE = {
    "strong": r"\textbf",
    "emphasis": r"\emph",
    "title_reference": r"\emph",
    "literal": r"\texttt",
    "subscript": r"\textsubscript",
    "superscript": r"\textsuperscript",
    "reference": "",
}
_LINES = ("paragraph", "term", "line", "literal_block")
_END = "\f"  # of a line, in what `_latex` gives


def caption_in_latex(path: str, text: str) -> str:
    r"""Return the command ``\caption``, whose first sentence is that of a list of figures.

    Lists become paragraphs: LaTeX takes no others in a caption.
    """
    document = parse(path, text)
    plain = " ".join(document.children[0].astext().split()) if document.children else ""
    short = re.split(r"(?<=[a-z0-9)%][.!?]) (?=[A-Z(])", plain, maxsplit=1)[0]
    lines = [line.strip() for line in _latex(document).split(_END)]
    body = "\n\\par\n".join(filter(None, lines))
    return f"\\caption[{latex(short)}]{{%\n{body}%\n}}\n"


def _latex(node: Any) -> str:
    kind, children = type(node).__name__, node.children
    if kind == "Text":
        text = node.astext()
        before = " " if text[:1].isspace() else ""
        after = " " if text[-1:].isspace() and text.strip() else ""
        return before + latex(text) + after
    inner = "".join(_latex(child) for child in children if type(child).__name__ != "comment")
    if kind in _INLINE:
        return f"{_INLINE[kind]}{{{inner}}}"
    if kind in _LINES:
        return inner + _END
    return rf"\textbullet\ {inner}" if kind == "list_item" else inner
