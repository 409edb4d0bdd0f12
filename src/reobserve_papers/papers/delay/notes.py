"""The note under a figure: its main parameters."""

from __future__ import annotations

from collections.abc import Iterable

from reobserve_papers.papers.delay import keys

_AMPLITUDES = {
    "wrapped": "half a turn for the angle",
    "turns": "the largest angle, with full turns",
}


def note(job: keys.Job) -> str:
    """Gains, noise and steps of the observers of the pendulum."""
    bodies = [body for body in job.observers.values() if isinstance(body, keys.HighGain)]
    steps = _each(f"{1000 * body.sampling_period:g} ms" for body in bodies)
    return (
        f"ρ = {_each(f'{body.rho:g}' for body in bodies)}. {gains(job)}. Runge-Kutta steps of "
        f"{steps}.\n{noise(job)}."
    )


def gains(job: keys.Job) -> str:
    """The initial gain, and the threshold below which it is switched off."""
    bodies = [body for body in job.observers.values() if isinstance(body, keys.Extended)]
    begun = _each(_beginning(body) for body in bodies)
    switched = [body for body in bodies if body.threshold > 0]
    if not switched:
        return begun
    what = _each("gain of the delay" if body.switched == "delay" else "gain" for body in switched)
    bounds = _each(f"{body.threshold:g}" for body in switched)
    return f"{begun}; {what} off where the estimated |ξ| < {bounds}"


def noise(job: keys.Job) -> str:
    """Size and kind of the noise."""
    plant, share = job.plant, job.scenario.noise_share
    if not share:
        return "No noise"
    kind = "standard deviation" if plant.noise_size == "deviation" else "peak"
    angle = _AMPLITUDES.get(plant.noise_amplitude, f"{plant.swing:g} rad for the angle")
    where = "not in the pendulum" if plant.noisy_input == "measured" else "also in the pendulum"
    return (
        f"Noise with a {kind} of {100 * share:g} % of the amplitude ({angle}), held for "
        f"{1000 * plant.noise_period:g} ms; that of the input {where}"
    )


def _beginning(body: keys.Extended) -> str:
    if body.initial_matrix == "algebraic":
        return "S from the algebraic equation"
    begun = body.initial_matrix
    start = f"{begun:g} I" if isinstance(begun, int | float) else "the given matrix"
    return f"S from the dynamic equation, S(0) = {start}"


def _each(said: Iterable[str]) -> str:
    """Distinct texts of all observers."""
    return ", ".join(dict.fromkeys(said))
