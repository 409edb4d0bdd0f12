"""The gallery: every figure with its caption, its command and the claims that it decides."""

from __future__ import annotations

import re
from collections.abc import Sequence

from docs.generate.evidence import REFERENCES, Figure, Paper
from docs.generate.markdown import block, code, heading, plain

_REFERENCES = f"../../../{REFERENCES}"  # from a page in a folder


def small(papers: Sequence[Paper]) -> str:
    """All figures of all papers, small."""
    return "\n".join(
        f"{heading(2, code(paper.name), paper.name)}\n\n{plain(paper.about['title'])}\n\n"
        f"{grid(paper.figures)}"
        for paper in papers
    )


def grid(figures: Sequence[Figure]) -> str:
    """Figures beside each other, each with a link to its place in the gallery."""
    cells = []
    for figure in figures:
        target = f"{figure.paper}.md#{figure.name}"
        text = f"[{plain(figure.title)}]({target})"
        cells.append(f"<div markdown>\n\n[{_picture(figure)}]({target})\n\n{text}\n\n</div>\n")
    return f'<div class="gallery" markdown>\n\n{"".join(cells)}\n</div>\n'


def figures(paper: Paper) -> str:
    """All figures of a paper."""
    about = f"*{plain(paper.about['title'])}*. [What was found](../findings/{paper.name}.md)\n"
    return "\n".join([about, *map(_figure, paper.figures)])


def _picture(figure: Figure) -> str:
    return f"![{plain(figure.title)}]({_REFERENCES}/{figure.paper}/{figure.name}.png)"


def _figure(figure: Figure) -> str:
    page = f"../reference/claims/{figure.paper}.md"
    claims = ", ".join(
        f"[{plain(claim.name.replace('_', ' '))}]({page}#claim-{claim.name})"
        f" ({plain(claim.verdict)})"
        for claim in figure.claims
    )
    full = f"{_REFERENCES}/{figure.paper}/{figure.name}.png"
    return (
        f"{heading(2, plain(figure.title), figure.name)}\n\n"
        f"{plain(figure.source)}; {code(figure.name)}\n\n"
        f"[{_picture(figure)}]({full})\n\n"
        f'<div class="caption">{_on_one_line(figure.caption)}</div>\n\n'
        f"{block(figure.command)}\n"
        f"{f'Claims that it decides: {claims}.' if claims else 'It decides no claim.'}\n"
    )


def _on_one_line(html: str) -> str:
    """HTML that Markdown hands on as it is."""
    return re.sub(r"\s*\n\s*", " ", html)
