"""The gallery: every figure with its caption, its command and the claims that it decides."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence

from PIL import Image

from docs.generate.evidence import Figure, Paper
from docs.generate.markdown import Page, block, code, plain
from reobserve.replication.report.markup import first_sentence

_DENSITY = 1.6  # pixels of a picture to one of the page, as in the report


def small(papers: Sequence[Paper]) -> str:
    """All figures of all papers, small."""
    return "\n".join(
        f"## {code(paper.name)} {{ #{paper.name} }}\n\n{plain(paper.about['title'])}\n\n"
        f"{grid(paper.figures)}"
        for paper in papers
    )


def grid(figures: Sequence[Figure], folder: str = "") -> str:
    """Figures beside each other, each with a link to its place in the gallery's ``folder``."""
    cells = []
    for figure in figures:
        target = f"{folder}{figure.paper}.md#{figure.name}"
        told = f"[{plain(figure.title)}]({target})"
        cells.append(f"<div markdown>\n[{picture(figure, '../')}]({target})\n\n{told}\n</div>\n")
    return f'<div class="gallery" markdown>\n{"".join(cells)}</div>\n'


def pages(papers: Sequence[Paper]) -> Iterator[Page]:
    """A page for each paper."""
    for paper in papers:
        head = (
            f"# Figures of {code(paper.name)}\n\n*{plain(paper.about['title'])}*. "
            f"[What was found](../findings/{paper.name}.md)\n"
        )
        told = [_figure(figure) for figure in paper.figures]
        yield Page(f"gallery/{paper.name}.md", f"Figures of {paper.name}", "\n".join([head, *told]))


def picture(figure: Figure, root: str) -> str:
    """A figure as an image, from a page in a folder from which ``root`` leads to all."""
    with Image.open(figure.picture) as image:
        width, height = (round(size / _DENSITY) for size in image.size)
    told = f"{figure.title.rstrip('.')}. {first_sentence(figure.caption)}"
    path = f"{root}figures/{figure.paper}/{figure.name}.png"
    return f"![{plain(told)}]({path}){{ .figure loading=lazy width={width} height={height} }}"


def _figure(figure: Figure) -> str:
    claims = ", ".join(
        f"[{plain(claim.name.replace('_', ' '))}](../findings/{figure.paper}.md#claim-{claim.name})"
        f" ({plain(claim.verdict)})"
        for claim in figure.claims
    )
    full = f"../figures/{figure.paper}/{figure.name}.png"
    return (
        f"## {plain(figure.title)} {{ #{figure.name} }}\n\n"
        f"{plain(figure.source)}; {code(figure.name)}\n\n"
        f"[{picture(figure, '../')}]({full})\n\n"
        f'<div class="caption">{_on_one_line(figure.caption)}</div>\n\n'
        f"{block(figure.command)}\n"
        f"{f'Claims that it decides: {claims}.' if claims else 'It decides no claim.'}\n"
    )


def _on_one_line(html: str) -> str:
    """HTML that Markdown hands on as it is."""
    return re.sub(r"\s*\n\s*", " ", html)
