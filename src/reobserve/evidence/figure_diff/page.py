"""The page of a figure comparison, one HTML file that needs no other, and its summary."""

from __future__ import annotations

import base64
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from reobserve.errors import InputError
from reobserve.evidence.figure_diff import pixels
from reobserve.evidence.figure_diff.comparison import Item
from reobserve.evidence.report.policy import content_policy, inline

TEMPLATE = "figure_diff.html.jinja"
STYLE = "figure_diff.css"


@dataclass(frozen=True)
class _Shown:
    """An item with its pictures as data; empty where there is none or it cannot be decoded."""

    item: Item
    reference: str
    new: str
    difference: str


def counts(items: Sequence[Item]) -> str:
    """How many items have which verdict."""
    found = Counter(item.verdict for item in items)
    words = {"not compared": "not compared", "moved": "moved", "agrees": "agree"}
    return ", ".join(f"{found[one]} {words[one]}" for one in words if found[one]) or "nothing"


def to_markdown(items: Sequence[Item], problems: Sequence[str]) -> str:
    """A short text for the page of a CI run: the counts, and what does not agree."""
    lines = ["## Figure comparison", "", f"{len(items)} compared: {counts(items)}.", ""]
    lines += [f"- {_cell(problem)}" for problem in problems] + [""] * bool(problems)
    failed = [item for item in items if item.verdict != "agrees"]
    if failed:
        lines += ["| | | RMS | similarity | columns moved | |", "|---|---|---|---|---|---|"]
    for item in failed:
        found = item.pixels
        drawn = (f"{found.rms:.3g}", f"{found.similarity:.3f}") if found else ("", "")
        said = "; ".join([*item.problems, *map(str, item.moved[:1])])
        row = (f"{item.paper} {item.name}", item.verdict, *drawn, str(len(item.moved)), said)
        lines.append(f"| {' | '.join(map(_cell, row))} |")
    return "\n".join(lines).rstrip() + "\n"


def _cell(text: str) -> str:
    """A text as one cell or line of Markdown; the pipe and the line break would end it."""
    return text.replace("|", "\\|").replace("<", "&lt;").replace("\n", " ")


def render(items: Sequence[Item], problems: Sequence[str], templates: Path) -> str:
    """The page, from the template in the folder ``templates``; what does not agree comes first.

    Raises
    ------
    InputError
        If the template or the style is missing, or the template cannot be filled.
    """
    import jinja2
    from markupsafe import Markup

    environment = jinja2.Environment(
        loader=jinja2.FileSystemLoader(templates), autoescape=True,
        undefined=jinja2.StrictUndefined, trim_blocks=True, lstrip_blocks=True,
    )  # fmt: skip
    shown = [_show(item) for item in items]
    try:
        style = inline(templates / STYLE)
        return environment.get_template(TEMPLATE).render(
            policy=content_policy(style),
            style=Markup(style),
            counts=counts(items),
            problems=problems,
            failed=[one for one in shown if one.item.verdict != "agrees"],
            agreeing=[one for one in shown if one.item.verdict == "agrees"],
            rms=pixels.RMS,
            similarity=pixels.SIMILARITY,
        )
    except OSError as error:  # of jinja2, too
        raise InputError(str(templates), f"{error} cannot be read") from None
    except jinja2.TemplateError as error:
        raise InputError(str(templates / TEMPLATE), f"cannot be filled: {error.message}") from None


def _show(item: Item) -> _Shown:
    same = item.pixels is not None and item.pixels.place is None
    difference = ""
    if item.pixels and not same and item.reference and item.new:
        old, new = map(pixels.read_pixels, (item.reference, item.new))
        difference = _data(pixels.show_difference(old, new, item.pixels.place))
    return _Shown(item, _picture(item.reference), "" if same else _picture(item.new), difference)


def _picture(path: Path | None) -> str:
    if path is None:
        return ""
    try:
        pixels.read_pixels(path)
    except InputError:
        return ""
    return _data(path.read_bytes())


def _data(content: bytes) -> str:
    return f"data:image/png;base64,{base64.b64encode(content).decode()}"
