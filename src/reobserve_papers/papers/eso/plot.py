"""Stage plot: a fault with its estimates and their errors (Figs 2 to 5), and the designs."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from reobserve_papers.metrics.responses import error_of
from reobserve_papers.papers.eso import keys, plot_designs
from reobserve_papers.papers.eso.plot_designs import style_of
from reobserve_papers.parameters.figure_data import FigureData
from reobserve_papers.plotting.figures import TRUTH, add_note, headroom, new_figure, thin, time_axis
from reobserve_papers.signals.series import Series

Array = NDArray[np.float64]

_LABELS = {"actuator": "actuator fault [V]", "sensor": "sensor fault [rad/s]"}


def draw(data: FigureData[keys.Job]) -> Figure:
    """Plot the fault with its estimates, and their errors."""
    job, plant = data.job, data.plant
    layout = job.figure.layout
    figure, (fault, error) = new_figure((2.8, 2.0))
    channel = f"{layout}_fault"
    fault.plot(*upright(plant, channel), **TRUTH.line(), label=f"{layout} fault")
    for name, estimate in data.estimates.items():
        observer = job.observers[name]
        label, style = observer.label, style_of(job.designs[observer.design])
        line = {**style.line(), "zorder": 2.0 if style.linewidth >= 1.0 else 1.9}
        fault.plot(*thin(estimate.time, estimate[channel]), **line, label=label)
        error.plot(*thin(estimate.time, error_of(plant, estimate, channel)), **line)
    fault.set_ylabel(_LABELS[layout])
    fault.set_title(f"(a) {layout} fault and its estimates")
    fault.legend(loc="upper left")
    headroom(fault, 0.15)
    error.set_ylabel(f"error {_LABELS[layout].rpartition(' ')[2]}")
    error.set_title("(b) estimate minus fault")
    time_axis(error, plant.time)
    add_note(figure, _note(job))
    return figure


def upright(plant: Series, channel: str) -> tuple[Array, Array]:
    """Time and values of a signal, with vertical lines at its jumps."""
    time = np.repeat(plant.time, 2)
    values = np.column_stack([plant[f"{channel}_before"], plant[channel]]).ravel()
    jumps = np.flatnonzero(np.abs(np.diff(values)) > 1e-2)
    keep = np.unique(np.concatenate([np.arange(0, len(time), 40), jumps, jumps + 1]))
    return time[keep], values[keep]


def _note(job: keys.Job) -> str:
    scenario, plant = job.scenario, job.plant
    ranges = " and ".join(
        f"from {low:g} to {high:g} {unit}"
        for (low, high), unit in zip(scenario.disturbance, ("rad/s²", "A/s"), strict=True)
    )
    held = f"held for {plant.hold_period:g} s"
    noise = f"{held}; no noise"
    if scenario.noise_power > 0:
        deviation = plant.noise_deviation(scenario.noise_power)
        noise = f"and noise with a deviation of {deviation:.3g} rad/s, both {held}"
    designs = {body.design: job.designs[body.design] for body in job.observers.values()}
    first, *others = map(gains_of, designs.values())
    gains = ";\n".join([first, "; ".join(others)]) if others else first
    return (
        f"Chosen here: disturbances {ranges} {noise}.\nGains: {gains}.\n"
        "Estimates of the faults do not depend on controller or reference."
    )


def gains_of(design: keys.Design) -> str:
    """A description of how the gains of an observer are designed."""
    if isinstance(design, keys.Feasible):
        kind = f"PI by feasibility, {design.solution.replace('_', ' ')}"
        kind += " with currents in mA" if design.current_unit == "mA" else ""
        return f"{kind}, with decay {design.decay:g}/s and A_z = {design.filter_rate:g}/s"
    name = "PI" if design.kind == "pi_optimised" else "PD/PI"
    if design.criterion == "minimum_gamma":
        return (
            f"{name} of minimum γ with poles within {design.pole_bound:g}/s and matrices within "
            f"{design.radius:g}"
        )
    return f"{name} of minimum norm with γ {100 * (design.factor - 1):.2g} % above its lower bound"


LAYOUTS = {"actuator": draw, "sensor": draw, "designs": plot_designs.draw}
