"""The page of a figure diff: one HTML file that needs nothing beside it."""

from __future__ import annotations

import base64
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from reobserve.errors import InputError, ReobserveError
from reobserve.evidence.figure_diff import pixels
from reobserve.evidence.figure_diff.model import Diff, Item, MovedSeries
from reobserve.evidence.figure_diff.summary import counts
from reobserve.evidence.report.policy import content_policy, inline

TEMPLATE = "figure_diff.html.jinja"
STYLE = "figure_diff.css"

# Of each figure the series that are furthest out of tolerance; a page with all would be no page.
_DRAWN = 3
_LISTED = 60


@dataclass(frozen=True)
class _Shown:
    """An item with its pictures as data, and sentences for those that cannot be shown."""

    item: Item
    reference: str
    new: str
    difference: str
    moved: str
    drawn: int
    no_difference: str


def render(diff: Diff, templates: Path) -> str:
    """The page, from the template in the folder ``templates``; what does not agree comes first.

    Raises
    ------
    InputError
        If the template is missing or no template.
    """
    import jinja2
    from markupsafe import Markup

    loader = jinja2.FileSystemLoader(templates)
    environment = jinja2.Environment(
        loader=loader, autoescape=True, undefined=jinja2.StrictUndefined, trim_blocks=True,
        lstrip_blocks=True,
    )  # fmt: skip
    shown = [_show(item) for item in diff.items]
    try:
        style = inline(templates / STYLE)
        return environment.get_template(TEMPLATE).render(
            diff=diff,
            policy=content_policy(style),
            style=Markup(style),
            counts=counts(diff),
            failed=[one for one in shown if one.item.verdict != "agrees"],
            agreeing=[one for one in shown if one.item.verdict == "agrees"],
            differing=diff.reference.differing(diff.new),
            rms=pixels.RMS,
            similarity=pixels.SIMILARITY,
            listed=_LISTED,
        )
    except jinja2.TemplateNotFound:
        raise InputError(str(templates / TEMPLATE), "cannot be read") from None
    except OSError:
        raise InputError(str(templates / STYLE), "cannot be read") from None
    except jinja2.TemplateError as error:
        raise InputError(str(templates / TEMPLATE), f"cannot be filled: {error.message}") from None


def _show(item: Item) -> _Shown:
    same = item.pixels is not None and item.pixels.place is None
    worst = sorted(item.series, key=_excess, reverse=True)[:_DRAWN]
    moved = ""
    if worst:
        from reobserve.evidence.figure_diff.plot_moved import draw_moved

        moved = _data(draw_moved(worst), "svg+xml")
    difference = no_difference = ""
    if item.pixels is not None and not same and item.reference and item.new:
        old, now = pixels.read_pixels(item.reference), pixels.read_pixels(item.new)
        picture = pixels.show_difference(old, now, item.pixels.place)
        difference = _data(pixels.to_png(picture), "png")
    elif item.pixels is None and item.kind == "figure":
        no_difference = _why_no_difference(item)
    return _Shown(
        item,
        _picture(item.reference),
        "" if same else _picture(item.new),
        difference,
        moved,
        len(worst),
        no_difference,
    )


def _why_no_difference(item: Item) -> str:
    if item.new is None:
        return "There is nothing to compare: the figure was not built."
    if item.reference is None:
        return "There is nothing to compare: there is no reference figure."
    return "The two cannot be compared."


def _excess(series: MovedSeries) -> float:
    """How many tolerances a series is off; without end if it has other rows, or one is nan."""
    if len(series.golden) != len(series.new) or not series.tolerance:
        return float("inf")
    off = float(np.max(np.abs(series.new - series.golden)))
    return float("inf") if np.isnan(off) else off / series.tolerance


def _picture(path: Path | None) -> str:
    """A drawing as data, whatever its format; nothing if it cannot be decoded."""
    if path is None:
        return ""
    try:
        pixels.read_pixels(path)
        return _data(path.read_bytes(), "png")
    except (ReobserveError, OSError):
        return ""


def _data(content: bytes, kind: str) -> str:
    return f"data:image/{kind};base64,{base64.b64encode(content).decode()}"
