"""Detected faults, false alarms and delays against the nu-gap between the models, by detector."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
from matplotlib.figure import Figure

from reobserve.papers.imm import keys
from reobserve.papers.imm.detection import DetectionRates, curve
from reobserve.papers.imm.notes import style_of
from reobserve.papers.imm.study_rows import CUSUM, DRIVEN, GLR, UNMIXED, sweep_kind, with_scales
from reobserve.plotting.figures import STYLES, Style, add_note, blank
from reobserve.plotting.look import mark, points, thick
from reobserve.replication.parameters.figure_data import FigureData

_GREEN = STYLES[4]
_RED = Style("#b3265e", (0, (3, 1, 1, 1, 1, 1)), 1.1, "p")

ROWS = ("detected share", "false alarms", "median delay [ms]")


def draw(data: FigureData) -> Figure:
    """Detected faults, false alarms and median delays, one column per plant and noise level."""
    job, study = data.job, data.study
    styles, labels = _detectors(with_scales(job.observers, job.study.layer_scales))
    sweeps = study.levels("sweep")
    figure = blank(6.3)
    panels = figure.subplots(
        3, len(sweeps), sharex=True, sharey="row", squeeze=False, height_ratios=(2.4, 1.1, 1.7)
    )
    for column, sweep in enumerate(sweeps):
        shares, alarms, delays = panels[:, column]
        for order, (name, style) in enumerate(styles.items()):
            found = curve(study, name, sweep)
            gap = np.array([one.gap for one in found])
            # Side by side, so that bars and markers of the same height can be distinguished.
            apart = gap * 1.035 ** (order - (len(styles) - 1) / 2)
            value = [one.detected.value for one in found]
            shares.plot(apart, value, **style.points(), label=labels[name])
            shares.vlines(
                apart, *_limits(found), color=style.color, linewidth=thick(0.6), alpha=0.6
            )
            mean = [one.alarmed.value for one in found]
            alarms.plot(apart, mean, **{**style.points(), "linestyle": "", "markersize": mark(3)})
            delays.plot(apart, [1000 * one.delay for one in found], **style.points())
        plant, level = sweep_kind(sweep)
        shares.set_title(
            f"({'abcdefgh'[column]}) noise {level:.0%}"
            + (",\nprocess noise of Q" if plant == DRIVEN else "\n"),
            fontsize=points(8),
        )  # fmt: skip
        shares.axhline(job.study.enough, color="0.4", linewidth=thick(0.8), linestyle=":")
        for axes in (shares, alarms):
            axes.axhline(
                job.study.false_alarm_probability, color="0.4", linewidth=thick(0.8), linestyle=":"
            )
        panels[-1, column].set_xlabel("ν-gap")
    panels[0, 0].set_ylim(-0.04, 1.04)
    panels[1, 0].set_ylim(-0.015, None)
    panels[2, 0].set_yscale("log")
    panels[2, 0].yaxis.set_major_formatter("{x:g}")
    for axes, what in zip(panels[:, 0], ROWS, strict=True):
        axes.set_ylabel(what)
    for axes in panels.flat:
        axes.set_xscale("log")
        axes.set_xticks((0.001, 0.01, 0.1), ("0.001", "0.01", "0.1"))
    handles, names = panels[0, 0].get_legend_handles_labels()
    figure.legend(handles, names, loc="outside upper left", ncols=4, columnspacing=1.2)
    add_note(figure, _note(job.study))
    return figure


def _limits(found: list[DetectionRates]) -> tuple[list[float], list[float]]:
    low, high = zip(*(one.detected.interval for one in found), strict=True)
    return list(low), list(high)


def _detectors(
    observers: Mapping[str, keys.Observer],
) -> tuple[dict[str, Style], dict[str, str]]:
    """Style and label of each detector; banks have those of the other figures."""
    styles: dict[str, Style] = {}
    labels: dict[str, str] = {}
    for name, body in observers.items():
        styles[name], labels[name] = style_of(body), body.label
        if "_scale_" in name and isinstance(body, keys.SmoothVariableStructure):
            styles[name] = replace(_GREEN, marker="v")
            labels[name] = f"SVSF-IMM, ψ × {body.layer_scale:g}"
    first = next(iter(observers.values()))
    styles[UNMIXED] = style_of(replace(first, mixing=False))
    styles[CUSUM], styles[GLR] = _RED, Style("0.55", "-", 1.6, "x")
    labels |= {
        UNMIXED: f"{first.label}, no mixing",
        CUSUM: "CUSUM of two KFs",
        GLR: "GLR of the normal KF",
    }
    return styles, labels


def _note(study: keys.Closeness) -> str:
    window = study.horizon - study.onset
    return (
        f"A fault is detected if its alarm comes within {window:g} s; {study.runs:g} runs a point, "
        "bars are Wilson's intervals of 95 %. Thresholds are those that\n"
        f"{study.false_alarm_probability:.0%} of runs without a fault exceed in "
        f"{study.onset - study.settling:g} s (dotted below), from {study.faultless_runs:g} other "
        "runs each. Dotted above: "
        f"{study.enough:.0%}. Delays stand where\nmost faults are detected. Points of one ν-gap "
        "stand side by side."
    )
