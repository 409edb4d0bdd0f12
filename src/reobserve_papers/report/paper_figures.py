"""The figures of a paper, one by one: settings, printed numbers beside ours, and what differs."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass

from reobserve_papers.claims.checks import Reference
from reobserve_papers.claims.entries import PaperFigure, PrintedNumber
from reobserve_papers.metrics.metrics import Metric
from reobserve_papers.parameters.parameters import Parameters
from reobserve_papers.report.assumptions import AssumptionRow

# How many digits of our numbers are worth reading beside what a paper prints.
_DIGITS = 3


@dataclass(frozen=True)
class FigureRow:
    """A figure of a paper.

    ``ours`` names the figures that show it, empty where ``not_reproduced`` says why. Of the
    settings of the first of them, ``printed`` and ``assumed`` are counted, ``searched`` are the
    keys of those that were chosen for what the paper shows. ``numbers`` say what of what the paper
    prints, as it prints it, and ours.
    """

    name: str
    shows: str
    ours: tuple[str, ...]
    not_reproduced: str
    printed: int
    assumed: int
    searched: tuple[str, ...]
    numbers: tuple[tuple[str, str, str], ...]
    differs: str


def figure_rows(
    figures: Mapping[str, PaperFigure],
    parameters: Parameters,
    entries: Iterable[AssumptionRow],
    metrics: Callable[[str], Sequence[Metric] | None],
) -> list[FigureRow]:
    """A row for each figure of a paper, in its order.

    ``metrics`` gives those of one of our figures, or of the theory, or None if these are missing.
    """
    known = list(entries)
    return [_row(name, figure, parameters, known, metrics) for name, figure in figures.items()]


def _row(
    name: str,
    figure: PaperFigure,
    parameters: Parameters,
    entries: Sequence[AssumptionRow],
    metrics: Callable[[str], Sequence[Metric] | None],
) -> FigureRow:
    settings = _settings(parameters, figure.ours[0], entries) if figure.ours else []
    searched = [row.keys[0] for row in settings if row.chosen_for]
    assumed = sum(row.status == "assumed" for row in settings if not row.chosen_for)
    return FigureRow(
        name=name,
        shows=figure.shows,
        ours=tuple(figure.ours),
        not_reproduced=figure.not_reproduced or "",
        printed=len(settings) - assumed - len(searched),
        assumed=assumed,
        searched=tuple(searched),
        numbers=tuple((entry.what, entry.text, _ours(entry, metrics)) for entry in figure.printed),
        differs=figure.differs or "",
    )


def _settings(
    parameters: Parameters, figure: str, entries: Sequence[AssumptionRow]
) -> list[AssumptionRow]:
    """The entries on which the curves of a figure depend, except numerical ones.

    They are those of the plant, the figure's scenario and observers, and the designs of these.
    """
    body = parameters.tree["figures"][figure]
    observers = body.get("observers", [])
    designs = {parameters.tree["observers"][name].get("design") for name in observers} - {None}
    branches = [("plant",), *(("observers", name) for name in observers)]
    branches += [("scenarios", body["scenario"])] if "scenario" in body else []
    branches += [("designs", name) for name in designs]
    return [
        row
        for row in entries
        if not row.numerical
        and any(tuple(key.split("."))[: len(path)] == path for key in row.keys for path in branches)
    ]


def _ours(printed: PrintedNumber, metrics: Callable[[str], Sequence[Metric] | None]) -> str:
    reference = Reference.parse(printed.value)
    rows = metrics(reference.figure)
    if rows is None:
        return "not there"
    value = reference.look_up(
        {reference.figure: {(metric.observer, metric.metric): metric.value for metric in rows}}
    )
    if printed.text.endswith("%"):
        return f"{_short(100 * value)} %"
    units = {(metric.observer, metric.metric): metric.unit for metric in rows}
    unit = printed.unit or units[reference.observer, reference.metric]
    return f"{_short(printed.scale * value)} {'' if unit in ('1', 'word') else unit}".strip()


def _short(value: float) -> str:
    return f"{value + 0.0:.{_DIGITS}g}".replace("-", "−")
