"""Plots of samples: specification curves of main claims, and the choices that separate them.

The curve has the deciding number over all samples in order, the bound across it, and below it where
in its range each choice stood (Simonsohn, Simmons & Nelson 2020, Nat. Hum. Behav. 4:1208).
"""

from __future__ import annotations

import math
import textwrap
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from reobserve_papers.claims.checks import Check, Numbers
from reobserve_papers.claims.inquiry import Robustness
from reobserve_papers.claims.outcomes import deciding as deciding_of
from reobserve_papers.claims.outcomes import nested
from reobserve_papers.claims.registry import Claim
from reobserve_papers.claims.separation import DECIDES, SEPARATED, are_numbers, separation
from reobserve_papers.plotting.style_sheet import WIDTH

_HELD, _FAILED, _STATED = "#1a1a1a", "#c4500a", "#2a7fc1"
_OTHER = "other"  # of a sample: this check is satisfied, and another one is not
_MARKS: dict[object, tuple[str, str, str]] = {
    True: ("claim holds", _HELD, "o"),
    False: ("claim fails", _FAILED, "x"),
    _OTHER: ("fails by another check", "0.5", "+"),
}
_WIDEST = 1e12  # maximum ratio of the ends of a logarithmic axis; smaller values are below it
_SMALL = 6.3  # points
_TINY = 6.0  # points
_LEFT = 2.35  # inches, for the names of choices
_ROW = 0.13  # inches
_GAP = 1.2  # rows, above a title
_LETTERS = 125  # of a line of a title
_MAX_BARS = 4  # the largest; the others seldom explain more than chance does


def specification_curves(
    claims: Sequence[Claim], sampled: Mapping[str, Robustness], parameter_file: Numbers
) -> Figure:
    """Draw specification curves of the main claims that were sampled, one below the other."""
    drawn = [claim for claim in claims if claim.is_main and claim.name in sampled]
    drawn = [claim for claim in drawn if sampled[claim.name].samples]
    if not drawn:
        return _said("No main claim depends on a choice that could be sampled.")
    rows = [len(sampled[claim.name].names) for claim in drawn]
    figure, panels = _stack(
        [place for count in rows for place in ((0.45, 1.5), (0.06, 0.05 + 0.13 * count))], 0.25
    )
    for claim, curve, choices in zip(drawn, panels[::2], panels[1::2], strict=True):
        _curve(curve, choices, claim, sampled[claim.name], parameter_file)
    return figure


def sensitivity_bars(
    claims: Sequence[Claim], sampled: Mapping[str, Robustness], verdicts: Mapping[str, str]
) -> Figure:
    """Draw how much each choice explains of the outcomes of claims that depend or are undecided."""
    shown = []
    for claim in claims:
        if verdicts[claim.name] in SEPARATED and claim.name in sampled:
            samples = sampled[claim.name]
            choice, sentence, _, splits = separation(claim, samples, samples.outcomes(claim))
            if splits:
                said = textwrap.wrap(f"{_plain(claim.name)}: {sentence}", _LETTERS)
                shown.append((claim, choice, said, list(splits.items())[:_MAX_BARS]))
    if not shown:
        return _said("No claim has enough samples to tell on which choice it depends.")
    rows = sum(len(bars) + len(said) + _GAP for _, _, said, bars in shown)
    figure, (axes,) = _stack([(0.05, _ROW * rows)], 0.6)
    row, places, labels = 0.0, [], []
    for claim, choice, said, bars in shown:
        row += len(said) + _GAP
        axes.text(
            -_LEFT / (0.98 * WIDTH - _LEFT) + 0.01, row - 0.7, "\n".join(said), fontsize=7,
            transform=axes.get_yaxis_transform(), va="bottom",
            bbox={"facecolor": "white", "linewidth": 0, "pad": 0.5},
        )  # fmt: skip
        labels += short_labels(claim, [name for name, _ in bars])
        for name, split in bars:
            axes.barh(row, split.explained, 0.7, color="0.25" if name == choice else "0.75")
            places.append(row)
            row += 1
    axes.set_yticks(places, labels, fontsize=_TINY)
    axes.set_ylim(rows - 0.4, 0.0)
    axes.grid(axis="y", visible=False)
    axes.set_axisbelow(True)
    axes.spines["left"].set_visible(False)
    axes.set_xlim(0, 1)
    axes.set_xlabel(
        "share of the outcomes that a choice explains, in samples in which it was not sought;\n"
        f"dark: it explained most where it was sought, and explains {DECIDES:g} or more here",
        fontsize=_SMALL,
    )
    return figure


def _stack(places: Sequence[tuple[float, float]], below: float) -> tuple[Figure, list[Axes]]:
    """Panels under each other, each with a gap above it and a height, in inches.

    They are placed here: to find places for as many takes longer than all the rest.
    """
    height = sum(gap + size for gap, size in places) + below
    figure = Figure(figsize=(WIDTH, height))
    figure.set_layout_engine("none")
    panels, top = [], height
    for gap, size in places:
        top -= gap + size
        panels.append(
            figure.add_axes((_LEFT / WIDTH, top / height, 0.98 - _LEFT / WIDTH, size / height))
        )
    return figure, panels


def _curve(
    curve: Axes, choices: Axes, claim: Claim, samples: Robustness, parameter_file: Numbers
) -> None:
    drawn = [trial.numbers for trial in samples.trials]
    deciding = [deciding_of(claim, None if one is None else nested(one)) for one in drawn]
    k = deciding_check(claim, deciding)
    check, outcomes = claim.checks[k], samples.outcomes(claim)
    order = sorted(
        (number for number, present in enumerate(deciding) if present),
        key=lambda number: _last_if_none(deciding[number][k]),
    )
    numbers = [deciding[number][k] for number in order]
    holding = [outcomes[number] == "holds" for number in order]
    marks = [
        _OTHER if not holds and check.satisfied_by(number) else holds
        for holds, number in zip(holding, numbers, strict=True)
    ]
    for kind, (label, color, marker) in _MARKS.items():
        places = [x for x, mark in enumerate(marks) if mark == kind and math.isfinite(numbers[x])]
        if places or kind != _OTHER:
            shown = [numbers[x] for x in places]
            curve.plot(places, shown, marker, color=color, markersize=3, label=label)
    for bound in _bounds(check):
        curve.axhline(bound, color="0.4", linewidth=0.8, linestyle=(0, (5, 2)))
    own = deciding_of(claim, parameter_file)
    stated = own[k] if own else math.nan
    if math.isfinite(stated):
        curve.axhline(stated, color=_STATED, linewidth=0.8, label="parameter file")
    _scale(curve, [*filter(math.isfinite, [*numbers, stated])], _bounds(check))
    lost = samples.samples - len(order)
    noted = f" ({lost} diverged or were refused)" if lost else ""
    curve.set_title(
        f"{_plain(claim.name)}: held in {_held(claim, samples)} of {samples.samples} samples{noted}"
    )
    curve.set_ylabel("\n".join(textwrap.wrap(_spelled(check), 26)), fontsize=_SMALL)
    curve.legend(fontsize=_SMALL, ncols=3, loc="best")
    curve.set_xticks([])
    for row in range(len(samples.names)):
        shades = _in_range([samples.trials[number].values[row] for number in order])
        choices.scatter(
            range(len(order)), [row] * len(order), c=shades, cmap="Greys", vmin=-0.25, vmax=1.0,
            s=9, marker="s", linewidths=0,
        )  # fmt: skip
    labels = short_labels(claim, samples.names)
    choices.set_yticks(range(len(labels)), labels, fontsize=_TINY)
    choices.set_ylim(len(labels) - 0.4, -0.6)
    choices.set_xlim(curve.get_xlim())
    choices.set_xlabel(
        "samples in order; dark: high in its range, or late among its words in alphabetic order",
        fontsize=_SMALL,
    )
    choices.set_xticks([])
    choices.grid(visible=False)


def deciding_check(claim: Claim, numbers: Sequence[tuple[float, ...]]) -> int:
    """The check that fails in most samples, the first of those that fail as often."""
    fails = [
        sum(not check.satisfied_by(row[k]) for row in numbers if row)
        for k, check in enumerate(claim.checks)
    ]
    return fails.index(max(fails))


def _held(claim: Claim, samples: Robustness) -> int:
    return samples.outcomes(claim).count("holds")


def _bounds(check: Check) -> list[float]:
    """The line or lines that the number must stay below, above or between."""
    if check.relation in ("falling", "rising"):
        return [0.0]
    if check.relation == "within":
        return list(map(float, check.bound))
    return [] if check.relation == "exists" else [float(check.bound)]


def _scale(axes: Axes, numbers: Sequence[float], bounds: Sequence[float]) -> None:
    """Magnitudes where numbers span two decades, so that the bounds are in sight."""
    shown = [*numbers, *bounds]
    low, high = min(shown, default=1.0), max(shown, default=1.0)
    if low > 0 and high > 100 * low:
        axes.set_yscale("log")
        axes.set_ylim(bottom=max(low, min([high, *bounds]) / _WIDEST) / 2)


def _last_if_none(number: float) -> float:
    return math.inf if math.isnan(number) else number


def _in_range(values: Sequence[Any]) -> list[float]:
    """Places of values in order, from 0 to 1."""
    ordered = values if are_numbers(values) else list(map(repr, values))
    _, places = np.unique(ordered, return_inverse=True)
    shades: list[float] = (places / max(*places, 1)).tolist()
    return shades


def short_labels(claim: Claim, names: Sequence[str]) -> list[str]:
    """Choices in words, with what they belong to where a claim has several of the same name."""
    labels = list(map(claim.label, names))
    words = [label.words for label in labels]
    return [str(label) if words.count(label.words) > 1 else label.words for label in labels]


def _spelled(check: Check) -> str:
    """The label of the axis: numbers of figures or of the theory, in words."""
    value = check.value[0]
    name = f"{value.metric} of {value.observer}, {value.figure}"
    if not check.how:
        return _plain(name)
    other = check.other[0]
    how = "over" if check.how == "over" else "less"
    return _plain(f"{name} {how} that of {other.observer}")


def _plain(text: str) -> str:
    return text.replace("_", " ").replace("=", " ")


def _said(sentence: str) -> Figure:
    """Say that there is nothing to draw, in place of panels."""
    figure = Figure(figsize=(WIDTH, 0.5))
    figure.set_layout_engine("none")
    figure.text(0.02, 0.5, sentence, va="center")
    return figure
