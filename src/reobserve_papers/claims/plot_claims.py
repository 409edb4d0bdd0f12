"""Plot of the choices that separate the outcomes of claims."""

from __future__ import annotations

import textwrap
from collections.abc import Mapping, Sequence

from matplotlib.figure import Figure

from reobserve_papers.claims.inquiry import Robustness
from reobserve_papers.claims.registry import Claim
from reobserve_papers.claims.separation import DECIDES, SEPARATED, separation
from reobserve_papers.plotting.style_sheet import WIDTH

_SMALL = 6.3  # points
_TINY = 6.0  # points
_LEFT = 2.35  # inches, for the names of choices
_ROW, _ABOVE, _BELOW = 0.13, 0.05, 0.6  # inches
_GAP = 1.2  # rows, above a title
_LETTERS = 125  # of a line of a title
_MAX_BARS = 4  # the largest; the others seldom explain more than chance does


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
    height = _ROW * rows + _ABOVE + _BELOW
    figure = _figure(height)
    right = 0.98  # of the width
    axes = figure.add_axes(
        (_LEFT / WIDTH, _BELOW / height, right - _LEFT / WIDTH, _ROW * rows / height)
    )
    row, places, labels = 0.0, [], []
    for claim, choice, said, bars in shown:
        row += len(said) + _GAP
        axes.text(
            -_LEFT / (right * WIDTH - _LEFT) + 0.01, row - 0.7, "\n".join(said), fontsize=7,
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


def short_labels(claim: Claim, names: Sequence[str]) -> list[str]:
    """Choices in words, with what they belong to where a claim has several of the same name."""
    labels = list(map(claim.label, names))
    words = [label.words for label in labels]
    return [str(label) if words.count(label.words) > 1 else label.words for label in labels]


def _plain(text: str) -> str:
    return text.replace("_", " ").replace("=", " ")


def _said(sentence: str) -> Figure:
    """Say that there is nothing to draw, in place of panels."""
    figure = _figure(0.5)
    figure.text(0.02, 0.5, sentence, va="center")
    return figure


def _figure(height: float) -> Figure:
    """An empty figure of a height in inches, whose parts are placed by hand, which is faster."""
    figure = Figure(figsize=(WIDTH, height))
    figure.set_layout_engine("none")
    return figure
