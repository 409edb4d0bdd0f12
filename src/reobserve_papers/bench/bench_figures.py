"""Figures of the bench: a heat map, errors over levels and evaluations, delays of detectors."""

from __future__ import annotations

import math
import textwrap
from statistics import median

from matplotlib.axes import Axes
from matplotlib.patches import Rectangle
from matplotlib.ticker import LogLocator

from reobserve.tuning.results import UNDECIDED, Results
from reobserve.tuning.task import Task
from reobserve_papers.plotting.figures import STYLES, PaperFigure, Style, add_note, blank, few_ticks
from reobserve_papers.plotting.style_sheet import mark, points

_WORST = 2.0  # the ratio to the best at which the colour is darkest


def heat_map(results: Results) -> PaperFigure:
    """Methods by conditions: the error in the cell, its ratio to the best as the colour."""
    task, rows = results.task, results.rows()
    figure = blank(0.75 + 0.21 * len(rows))
    axes = figure.subplots()
    for y, (_, name, training, noise_given) in enumerate(rows):
        for x, condition in enumerate(task.table):
            cell = results.cell(condition, name, training, noise_given)
            if cell is None:
                continue
            shade = min(math.log(max(cell["ratio"], 1.0)) / math.log(_WORST), 1.0)
            axes.add_patch(Rectangle(
                (x - 0.5, y - 0.5), 1, 1, facecolor=str(0.95 - 0.55 * shade), edgecolor="white",
                hatch="///" if cell["failed"] else "", linewidth=1.5,
            ))  # fmt: skip
            within = cell["within"]
            said = f"{cell['error']:#.3g}{UNDECIDED if within == 'undecided' else ''}"
            axes.text(
                x, y, said, ha="center", va="center",
                fontsize=points(8), fontweight="bold" if within == "yes" else "normal",
                fontstyle="italic" if within == "undecided" else "normal",
                color="white" if shade > 0.6 else "black",
            )  # fmt: skip
    axes.set_xlim(-0.5, len(task.table) - 0.5)
    axes.set_ylim(len(rows) - 0.5, -0.5)
    wide = max(56 // len(task.table), 8)
    titles = [
        textwrap.fill(
            task.conditions[key].title.replace(" %", "\u00a0%").replace("× ", "×\u00a0"),
            wide,
            break_long_words=False,
        )
        for key in task.table
    ]
    axes.set_xticks(range(len(titles)), titles, fontsize=points(7))
    axes.set_yticks(range(len(rows)), [label for label, *_ in rows])
    axes.tick_params(length=0, top=True, labeltop=True, bottom=False, labelbottom=False)
    axes.grid(visible=False)
    for spine in axes.spines.values():
        spine.set_visible(False)
    add_note(
        figure,
        "Normalised error on held-out records. Bold: within 5 % of the best in the column;",
        "italic with ?: undecided; neither: more than 5 % worse (both with 95 % confidence);",
        "darkness: the ratio to the best other row, from 1 to 2; hatched: some runs failed.",
    )
    return figure


def levels(results: Results) -> PaperFigure:
    """Errors over noise, over model error and over keys of the plant that conditions change.

    The errors are those of the heat map. Lines: frozen settings; crosses: given the noise; rings:
    tuned again.
    """
    axes_of = _axes(results.task)
    panels = {label: sorted(points) for label, points in axes_of.items() if points[1:]} or axes_of
    figure = blank(3.4)
    axes = figure.subplots(1, len(panels), sharey=True, squeeze=False)[0]
    for panel, (label, places) in zip(axes, panels.items(), strict=True):
        for name, style in zip(results.task.shown, STYLES, strict=False):
            _levels(panel, results, name, places, style)
        panel.set_xlabel(label)
        if places[0][0] > 0:
            panel.set_xscale("log")
            few_ticks(panel, [float(f"{level:.2g}") for level, _ in places])
    axes[0].set_yscale("log")
    axes[0].yaxis.set_major_locator(LogLocator(subs=(1, 2, 5)))
    axes[0].yaxis.set_major_formatter("{x:g}")
    axes[0].yaxis.set_minor_formatter("")
    axes[0].set_ylabel("normalised error")
    # Lines for methods, and what markers without a line stand for.
    for label, marker in (("the same, given the noise", "x"), ("tuned again", "o")):
        axes[0].plot([], [], marker, color="0.3", mfc="none", markersize=mark(4.5), label=label)
    _legend(figure, axes[0])
    return figure


def _legend(figure: PaperFigure, axes: Axes) -> None:
    """Put a legend above the panels, where it covers nothing."""
    handles = axes.get_legend_handles_labels()
    figure.legend(*handles, loc="outside upper center", ncols=3, fontsize=points(7))


def _axes(task: Task) -> dict[str, list[tuple[float, str]]]:
    """The levels and conditions that differ from the first in one axis alone, by its label."""
    first = next(iter(task.conditions))
    noise, model = "noise / nominal noise", "error of the model [%]"
    places = {noise: [(1.0, first)], model: [(0.0, first)]}
    for name, case in task.conditions.items():
        changed = [case.noise != 1, case.model != 0, case.period != 1, bool(case.plant)]
        if sum(changed) != 1 or changed[2] or len(case.plant) > 1:
            continue
        for key, value in case.plant.items():
            if isinstance(value, int | float):
                places.setdefault(key, [(task.plant[key], first)]).append((value, name))
        if not case.plant:
            places[noise if changed[0] else model].append(
                (case.noise, name) if changed[0] else (100 * case.model, name)
            )
    return places


def _levels(
    axes: Axes, results: Results, name: str, places: list[tuple[float, str]], style: Style
) -> None:
    """Plot a line for frozen settings, crosses where the noise is given, rings if re-tuned."""
    task, method = results.task, results.task.methods[name]
    others = {key: chosen.conditions for key, chosen in task.training.items() if key != task.main}
    again = {names[0]: key for key, names in others.items() if len(names) == 1}
    for label, training, noise_given, marks in (
        (method.label, {}, False, {"marker": style.marker, "linestyle": style.linestyle}),
        ("", {}, True, {"marker": "x", "linestyle": "none"}),
        ("", again, method.given_noise, {"marker": "o", "linestyle": "none", "mfc": "none"}),
    ):
        cells = [
            (place, results.cell(condition, name, training.get(condition, task.main), noise_given))
            for place, condition in places
            if not training or condition in training
        ]
        points = [(place, cell["error"]) for place, cell in cells if cell is not None]
        if points:
            x, y = zip(*points, strict=True)
            axes.plot(x, y, color=style.color, label=label, markersize=mark(4.5), **marks)


def evaluations(results: Results) -> PaperFigure:
    """The held-out error after a part of a search over that after all of it, median of repeats.

    So it has no level of its own beside the heat map's, which is on more records.
    """
    task = results.task
    figure = blank(2.6)
    axes = figure.subplots()
    for name, style in zip(task.shown, STYLES, strict=False):
        repeats = results.held_out(name)
        counts = list(repeats[0])
        errors = [median(repeat[n] / repeat[counts[-1]] for repeat in repeats) for n in counts]
        axes.plot(counts, errors, label=task.methods[name].label, **style.points())
    axes.set_xscale("log")
    few_ticks(axes, counts)
    axes.set_xlabel("evaluations")
    axes.set_ylabel("held-out error / final error")
    _legend(figure, axes)
    return figure


def detection(results: Results) -> PaperFigure:
    """Mean delay of detectors over the share of healthy records that alarm.

    Points: conditions in which the threshold is for another ``rate`` of false alarms.
    """
    task = results.task
    names = [name for name, condition in task.conditions.items() if "rate" in condition.plant]
    figure = blank(2.6)
    axes = figure.subplots()
    for name, style in zip(task.shown, STYLES, strict=False):
        cells = (results.cell(condition, name) for condition in names)
        points = [(cell["quantile"], cell["lag"]) for cell in cells if cell is not None]
        axes.plot(*zip(*points, strict=True), label=task.methods[name].label, **style.points())
    axes.set_xlabel("share of healthy records that alarm")
    axes.set_ylabel("mean delay [s]")
    _legend(figure, axes)
    return figure


FIGURES = {
    "heatmap": heat_map, "levels": levels, "evaluations": evaluations, "detection": detection,
}  # fmt: skip
