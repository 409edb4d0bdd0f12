"""Mathematics in Markdown, as MathML: `$x$` in a line, `$$ ... $$` as a paragraph of its own.

It is written into the page at build, so that no browser needs a script or a font for it. What is no
LaTeX fails the build with a sentence that has the formula in it.
"""

from __future__ import annotations

import re
from typing import Any
from xml.etree import ElementTree

from docutils.utils.math import MathError
from docutils.utils.math.latex2mathml import tex2mathml
from markdown import Markdown
from markdown.blockprocessors import BlockProcessor
from markdown.extensions import Extension
from markdown.inlinepatterns import InlineProcessor

_NAMESPACE = "http://www.w3.org/1998/Math/MathML"

# A dollar beside a letter or a digit outside of it is a price, and so is `\$`.
_INLINE = r"(?<![\\$\w])\$(?!\s)((?:\\.|[^$\\\n]|\n(?!\n))+?)(?<!\s)\$(?![\w$])"
_BLOCK = re.compile(r"^\$\$\s*(.+?)\s*\$\$$", re.DOTALL)


def mathml(formula: str, block: bool = False) -> str:
    r"""A formula of LaTeX in MathML, on one line; rows `a &= b \\` are aligned in a block.

    Raises
    ------
    ValueError
        If it is no LaTeX that is understood.
    """
    body = (
        re.sub(r"\\(?:begin|end)\{(?:aligned|align\*?|split)\}", "", formula) if block else formula
    )
    try:
        found = ElementTree.fromstring(
            tex2mathml(body, as_block=block).replace("&ApplyFunction;", "\N{FUNCTION APPLICATION}")
        )
    except MathError as error:
        raise ValueError(f"${formula}$ is no formula: {error}") from None
    for element in found.iter():
        element.text = (element.text or "").strip() or None
        element.tail = None
        _lower(element)
    ElementTree.register_namespace("", _NAMESPACE)
    return ElementTree.tostring(found, encoding="unicode")


def _lower(element: ElementTree.Element) -> None:
    """Put the index of a letter with an accent beside it: it comes between letter and accent."""
    if element.tag != f"{{{_NAMESPACE}}}munderover" or len(element) != 3:
        return
    letter, index, over = element
    if over.tag != f"{{{_NAMESPACE}}}mo" or over.get("stretchy") != "false":
        return
    accented = ElementTree.Element(f"{{{_NAMESPACE}}}mover", {"accent": "true"})
    accented.extend([letter, over])
    element.tag = f"{{{_NAMESPACE}}}msub"
    element.attrib.clear()
    element[:] = [accented, index]


class _Inline(InlineProcessor):
    def handleMatch(self, m: re.Match[str], data: str) -> tuple[str, int, int]:
        return self.md.htmlStash.store(mathml(m[1])), m.start(0), m.end(0)


class _Block(BlockProcessor):
    def test(self, parent: Any, block: str) -> bool:
        return bool(_BLOCK.match(block.strip()))

    def run(self, parent: Any, blocks: list[str]) -> None:
        found = _BLOCK.match(blocks.pop(0).strip())
        assert found
        paragraph = ElementTree.SubElement(parent, "div", {"class": "formula"})
        paragraph.text = self.parser.md.htmlStash.store(mathml(found[1], block=True))


class Mathematics(Extension):
    """The extension."""

    def extendMarkdown(self, md: Markdown) -> None:
        """Add formulas; code goes before them."""
        md.inlinePatterns.register(_Inline(_INLINE, md), "mathematics", 185)
        md.parser.blockprocessors.register(_Block(md.parser), "mathematics", 95)
        md.ESCAPED_CHARS.append("$")


def makeExtension(**options: Any) -> Mathematics:
    """Where Markdown looks for it."""
    return Mathematics(**options)
