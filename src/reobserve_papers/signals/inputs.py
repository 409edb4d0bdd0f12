"""Inputs and faults stated as data: constants, sines, ramps, pulses, sweeps, samples, and sums.

A signal is a list of terms. Each term acts on one axis (counted from 1) from ``from`` [s]
on and, where ``until`` is given, up to that time:

    {kind: constant, axis: 1, from: 5, size: 0.5}
    {kind: sine, axis: 1, from: 2.5, amplitude: 1, frequency: 10, phase: 0}
    {kind: growing_sine, axis: 1, from: 4, until: 10, growth: 0.01, frequency: 1.57}
    {kind: ramp, axis: 2, from: 1, until: 4, slope: 0.1}
    {kind: square, axis: 1, from: 1, until: 60, high: 1, low: 0, period: 4, width: 2}
    {kind: prbs, axis: 1, until: 30, amplitude: 0.1, clock: 100, order: 7}
    {kind: sweep, axis: 1, amplitude: 0.1, start: 1, end: 50, duration: 20}
    {kind: samples, axis: 1, file: torque.csv, column: torque, interpolation: linear}

A constant that starts at its onset is a step. A sine is ``amplitude * sin(frequency * t +
phase)`` with the frequency in rad/s and t the time of the run, not the time since the onset; a
growing sine is ``growth * t * sin(frequency * t + phase)``, and a ramp ``slope * (t - from)``.
Samples come from a CSV or Parquet file with a column ``time`` [s]; the last one holds until the
term ends.

A square is ``high`` for the first ``width`` [s] of each ``period`` [s] since its onset and ``low``
for the rest; ``width`` is half the period and ``low`` is 0 if not given. A prbs is a pseudo-random
binary sequence: +-``amplitude`` by a shift register of ``order`` bits, 2 to 16, a bit each
1/``clock`` (``clock`` in Hz), over again after 2^order - 1 bits. Its power spectrum is flat within
3 dB from clock / (2^order - 1) to 0.443 clock: 0.8 to 44 Hz for the one above. Both need
``until``, since they would jump without end.

A sweep is a sine in phase 0 at its onset. Its frequency goes from ``start`` to ``end`` [rad/s] in
a straight line over ``duration`` [s] and then stays, without a jump of phase.

``from`` is 0 if it is not given, and may be negative: what a delayed input was before the run is
the part of its terms before t = 0. Where no term acts, a signal is zero.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from reobserve.core.arguments import MOST_STATES, as_kind, as_whole
from reobserve.core.errors import InputError, located, shown
from reobserve.core.matrices import as_floats, as_positive, as_scalar
from reobserve_papers.signals.signal_shapes import (
    SAME_INSTANT,
    Array,
    Constant,
    GrowingSine,
    Ramp,
    Shape,
    Sine,
    Sweep,
)

__all__ = ["SAME_INSTANT", "Array", "Signal", "Term", "sample_files"]

# The keys of each kind beside axis, from and until, and whether a term must have them.
_KEYS = {
    "constant": {"size": True},
    "sine": {"amplitude": True, "frequency": True, "phase": False},
    "growing_sine": {"growth": True, "frequency": True, "phase": False},
    "ramp": {"slope": True},
    "square": {"high": True, "low": False, "period": True, "width": False},
    "prbs": {"amplitude": True, "clock": True, "order": True},
    "sweep": {"amplitude": True, "start": True, "end": True, "duration": True},
    "samples": {"file": True, "column": True, "interpolation": False},
}


@dataclass(frozen=True)
class Term:
    """One summand: ``shape(t)`` on ``axis`` (from 0) while ``onset <= t < end`` [s].

    ``jumps`` are the times [s] inside that span at which the shape itself or a derivative of it
    is discontinuous.
    """

    axis: int
    onset: float
    end: float
    shape: Shape
    jumps: tuple[float, ...] = ()


@dataclass(frozen=True)
class Signal:
    """A vector signal in closed form: call it with times to get shape (times, axes)."""

    axes: int
    terms: tuple[Term, ...]

    @classmethod
    def parse(cls, name: str, terms: Sequence[Mapping[str, Any]], axes: int) -> Signal:
        """The signal that a config entry states. ``name`` is used in errors.

        Raises
        ------
        InputError
            If a term has an unknown kind or key, a value of the wrong type, or samples that
            cannot be used.
        """
        name, axes = as_kind("name", name, str), as_whole("axes", axes, 1, MOST_STATES)
        if not isinstance(terms, list | tuple):
            raise InputError(name, f"{shown(terms)} must be a list of terms")
        return cls(axes, tuple(_parse(f"{name}[{i}]", t, axes) for i, t in enumerate(terms)))

    def __call__(self, time: Array, *, before: bool = False) -> Array:
        """Values at increasing times ``time`` [s], shape (len(time), axes).

        At a jump the limit from the right is meant, or with ``before`` that from the left.

        Raises
        ------
        InputError
            If the times decrease somewhere, or a value is beyond floating-point numbers.
        """
        time = as_floats("time", time)
        if time.ndim != 1 or np.any(np.diff(time) < 0):
            raise InputError("time", "must be a list of numbers that do not decrease")
        values = np.zeros((len(time), self.axes))
        edge = SAME_INSTANT if before else -SAME_INSTANT
        for term in self.terms:
            first, last = np.searchsorted(time, (term.onset + edge, term.end + edge))
            with np.errstate(over="ignore", invalid="ignore"):  # reported below
                values[first:last, term.axis] += term.shape(time[first:last], before)
        if not np.isfinite(values).all():
            place = int(np.argmin(np.isfinite(values).all(axis=1)))
            raise InputError("signal", f"is not finite at t = {time[place]:g} s")
        return values

    def derivative(self, name: str) -> Signal:
        """The signal of exact time derivatives between the jumps. ``name`` is used in errors.

        Raises
        ------
        InputError
            If a term consists of samples.
        """
        terms = []
        for i, term in enumerate(self.terms):
            shape = term.shape.derivative()
            if shape is None:
                raise InputError(
                    f"{name}[{i}]",
                    "has no derivative in closed form; state it by constants, sines and ramps",
                )
            if shape != Constant(0.0):
                terms.append(Term(term.axis, term.onset, term.end, shape, term.jumps))
        return Signal(self.axes, tuple(terms))

    @property
    def onsets(self) -> tuple[float, ...]:
        """The distinct times [s], in order, at which a term starts after t = 0."""
        return tuple(sorted({term.onset for term in self.terms if term.onset > 0}))

    @property
    def breaks(self) -> tuple[float, ...]:
        """The distinct times [s] at which the signal or a derivative may be discontinuous.

        The kinks of samples with straight lines in between are not among them.
        """
        times = {
            instant
            for term in self.terms
            for instant in (term.onset, term.end, *term.jumps)
            if instant < np.inf
        }
        return tuple(sorted(times))

    @property
    def jumps(self) -> tuple[float, ...]:
        """The instants of ``breaks`` that come after t = 0."""
        return tuple(instant for instant in self.breaks if instant > 0)

    def check_grid(self, name: str, step: float, horizon: float) -> None:
        """Refuse a term that starts after ``horizon`` or jumps between multiples of ``step``."""
        horizon = as_scalar("horizon", horizon)
        for onset in self.onsets:
            if onset > horizon - SAME_INSTANT:
                raise InputError(
                    name, f"starts at {onset:g} s, must start before the end at {horizon:g} s"
                )
        self.check_jumps(name, step, horizon)

    def check_jumps(self, name: str, step: float, horizon: float) -> None:
        """Refuse a term that jumps between multiples of ``step`` before ``horizon``."""
        step, horizon = as_positive("step", step), as_scalar("horizon", horizon)
        for jump in self.jumps:
            lower = np.floor(jump / step + 1e-6) * step
            if jump < horizon and abs(jump - round(jump / step) * step) > SAME_INSTANT:
                raise InputError(
                    name,
                    f"jumps at {jump:.9g} s, must jump at a multiple of {step:g} s "
                    f"(the nearest are {lower:.9g} and {lower + step:.9g} s)",
                )


def sample_files(terms: Any) -> list[str]:
    """The files that a stated signal reads, for those who track inputs."""
    if not isinstance(terms, list | tuple):
        return []
    return [str(term["file"]) for term in terms if isinstance(term, Mapping) and "file" in term]


def _parse(name: str, term: Mapping[str, Any], axes: int) -> Term:
    kind = term.get("kind") if isinstance(term, Mapping) else None
    if not isinstance(kind, str) or kind not in _KEYS:
        raise InputError(f"{name}.kind", f"{shown(kind)} must be one of {', '.join(_KEYS)}")
    allowed = {"kind", "axis", "from", "until", *_KEYS[kind]}
    for key in term:
        if key not in allowed:
            raise InputError(
                f"{name}.{key}", f"unknown key; a {kind} term takes {', '.join(sorted(allowed))}"
            )
    for key, needed in _KEYS[kind].items():
        if needed and key not in term:
            raise InputError(f"{name}.{key}", f"is missing; a {kind} term needs it")
    axis = term.get("axis")
    if not isinstance(axis, int) or isinstance(axis, bool) or not 1 <= axis <= axes:
        raise InputError(f"{name}.axis", f"{shown(axis)} must be a whole number from 1 to {axes}")
    onset = as_scalar(f"{name}.from", term.get("from", 0.0))
    end = as_scalar(f"{name}.until", term["until"]) if "until" in term else np.inf
    if end <= onset:
        raise InputError(f"{name}.from", f"{onset:g} s must be before {end:g} s, its end")
    if kind == "samples":
        return _samples(name, term, axis - 1, onset, end)
    if kind in ("square", "prbs") and "until" not in term:
        raise InputError(
            f"{name}.until", f"is missing; a {kind} term needs it, or it would jump without end"
        )
    numbers = {key: as_scalar(f"{name}.{key}", term[key]) for key in _KEYS[kind] if key in term}
    with located(name):
        shape, jumps = _shape(kind, onset, end, numbers)
    inside = tuple(jump for jump in jumps if jump < end - SAME_INSTANT)
    return Term(axis - 1, onset, end, shape, inside)


def _shape(
    kind: str, onset: float, end: float, numbers: Mapping[str, float]
) -> tuple[Shape, tuple[float, ...]]:
    """A shape in closed form, and where it or a derivative of it jumps."""
    if kind == "constant":
        return Constant(**numbers), ()
    if kind in ("sine", "growing_sine"):
        as_positive("frequency", numbers["frequency"])
        return (Sine(**numbers) if kind == "sine" else GrowingSine.sine(**numbers)), ()
    if kind == "ramp":
        return Ramp(onset=onset, **numbers), ()
    if kind == "sweep":
        sweep = Sweep.sine(onset, **numbers)
        return sweep, (onset + sweep.duration,)
    from reobserve_papers.signals.piecewise_constant import PiecewiseConstant

    build = PiecewiseConstant.square if kind == "square" else PiecewiseConstant.prbs
    levels = build(onset, end, **numbers)
    return levels, tuple(levels.instants[1:].tolist())


def _samples(name: str, term: Mapping[str, Any], axis: int, onset: float, end: float) -> Term:
    from reobserve_papers.signals.samples import Held, Linear, read_samples

    interpolation = term.get("interpolation", "linear")
    if interpolation not in ("linear", "hold"):
        raise InputError(f"{name}.interpolation", f"{shown(interpolation)} must be linear or hold")
    instants, values = read_samples(Path(str(term["file"])), str(term["column"]))
    onset = max(onset, float(instants[0]))
    if end <= onset:
        raise InputError(f"{name}.until", f"{end:g} s, but the samples start at {onset:g} s")
    shape = (Held if interpolation == "hold" else Linear)(instants, values)
    # A kink of the linear interpolant lies where the user sampled, not where the grid is:
    # it costs accuracy of that record only, while a jump off the grid would be misplaced.
    inside = instants[(instants > onset) & (instants < end)]
    jumps = tuple(inside.tolist()) if interpolation == "hold" else ()
    return Term(axis, onset, end, shape, jumps)
