"""The specification curve of a paper: its title and main claims over all alternatives.

Each column is one alternative, the conventions as stated first. Above stands the share of main
claims that are reproduced, below the verdict on each of them (Simonsohn, Simmons & Nelson 2020,
Nat. Hum. Behav. 4:1208).
"""

from __future__ import annotations

import textwrap
from collections.abc import Mapping, Sequence

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from reobserve_papers.claims.registry import Claim
from reobserve_papers.claims.title import STATED, Title
from reobserve_papers.claims.verdict_rules import (
    CALIBRATED,
    CONTRADICTED,
    DEPENDS,
    NOT_RE,
    OPEN,
    RE,
    REPRODUCED,
    UNDECIDED,
)
from reobserve_papers.plotting.style_sheet import WIDTH

# Marks and greys that stay apart in print.
_VERDICTS = {
    REPRODUCED: ("s", "0.1"), CALIBRATED: ("^", "0.35"), DEPENDS: ("s", "0.65"),
    UNDECIDED: ("+", "0.4"), CONTRADICTED: ("x", "#c4500a"),
}  # fmt: skip
_TITLES = {RE: ("o", "0.1"), OPEN: ("D", "0.6"), NOT_RE: ("x", "#c4500a")}
_SMALL = 6.3  # points
_LEFT = 1.75  # inches, for the names of claims
_MOST = 14  # names of alternatives below the panels
_WRAP = 112  # characters


def alternatives_curve(
    claims: Sequence[Claim],
    title: Title,
    rows: Sequence[Mapping[str, str]],
    verdicts: Mapping[str, str],
) -> Figure:
    """Draw the curve.

    Parameters
    ----------
    claims
        The claims of the paper.
    title
        Its title.
    rows
        What the alternatives change, as `read_alternatives` gives it.
    verdicts
        The verdicts by the conventions as stated, by claim.
    """
    mains = [c.name for c in claims if c.is_main and verdicts.get(c.name) in _VERDICTS]
    by: dict[str, dict[str, str]] = {STATED: {}}
    plain = title.word
    titles = {STATED: plain}
    for row in rows:
        changed = by.setdefault(row["alternative"], {})
        titles[row["alternative"]] = row["other_title"]
        if row["claim"]:
            changed[row["claim"]] = row["other"]
    order = [
        STATED,
        *sorted((n for n in by if n != STATED), key=lambda n: -_share(by[n], mains, verdicts)),
    ]
    turning = [name for name in order if titles[name] != plain]
    lines = _names(order, turning, len(by) - 1)
    heights = (1.2, 0.16 * max(len(mains), 1), 0.12 * len(lines))
    figure = Figure(figsize=(WIDTH, sum(heights) + 0.75))
    figure.set_layout_engine("none")
    above, below = _panels(figure, heights)
    for word, (marker, color) in _TITLES.items():
        places = [k for k, name in enumerate(order) if titles[name] == word]
        if places:
            shares = [_share(by[order[k]], mains, verdicts) for k in places]
            above.plot(
                places, shares, linestyle="", marker=marker, color=color, markersize=3.5, label=word
            )
    above.set_ylim(-0.08, 1.08)
    low = max(_share(by[name], mains, verdicts) for name in order) < 0.6
    above.set_ylabel("share of main\nclaims reproduced", fontsize=_SMALL)
    above.legend(
        fontsize=_SMALL,
        ncols=3,
        loc="upper right" if low else "lower left",
        title="title",
        title_fontsize=_SMALL,
    )
    above.set_title(f"{title.word} with {len(by) - 1} alternatives, each alone; first: as stated")
    above.set_xticks([])
    for word, (marker, color) in _VERDICTS.items():
        spots = [
            (k, row)
            for k, name in enumerate(order)
            for row, claim in enumerate(mains)
            if by[name].get(claim, verdicts[claim]) == word
        ]
        if spots:
            below.plot(
                *zip(*spots, strict=True), linestyle="", marker=marker, color=color, markersize=3,
                label=word,
            )  # fmt: skip
    below.set_yticks(range(len(mains)), [name.replace("_", " ") for name in mains], fontsize=_SMALL)
    below.set_ylim(len(mains) - 0.4, -0.6)
    below.set_xlim(above.get_xlim())
    below.set_xticks([])
    below.grid(visible=False)
    below.legend(
        fontsize=_SMALL,
        ncols=5,
        loc="upper center",
        bbox_to_anchor=(0.35, -0.02),
        frameon=False,
        columnspacing=1.0,
        handletextpad=0.2,
    )
    figure.text(0.02, 0.01, "\n".join(lines), fontsize=5.6, va="bottom", linespacing=1.25)
    return figure


def _share(changed: Mapping[str, str], mains: Sequence[str], verdicts: Mapping[str, str]) -> float:
    words = [changed.get(claim, verdicts[claim]) for claim in mains]
    return words.count(REPRODUCED) / len(words) if words else 0.0


def _panels(figure: Figure, heights: tuple[float, float, float]) -> tuple[Axes, Axes]:
    total = figure.get_figheight()
    left, width = _LEFT / WIDTH, 0.98 - _LEFT / WIDTH
    top = (total - 0.3 - heights[0]) / total
    next_top = top - (0.08 + heights[1]) / total
    above = figure.add_axes((left, top, width, heights[0] / total))
    below = figure.add_axes((left, next_top, width, heights[1] / total))
    return above, below


def _names(order: Sequence[str], turning: Sequence[str], tried: int) -> list[str]:
    """The alternatives that change the title, by name, as many as fit below the panels."""
    if not turning:
        return [f"None of the {tried} alternatives changes the title."]
    more = f"; and {len(turning) - _MOST} more" if len(turning) > _MOST else ""
    text = f"The title is another with: {'; '.join(turning[:_MOST])}{more}."
    return textwrap.wrap(text, _WRAP)
