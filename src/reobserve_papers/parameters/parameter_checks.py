"""A parameter file checked whole, before anything runs: its types, and what takes building to see.

What a paper's parameter file states is built once, section by section, by what the paper declares
in ``CHECKS`` of its module ``checks``.
"""

from __future__ import annotations

import importlib
import re
import warnings
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from typing import Any

from reobserve.core.arguments import as_word
from reobserve.core.errors import InputError, ReobserveError, located
from reobserve_papers.parameters.job import AnyJob, StudyFigure, named, read_parameters
from reobserve_papers.parameters.names import paper_part
from reobserve_papers.parameters.parameters import Parameters
from reobserve_papers.parameters.step_kinds import SECTIONS
from reobserve_papers.parameters.units import check_units

Observers = Mapping[str, Any]  # forms that observers must have, by name


@dataclass(frozen=True)
class Checks:
    """Checks of a paper's parameter file that need the plant and observers to be built.

    Attributes
    ----------
    build
        By what a `Job` calls a branch: what builds it, and raises the `InputError` that a stage
        would raise. It gets the job, and the design that the branch names, as it was built.
    about
        By the type of a study, of a figure or of the theory: the observers that it is about.
    """

    build: Mapping[str, Callable[..., object]] = field(default_factory=dict)
    about: Mapping[type, Observers] = field(default_factory=dict)

    def made(self, one: str, *arguments: Any) -> object:
        """The objects that a branch builds to, or nothing if the paper has no need to see."""
        return self.build[one](*arguments) if one in self.build else None


def check_parameters(parameters: Parameters) -> None:
    """Read the parameter file as what its paper declares, build what it states, and run nothing."""
    stated = read_parameters(parameters)
    check_units(parameters, stated)
    module = importlib.import_module(paper_part(parameters.package, "checks"))
    with building(parameters.paper):
        check_stated(stated, getattr(module, "CHECKS", Checks()))
        if hasattr(module, "LAYOUTS"):  # a paper in one module has its drawings at hand
            for name, figure in stated.figures.items():
                as_word(f"figures.{name}.layout", figure.layout, tuple(module.LAYOUTS))


def check_stated(stated: Any, checks: Checks) -> None:
    """Build what a paper's typed parameters state (raises as `check_parameters`)."""
    parts = ("plant", "observers", "designs", "metrics", "theory")
    whole = AnyJob(**{part: getattr(stated, part) for part in parts if hasattr(stated, part)})
    built: dict[str, object] = {}  # the designs
    checks.made("plant", whole)
    for one, section in SECTIONS.items():
        for name, branch in getattr(stated, section, {}).items():
            job = _job(stated, whole, one, branch)
            with _place(one, f"{section}.{name}"):
                if isinstance(branch, StudyFigure):
                    _check_method(job.study, branch)
                _check_observers(checks, job.observers, branch)
                design = getattr(branch, "design", "")
                found = checks.made(one, job, *([built[design]] if design else []))
            if one == "design":
                built[name] = found
    checks.made("metrics", whole)
    with building("theory"):
        _check_observers(checks, whole.observers, whole.theory)
        checks.made("theory", whole, built)


def _job(stated: Any, whole: AnyJob, one: str, branch: Any) -> AnyJob:
    """The arguments of a job of the branch."""
    seen = {one: branch}
    if hasattr(branch, "scenario"):
        seen["scenario"] = stated.scenarios[branch.scenario]
        seen["observers"] = {name: stated.observers[name] for name in branch.observers}
    if hasattr(branch, "study"):
        seen["study"] = stated.studies[branch.study]
    return replace(whole, **seen)


def _check_method(study: Any, figure: StudyFigure) -> None:
    """A figure of a study samples one of the method that its layout samples."""
    method = getattr(study, "method", figure.layout)
    if method != figure.layout:
        problem = f"{figure.study!r} has the method {method}, must have {figure.layout}"
        raise InputError("study", problem)


def _check_observers(checks: Checks, observers: Observers, branch: Any) -> None:
    for name, kind in checks.about.get(type(branch), {}).items():
        named(observers, name, kind)


@contextmanager
def _place(one: str, place: str) -> Iterator[None]:
    """Place errors in `building`, those of a plant at the scenario that states it."""
    if one != "scenario":
        with building(place):
            yield
        return
    try:
        with computable(place):
            yield
    except InputError as error:
        key = re.sub(r"^scenario\b", place, error.parameter)
        raise InputError(key, error.problem) from None


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
