"""Stage plot: fault, estimate and error over time; the contrast over gains and noise."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from reobserve.drawing.figures import STYLES, TRUTH, Style, add_note, decades, new_figure, thin
from reobserve.errors import InputError
from reobserve.ledger.types import Job, Settings, named, read_job
from reobserve.papers.ilo import keys
from reobserve.papers.ilo.scoring import Errors
from reobserve.scoring.metrics import Metric
from reobserve.timeseries.series import Series

Rows = Sequence[Mapping[str, Any]]


def draw(
    settings: Settings,
    plant: Series,
    estimates: Mapping[str, Series],
    study: Rows | None,
    metrics: Sequence[Metric],
) -> Figure:
    """The figure in the layout that the ledger names: ``estimation`` or ``matching``.

    Raises
    ------
    InputError
        If there is no such layout, or ``matching`` has no study.
    """
    job = read_job(keys.Ledger, settings)
    layout = job.figure.layout
    if layout == "estimation":
        return _estimation(job, plant, estimates)
    if layout == "matching" and study is not None:
        return _matching(job, plant, estimates, study)
    raise InputError("layout", f"{layout!r} must be estimation, or matching with a study")


def _estimation(job: Job, plant: Series, estimates: Mapping[str, Series]) -> Figure:
    axis = job.metrics.axis
    labels = {name: job.observers[name].label for name in estimates}
    main = next(iter(estimates))
    figure, (above, middle, below) = new_figure((1.9, 1.35, 1.75))

    _fault(above, plant, axis)
    time, value = thin(estimates[main].time, estimates[main]["fault"][:, axis - 1])
    above.plot(time, value, **STYLES[0].line(), label=f"estimate v: {labels[main]}")
    above.set_ylabel("torque [N m]")
    above.set_title("(a) fault and its estimate")
    above.legend(loc="upper left", ncols=2)
    _headroom(above)

    for index, (name, estimate) in enumerate(estimates.items()):
        errors = Errors.of(plant, estimate, axis - 1)
        if name == main:
            middle.plot(*thin(errors.time, errors.start), **STYLES[0].line())
        with np.errstate(divide="ignore"):
            size = np.where(errors.start == 0, np.nan, np.abs(errors.start))
        below.semilogy(*_envelope(errors.time, size), **STYLES[index].line(), label=labels[name])
    middle.set_ylabel("error e [N m]")
    middle.set_title(f"(b) estimation error e = fault − v: {labels[main]}")
    below.set_ylabel("|e| [N m]")
    below.set_title("(c) size of the error (largest in each hundredth of a second)")
    below.set_ylim(1e-12, 10)
    decades(below.yaxis)
    below.set_xlabel("time [s]")
    below.set_xlim(plant.time[0], plant.time[-1])
    below.legend(loc="center right", bbox_to_anchor=(1.0, 0.34))
    add_note(figure, _note(job))
    return figure


def _fault(axes: Axes, plant: Series, axis: int) -> None:
    time, fault = thin(plant.time, plant["fault"][:, axis - 1])
    axes.plot(time, fault, **TRUTH.line(), label=f"fault of thruster {axis}")


def _headroom(axes: Axes) -> None:
    """Room for the legend above the curves."""
    low, high = axes.get_ylim()
    axes.set_ylim(low, high + 0.28 * (high - low))


def _envelope(time: Any, size: Any, width: float = 0.01) -> tuple[Any, Any]:
    """The largest value in each bin of ``width`` seconds."""
    per_bin = max(1, round(width / (time[1] - time[0])))
    bins = len(time) // per_bin
    blocks = size[: bins * per_bin].reshape(bins, per_bin)
    largest = np.where(np.isnan(blocks).all(axis=1), np.nan, np.fmax.reduce(blocks, axis=1))
    return time[: bins * per_bin : per_bin], largest


def _matching(job: Job, plant: Series, estimates: Mapping[str, Series], rows: Rows) -> Figure:
    names = job.study.observers
    labels = {name: job.observers[name].label for name in names}
    styles = dict(zip(names, STYLES, strict=False))
    axis = job.metrics.axis
    figure, (gains, noise, trace) = new_figure((2.1, 2.1, 1.5), share_time=False)

    families = (
        ("integral", "adaptive", "integral (adaptive observer)"),
        ("proportional_integral", "matched", "proportional-integral, Kₚ = Γτ/2"),
        ("ilo", "continuous", "ILO, continuous, K₁ = I, K₂ = Γτ"),
    )
    for family, like, label in families:
        _sweep(gains, rows, "integral_gain", family, styles[like], label)
    gains.set_xlabel("integral gain Γ [N m/rad]")
    gains.set_ylabel("relative RMS error [%]")
    gains.set_title("(a) error for the fault of Figs 3 and 4 over the integral gain")
    for name, place in (("adaptive", "Fig. 4"), ("matched", "ILO of Fig. 3")):
        gain = named(job.observers, name, keys.Adaptive).integral_gain
        gains.axvline(gain, color="0.5", linewidth=0.8, linestyle=":")
        gains.annotate(
            place, (gain, 0.06), xycoords=("data", "axes fraction"), xytext=(3, 0),
            textcoords="offset points", fontsize=7, color="0.3",
        )  # fmt: skip
    gains.legend(loc="lower left", bbox_to_anchor=(0.02, 0.1))

    for name in names:
        _sweep(noise, rows, "noise", name, styles[name], labels[name])
    noise.set_xlabel("standard deviation of the rate measurement [rad/s]")
    noise.set_ylabel("relative RMS error [%]")
    noise.set_title("(b) the same error over the measurement noise")
    noise.legend(loc="upper left", ncols=2)
    noise.set_ylim(top=30 * noise.get_ylim()[1])

    for name in ("continuous", "matched"):
        onset = plant.events["onsets"][0]
        errors = Errors.of(plant, estimates[name], axis - 1).window(onset - 0.1, onset + 2.5)
        trace.plot(*thin(errors.time, errors.start), **styles[name].line(), label=labels[name])
    trace.set_xlabel("time [s]")
    trace.set_ylabel("error e [N m]")
    trace.set_ylim(-0.06, 0.06)
    trace.set_title("(c) error of the ILO and of its match, without noise")
    trace.legend(loc="upper right")
    add_note(figure, _note(job))
    return figure


def _sweep(axes: Axes, rows: Rows, sweep: str, name: str, style: Style, label: str) -> None:
    """The mean over runs against the level, and the span of the runs behind it."""
    levels: dict[float, list[float]] = {}
    for row in rows:
        if row["sweep"] == sweep and row["observer"] == name:
            score = 100 * float(row["relative_rms_error"])
            levels.setdefault(float(row["level"]), []).append(score)
    level = sorted(levels)
    mean = [float(np.mean(levels[x])) for x in level]
    axes.loglog(level, mean, **style.points(), label=label)
    decades(axes.xaxis)
    decades(axes.yaxis)
    least, most = ([end(levels[x]) for x in level] for end in (min, max))
    axes.fill_between(level, least, most, color=style.color, alpha=0.2, linewidth=0)


def _note(job: Job) -> str:
    """One line an observer: the settings behind its curve."""
    lines = ["Settings (the paper names only K₁ = I; units: N m, s, rad):"]
    symbols = {
        "K1": "K₁",
        "K2": "K₂",
        "damping": "Λ",
        "update_interval": "τ",
        "integral_gain": "Γ",
        "proportional_gain": "Kₚ",
    }
    for observer in job.observers.values():
        values = ", ".join(
            f"{symbol} = {_short(getattr(observer, key))}"
            for key, symbol in symbols.items()
            if hasattr(observer, key)
        )
        lines.append(f"{observer.label}: {values}")
    return "\n".join(lines)


def _short(value: Any) -> str:
    return f"{value:g}" if isinstance(value, int | float) else "matrix, see the ledger"
