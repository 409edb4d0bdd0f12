"""The specification curve of a paper: its title and main claims over the alternatives to these.

Each column is one alternative, the conventions as stated first. Above stands the share of main
claims that are reproduced, below the verdict on each of them (Simonsohn, Simmons & Nelson 2020,
Nat. Hum. Behav. 4:1208). Main claims are those by the alternative. What lacks samples is hollow.
"""

from __future__ import annotations

import textwrap
from collections.abc import Mapping, Sequence
from collections.abc import Set as AbstractSet
from dataclasses import dataclass
from typing import Any

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from reobserve_papers.claims.title import LACKS, NOT_COMPUTED, STATED, TITLE, Row, Title
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

# Marks and greys that stay apart in print, each with an inside that can be left empty.
_VERDICTS = {
    REPRODUCED: ("s", "0.1"), CALIBRATED: ("^", "0.35"), DEPENDS: ("s", "0.65"),
    UNDECIDED: ("P", "0.4"), CONTRADICTED: ("X", "#c4500a"),
}  # fmt: skip
_TITLES = {RE: ("o", "0.1"), OPEN: ("D", "0.6"), NOT_RE: ("X", "#c4500a")}
_SMALL = 6.3  # points
_LEFT = 1.75  # inches, for the names of claims
_MOST = 14  # names of alternatives below the panels
_WRAP = 112  # characters


@dataclass(frozen=True)
class Column:
    """An alternative: title, verdicts on its main claims, and which of these lack samples."""

    name: str
    title: str
    verdicts: Mapping[str, str]
    lacking: AbstractSet[str] = frozenset()

    @property
    def share(self) -> float:
        """The share of its main claims that are reproduced."""
        words = [*self.verdicts.values()]
        return words.count(REPRODUCED) / len(words) if words else 0.0

    @property
    def place(self) -> tuple[Any, ...]:
        """The place in the order of columns: a falling share, then alike beside alike."""
        alike = [(claim in self.lacking, verdict) for claim, verdict in self.verdicts.items()]
        return -self.share, self.title, len(alike), [*self.verdicts], alike


def columns_of(title: Title, rows: Sequence[Row], verdicts: Mapping[str, str]) -> list[Column]:
    """The conventions as stated, then the alternatives that touch the title, in order."""
    by: dict[str, list[Row]] = {}
    for row in rows:
        if row["touches"] == TITLE:
            by.setdefault(row["alternative"], []).append(row)
    found = []
    for name, own in by.items():
        mains, others = own[0]["mains"].split(), {row["claim"]: row["other"] for row in own}
        lacking = {row["claim"] for row in own if row["note"] in (LACKS, NOT_COMPUTED)}
        words = {claim: others.get(claim, verdicts[claim]) for claim in mains}
        found.append(Column(name, own[0]["other_title"], words, lacking.intersection(mains)))
    return [Column(STATED, title.word, title.mains), *sorted(found, key=lambda one: one.place)]


def alternatives_curve(title: Title, rows: Sequence[Row], verdicts: Mapping[str, str]) -> Figure:
    """Draw the curve.

    Parameters
    ----------
    title
        The title of the paper.
    rows
        What the alternatives change, as `read_alternatives` gives it.
    verdicts
        The verdicts by the conventions as stated, by claim.
    """
    columns = columns_of(title, rows, verdicts)
    mains = [*dict.fromkeys(claim for column in columns for claim in column.verdicts)]
    lines = _names(columns, title.word)
    heights = (1.2, 0.16 * max(len(mains), 1), 0.12 * len(lines))
    figure = Figure(figsize=(WIDTH, sum(heights) + 0.75))
    figure.set_layout_engine("none")
    above, below = _panels(figure, heights)
    for word, mark in _TITLES.items():
        spots = [
            (k, column.share, bool(column.lacking))
            for k, column in enumerate(columns)
            if column.title == word
        ]
        _draw(above, spots, word, *mark, 3.5)
    for word, mark in _VERDICTS.items():
        spots = [
            (k, mains.index(claim), claim in column.lacking)
            for k, column in enumerate(columns)
            for claim, verdict in column.verdicts.items()
            if verdict == word
        ]
        _draw(below, spots, word, *mark, 3.0)
    above.plot([], [], "o", color="0.4", fillstyle="none", markersize=3.5, label="lacks samples")
    above.set_xlim(-2, len(columns) + 1)
    above.set_ylim(-0.08, 1.08)
    above.set_ylabel("share of main\nclaims reproduced", fontsize=_SMALL)
    low = sorted(column.share for column in columns)[len(columns) // 2] < 0.5
    above.legend(
        fontsize=_SMALL,
        ncols=4,
        loc="upper right" if low else "lower left",
        title="title",
        title_fontsize=_SMALL,
    )
    tried = len(columns) - 1
    above.set_title(f"{title.word} with {tried} alternatives, each alone; first: as stated")
    above.set_xticks([])
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


def _draw(
    axes: Axes, spots: Sequence[tuple[int, float, bool]], word: str, marker: str, color: str,
    size: float,
) -> None:  # fmt: skip
    """Draw marks at places, those that lack samples hollow."""
    for hollow in (False, True):
        places = [(x, y) for x, y, lacks in spots if lacks == hollow]
        look: dict[str, Any] = {"markerfacecolor": "white"} if hollow else {"label": word}
        if places or (spots and not hollow):
            axes.plot(
                *(zip(*places, strict=True) if places else ([], [])), linestyle="", marker=marker,
                color=color, markersize=size, markeredgewidth=0.6, **look,
            )  # fmt: skip


def _panels(figure: Figure, heights: tuple[float, float, float]) -> tuple[Axes, Axes]:
    total = figure.get_figheight()
    left, width = _LEFT / WIDTH, 0.98 - _LEFT / WIDTH
    top = (total - 0.3 - heights[0]) / total
    next_top = top - (0.08 + heights[1]) / total
    above = figure.add_axes((left, top, width, heights[0] / total))
    below = figure.add_axes((left, next_top, width, heights[1] / total))
    return above, below


def _names(columns: Sequence[Column], stated: str) -> list[str]:
    """The alternatives that change the title, by name, as many as fit below the panels."""
    turning = [column.name for column in columns if column.title != stated]
    if not turning:
        return [f"None of the {len(columns) - 1} alternatives changes the title."]
    more = f"; and {len(turning) - _MOST} more" if len(turning) > _MOST else ""
    text = f"The title is another with: {'; '.join(turning[:_MOST])}{more}."
    return textwrap.wrap(text, _WRAP)
