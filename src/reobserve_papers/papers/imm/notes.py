"""Notes with the settings under a figure over time, and the style of each bank."""

from __future__ import annotations

from typing import Any

from reobserve_papers.papers.imm import keys
from reobserve_papers.plotting.figures import STYLES, Style

KALMAN, SVSF, THIN, UNMIXED = STYLES[:4]
INPUT, VELOCITY = Style("0.8", "-", 0.6), Style("0.35", "-", 1.0)

_REALISATIONS = {
    "velocity": "the velocity as output",
    "derivatives": "velocity, acceleration and jerk as outputs",
    "motion": "position, velocity and acceleration as outputs",
    "observer_canonical": "the velocity as output, observer-canonical form",
}
_SWITCHING_CONDITIONS = {
    "motion": "the motion goes on through the leak",
    "states": "the models' states go on through the leak",
    "outputs": "outputs switched at the leak",
}


def note(job: keys.Job) -> str:
    """Notes on a search for the setting, how curves are drawn, the input, noise and the banks."""
    scenario, first = job.scenario, next(iter(job.observers.values()))
    noise = "with noise" if any(scenario.noise) else "no noise"
    how = "from the least to the greatest value, if these differ"
    plain = job.figure.plain if isinstance(job.figure, keys.OverTime) else ""
    searched = f"Setting searched for so that the quoted values are met; the plain one: {plain}."
    sentences = (
        searched if plain else "",
        f"Vertical line: the leak begins. Curves: means over 30 ms; bands: {how}.",
        "◂ and pale bars: quoted by the paper; the bars' thickness means nothing.",
        f"{stimulus(scenario.input, scenario.input_unit)}, samples every "
        f"{1000 * scenario.period:g} ms, {noise}; "
        f"{_SWITCHING_CONDITIONS[scenario.switching_condition]}.",
        f"{_REALISATIONS[first.realisation].capitalize()}; modes that stay with a probability of "
        f"{first.self_transition:g} a sample.",
        layers(job),
        "y: the unit of the models' output, which the paper does not give.",
    )
    return "\n".join(filter(None, sentences))


def stimulus(terms: list[dict[str, Any]], unit: str) -> str:
    """The first term of an input, in words."""
    term = terms[0]
    begun = f"from {term['from']:g} s on"
    match term["kind"]:
        case "constant":
            return f"A step of {term['size']:g} {unit} {begun}"
        case "prbs":
            return f"A pseudo-random binary sequence of ±{term['amplitude']:g} {unit} {begun}"
        case "square":
            return f"A square wave of {term['low']:g} and {term['high']:g} {unit} {begun}"
    return f"An input of the kind {term['kind']} {begun}"


def layers(job: keys.Job) -> str:
    """The widths of the boundary layers, of the first SVSF that has the paper's."""
    for body in job.observers.values():
        if isinstance(body, keys.SmoothVariableStructure):
            widths = ", ".join(
                f"{float(f'{body.layer_scale * width:.3g}'):g}" for width in body.boundary_layer
            )
            thinner = f" × {body.layer_factor:g}" if body.layer_factor != 1 else ""
            return f"Boundary layers of [{widths}]{thinner} y s, y and y/s."
    return ""


def style_of(observer: keys.Observer) -> Style:
    """The style of a bank: Kalman filters, SVSFs, or SVSFs with thinner layers."""
    if isinstance(observer, keys.Kalman):
        return KALMAN if observer.mixing else UNMIXED
    return THIN if observer.layer_factor < 1 else SVSF
