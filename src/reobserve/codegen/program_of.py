"""Which observers can be exported, and the program of one."""

from __future__ import annotations

from importlib import import_module
from typing import Any

import numpy as np

from reobserve.codegen.program import Program
from reobserve.core.errors import InputError, shown
from reobserve.observers.contract import Observer

# The class of an observer, and the module and function that make its program.
_PROGRAMS = {
    "FixedGainObserver": "linear:fixed_gain",
    "KalmanFilter": "linear:kalman",
    "SmoothVariableStructureFilter": "linear:smooth",
    "AugmentedKalmanFilter": "linear:augmented",
    "IMM": "bank:bank",
    "ExtendedStateObserver": "eso:extended_state",
    "SampledILO": "rigid_body:sampled",
    "ILO": "rigid_body:continuous",
    "AdaptiveObserver": "rigid_body:adaptive",
    "LevantDifferentiator": "levant:differentiator",
    "IdentityObserver": "normal_form:identity",
    "TransformedObserver": "normal_form:transformed",
    "HighGainObserver": "high_gain:standard",
    "ExtendedHighGainObserver": "extended_high_gain:extended",
}
# Observers that must be given a state.
_STARTED = (
    "FixedGainObserver", "KalmanFilter", "SmoothVariableStructureFilter", "AugmentedKalmanFilter",
    "IMM", "HighGainObserver", "ExtendedHighGainObserver",
)  # fmt: skip


def program_of(
    observer: Observer[Any], state: Any = None, columns: tuple[int, int] | None = None
) -> Program:
    """One step of an observer as a program.

    Parameters
    ----------
    observer
        The observer.
    state
        What it starts from; without one it starts as `Observer.run` does without one.
    columns
        How many columns y and u have; if left out, signals come with all their derivatives that
        the observer takes. One that finds them by itself takes 1, too.

    Raises
    ------
    InputError
        If it is no observer, its steps are no fixed sequence, which is said, it has to be given
        a state, or it takes no such columns.
    """
    if not isinstance(observer, Observer):
        raise InputError("observer", f"{shown(observer)} must be an observer")
    name = type(observer).__name__
    if name not in _PROGRAMS:
        raise InputError("observer", f"a {name} cannot be exported; {', '.join(_PROGRAMS)} can")
    module, _, function = _PROGRAMS[name].partition(":")
    if state is None and name in _STARTED:
        observer._start(np.zeros(observer.measurements))  # says that it must be given
    begun = None if state is None else observer._checked(state)
    make = getattr(import_module(f"reobserve.codegen.programs.{module}"), function)
    all_of_them = (observer.measurements, observer.inputs)
    given = all_of_them if columns is None else columns
    alone = name == "ExtendedHighGainObserver"  # takes its input without derivatives, too
    for one, most in zip(given, all_of_them, strict=True):
        if one != most and not (alone and one == 1):
            raise InputError("columns", f"{shown(given)} must be {all_of_them}, or 1 for signals")
    found: Program = make(observer, begun, given) if alone else make(observer, begun)
    return found
