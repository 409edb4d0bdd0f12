"""A ledger checked whole, before anything runs: its types, and what takes building to see."""

from __future__ import annotations

import importlib
import re
import warnings
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from typing import Any

from reobserve.errors import InputError, ReobserveError, located
from reobserve.ledger.ledger import Ledger
from reobserve.ledger.types import Job, named, read_ledger


def check_ledger(ledger: Ledger) -> None:
    """Read the ledger as what its paper declares, build what it states, and run nothing.

    Raises
    ------
    InputError
        With the dotted key of what no stage could use.
    """
    stated = read_ledger(ledger)
    module = importlib.import_module(f"reobserve.papers.{ledger.paper}.ledger")
    with building(ledger.paper):
        module.check(stated)


@contextmanager
def building(place: str) -> Iterator[None]:
    """`located`, and `computable`, for what is built to see whether it can be."""
    with computable(place), located(place):
        yield


@contextmanager
def computable(place: str) -> Iterator[None]:
    """Refuse at ``place`` what numpy cannot compute with, whatever it makes of it."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        try:
            yield
        except ReobserveError:
            raise
        except (ArithmeticError, ValueError, MemoryError) as error:  # LinAlgError is the second
            problem = f"its numbers are too large or too small to compute with ({error})"
            raise InputError(place, problem) from None


def check_scenarios(ledger: Any, build: Callable[[Job], object]) -> None:
    """Build the plant of every scenario of a paper's typed ledger, and run none.

    Raises
    ------
    InputError
        With the config key: what a plant calls ``scenario`` stands there under its own name.
    """
    for name, scenario in ledger.scenarios.items():
        try:
            with computable(f"scenarios.{name}"):
                build(Job(ledger.plant, scenario=scenario))
        except InputError as error:
            key = re.sub(r"^scenario\b", f"scenarios.{name}", error.parameter)
            raise InputError(key, error.problem) from None


def check_studies(ledger: Any, wanted: Mapping[type, Mapping[str, Any]]) -> None:
    """Studies have the observers that their method is about, by name and form.

    ``wanted`` holds them by the type of the study.
    """
    for name, study in ledger.studies.items():
        stated = {key: ledger.observers[key] for key in study.observers}
        with located(f"studies.{name}"):
            for observer, kind in wanted.get(type(study), {}).items():
                named(stated, observer, kind)


def check_figures(ledger: Any, of_studies: Any, wanted: Mapping[str, Mapping[str, Any]]) -> None:
    """Figures of studies draw one of the method that their layout draws, and know its observers.

    ``wanted`` holds the observers, by name and form, that a layout is about.
    """
    for name, figure in ledger.figures.items():
        if not isinstance(figure, of_studies):
            continue
        stated = {key: ledger.observers[key] for key in figure.observers}
        with located(f"figures.{name}"):
            method = getattr(ledger.studies[figure.study], "method", figure.layout)
            if method != figure.layout:
                problem = f"{figure.study!r} has the method {method}, must have {figure.layout}"
                raise InputError("study", problem)
            for observer, kind in wanted.get(figure.layout, {}).items():
                named(stated, observer, kind)
