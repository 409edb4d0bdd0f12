"""What a design is, of whichever kind: an observer with its system, gains and certificate."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass, field, fields, is_dataclass
from typing import Any, ClassVar, Self, get_type_hints

import numpy as np

from reobserve.core.documents import Tree
from reobserve.core.errors import InputError, located
from reobserve.core.matrices import FloatArray
from reobserve.core.validation import parse
from reobserve.estimation.designs.signals import Signal, listed
from reobserve.observers.contract import Observer

Array = FloatArray
Certificate = dict[str, Any]  # of plain values; `poles` are pairs of real and imaginary part

_AGREE = 1e-6  # of a number: what another processor may make of the same gains


@dataclass(frozen=True, eq=False, kw_only=True)
class Design(ABC):
    """A design; what derives from it declares the keys of its file.

    ``system`` is what the observer knows, as the model's file states it; ``gains`` what was found
    or chosen for it; ``certificate`` what was computed of both.
    """

    system: Any
    gains: Any
    certificate: Certificate = field(default_factory=dict)

    example: ClassVar[str]  # the text of a model's file that can be designed as it is

    @classmethod
    def designed(cls, model: Tree) -> Self:
        """The design of a model's file, which states the gains; others find them.

        Raises
        ------
        InputError
            If a key is missing, unknown or wrong.
        """
        hints = get_type_hints(cls)
        if "gains" not in model:
            raise InputError("gains", "are missing; a design of this kind chooses none by itself")
        rest = {name: part for name, part in model.items() if name != "gains"}
        gains = parse(hints["gains"], model["gains"], "gains")
        return cls(system=parse(hints["system"], rest), gains=gains)

    @property
    def states(self) -> tuple[Signal, ...]:
        """The states of the system."""
        return listed(self.system.states)

    @property
    def inputs(self) -> tuple[Signal, ...]:
        """The columns of u."""
        return listed(self.system.inputs)

    @property
    def measurements(self) -> tuple[Signal, ...]:
        """The columns of y."""
        return listed(self.system.measurements)

    @property
    @abstractmethod
    def estimates(self) -> Mapping[str, tuple[Signal, ...]]:
        """The components of each estimate of the observer, row by row if it is a matrix."""

    @property
    @abstractmethod
    def observer(self) -> Observer[Any]:
        """The observer, ready to run."""

    @abstractmethod
    def start(self) -> Any:
        """The state to start from; None if the observer starts from its first measurement."""

    @abstractmethod
    def certify(self) -> Certificate:
        """Compute the certificate of system and gains.

        Raises
        ------
        InputError
            If they are none of a sound observer, with the numbers.
        """

    @abstractmethod
    def summary(self) -> list[str]:
        """A few sentences on what the certificate says."""

    def checked(self) -> Design:
        """The design, if its certificate is the one of its system and gains.

        Raises
        ------
        InputError
            If it is not, with the numbers; or as `certify`.
        """
        with located("gains"):
            found = self.certify()
        _compare("certificate", self.certificate, found)
        return self


def plain(value: Any) -> Any:
    """A dataclass with its arrays as what JSON can hold; what is None is left out."""
    if is_dataclass(value) and not isinstance(value, type):
        parts = {each.name: getattr(value, each.name) for each in fields(value)}
        return {name: plain(part) for name, part in parts.items() if part is not None}
    if isinstance(value, np.ndarray):
        return value.tolist()
    if isinstance(value, Mapping):
        return {str(name): plain(part) for name, part in value.items()}
    if isinstance(value, list | tuple):
        return [plain(part) for part in value]
    return value.item() if isinstance(value, np.generic) else value


def pairs(poles: Any) -> list[list[float]]:
    """Poles as a certificate has them, in the order given."""
    return [[float(pole.real), float(pole.imag)] for pole in poles]


def told(poles: list[list[float]]) -> str:
    """Poles as a sentence lists them."""
    return ", ".join(
        f"{real:.6g}" if imag == 0 else f"{real:.6g}{imag:+.6g}j" for real, imag in poles
    )


def _compare(place: str, stated: Mapping[str, Any], found: Mapping[str, Any]) -> None:
    """Refuse a certificate that says other than what was found."""
    for name in (*found, *(name for name in stated if name not in found)):
        if name not in stated:
            raise InputError(f"{place}.{name}", "is missing")
        if name not in found:
            raise InputError(f"{place}.{name}", "is nothing that this kind of design certifies")
        if name == "poles":
            _compare_poles(f"{place}.{name}", stated[name], found[name])
            continue
        said, computed = stated[name], found[name]
        if isinstance(computed, float) and _is_number(said):
            same = abs(said - computed) <= _AGREE * max(abs(computed), abs(said))
        else:
            same = said == computed
        if not same:
            raise InputError(f"{place}.{name}", f"says {said}, but the gains give {computed}")


def _compare_poles(place: str, stated: Any, found: list[list[float]]) -> None:
    """Poles that are near each other are badly determined, their polynomial is not."""
    good = isinstance(stated, list) and len(stated) == len(found)
    good = good and all(
        isinstance(p, list) and len(p) == 2 and all(map(_is_number, p)) for p in stated
    )
    if not good:
        raise InputError(place, f"must be {len(found)} pairs of real and imaginary part")
    said, computed = (np.array([complex(*pole) for pole in poles]) for poles in (stated, found))
    with np.errstate(all="ignore"):
        scale = np.abs(np.poly(-np.maximum(np.abs(computed), np.finfo(float).tiny)))
        off = np.abs(np.poly(said) - np.poly(computed))
        same = bool(np.all(off <= _AGREE * scale))
    if not same:
        raise InputError(place, f"says {told(stated)}, but the gains give {told(found)}")


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)
