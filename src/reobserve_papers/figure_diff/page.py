"""The page of a figure comparison, one HTML file that needs no other, and its summary."""

from __future__ import annotations

import base64
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from reobserve_papers.figure_diff import pixels
from reobserve_papers.figure_diff.comparison import Item
from reobserve_papers.report.policy import content_policy, inline


@dataclass(frozen=True)
class _Shown:
    """An item with its images as data, empty where there is none."""

    item: Item
    reference: str
    new: str
    difference: str


def counts(items: Sequence[Item]) -> str:
    """The number of items with each verdict."""
    found = Counter(item.verdict for item in items)
    words = {"not compared": "not compared", "moved": "moved", "agrees": "agree"}
    return ", ".join(f"{found[one]} {words[one]}" for one in words if found[one]) or "nothing"


def summary(items: Sequence[Item], problems: Sequence[str]) -> str:
    """The counts and what does not agree, as a list in Markdown."""
    lines = [f"{len(items)} figures, tables, theories and papers' claims: {counts(items)}"]
    lines += [f"- {problem}" for problem in problems]
    for item in items:
        if item.verdict != "agrees":
            lines.append(f"- {item.paper} {item.name}: {item.verdict}")
            drawn = [f"RMS {item.rms:.3g} grey levels"] if item.redrawn else []
            said = (*item.problems, *drawn, *map(str, item.moved[:3]))
            lines += [f"    - {sentence}" for sentence in said]
    return "\n".join(lines)


def render(items: Sequence[Item], problems: Sequence[str], templates: Path) -> str:
    """The page, from the template in the folder ``templates``, with what does not agree first."""
    import jinja2
    from markupsafe import Markup

    environment = jinja2.Environment(
        loader=jinja2.FileSystemLoader(templates), autoescape=True,
        undefined=jinja2.StrictUndefined, trim_blocks=True, lstrip_blocks=True,
    )  # fmt: skip
    shown = [_show(item) for item in items]
    style = inline(templates / "figure_diff.css")
    return environment.get_template("figure_diff.html.jinja").render(
        policy=content_policy(style),
        style=Markup(style),
        counts=counts(items),
        problems=problems,
        failed=[one for one in shown if one.item.verdict != "agrees"],
        agreeing=[one for one in shown if one.item.verdict == "agrees"],
        tolerance=pixels.TOLERANCE,
    )


def _show(item: Item) -> _Shown:
    difference = ""
    if item.rms and item.reference and item.new:
        images = map(pixels.read_pixels, (item.reference, item.new))
        difference = _data(pixels.show_difference(*images))
    new = "" if item.rms == 0 else _image(item.new)
    return _Shown(item, _image(item.reference), new, difference)


def _image(path: Path | None) -> str:
    return _data(path.read_bytes()) if path else ""


def _data(content: bytes) -> str:
    return f"data:image/png;base64,{base64.b64encode(content).decode()}"
