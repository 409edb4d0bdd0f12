"""One step of an observer as a program, by the family that it is of."""

from __future__ import annotations

from importlib import import_module
from typing import Any

import numpy as np

from reobserve.codegen.program import Program
from reobserve.core.errors import InputError, shown
from reobserve.estimation.families import FAMILIES, family
from reobserve.estimation.observer_design import Design
from reobserve.observers.contract import Observer


def program_of(
    observer: Observer[Any],
    state: Any = None,
    columns: tuple[int, int] | None = None,
    kind: type[Design] | None = None,
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
    kind
        The family of the observer; left out, all of this package are looked through.
    """
    if not isinstance(observer, Observer):
        raise InputError("observer", f"{shown(observer)} must be an observer")
    kinds = [family(name) for name in FAMILIES] if kind is None else [kind]
    own = next((design for design in kinds if type(observer) in design.programs), None)
    if own is None:
        names = ", ".join(each.__name__ for design in kinds for each in design.programs) or "none"
        name = type(observer).__name__
        raise InputError("observer", f"a {name} cannot be exported; {names} can")
    if state is None:
        observer._start(np.zeros(observer.measurements))  # raises if it must be given
    begun = None if state is None else observer._checked(state)
    all_of_them = (observer.measurements, observer.inputs)
    sizes = all_of_them if columns is None else columns
    for width, most in zip(sizes, all_of_them, strict=True):
        if width != most and not (own.differentiates and width == 1):
            raise InputError("columns", f"{shown(sizes)} must be {all_of_them}, or 1 for signals")
    make: Any = own.programs[type(observer)]
    if isinstance(make, str):
        module, _, function = make.partition(":")
        make = getattr(import_module(f"reobserve.codegen.programs.{module}"), function)
    made: Program = make(observer, begun, sizes) if own.differentiates else make(observer, begun)
    _ = made.code  # raises here what cannot be exported
    return made
