"""The base class of families: an observer with its system, its gains and a certificate."""

from __future__ import annotations

import re
import warnings
from abc import ABC, abstractmethod
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field, fields, is_dataclass, replace
from types import NoneType
from typing import Annotated, Any, ClassVar, NamedTuple, Self, get_args, get_type_hints

import numpy as np

from reobserve.codegen.record import test_run
from reobserve.core.documents import Tree
from reobserve.core.errors import DivergenceError, InputError, ReobserveError
from reobserve.core.matrices import FloatArray, as_positive
from reobserve.core.validation import checked, parse
from reobserve.estimation.families.signals import NamedSignal, Signals, listed, numbered
from reobserve.observers.contract import Observer

Array = FloatArray
Estimates = Mapping[str, Array]
Certificate = dict[str, Any]  # of plain values; `poles` are pairs of real and imaginary part

Period = Annotated[float, checked(as_positive)]

_AGREE = 1e-6  # of a number: what another processor may make of the same gains


# Parameters of observers, and the keys that state them.
_KEYS = {
    "mean": "initial_state", "state": "initial_state", "covariance": "initial_covariance",
    "delay": "initial_delay", "period": "sampling_period",
}  # fmt: skip


@dataclass(frozen=True, eq=False, kw_only=True)
class System:
    """Keys of all systems: the period [s], signals by name and unit, and the state at the start.

    Signals that are left out are numbered, and have no units.
    """

    sampling_period: Period
    states: Signals = field(default_factory=dict)
    inputs: Signals = field(default_factory=dict)
    measurements: Signals = field(default_factory=dict)
    initial_state: list[float] | None = None


class Example(NamedTuple):
    """An observer in a specification, and the simulated plant whose record it reads."""

    plant: str  # of `reobserve.estimation.families.examples`
    observer: str  # YAML
    alarms: str = ""  # YAML
    gains: str = ""  # YAML: those of the observer, where they can be computed, too


@dataclass(frozen=True, eq=False, kw_only=True)
class Design(ABC):
    """An observer of a family, of which a subclass declares the keys of its files.

    ``system`` is what a model's file or a specification states; ``gains`` what was found or chosen
    for it, None if there is nothing to choose; ``certificate`` what was computed of both.
    """

    system: Any
    gains: Any = None
    certificate: Certificate = field(default_factory=dict)

    records: ClassVar[Mapping[str, Example]] = {}  # by name: NAME or NAME-VARIANT
    programs: ClassVar[Mapping[type, Any]] = {}  # of observers: functions, or "module:function"
    differentiates: ClassVar[bool] = False  # whether it finds derivatives of its signals itself
    keys: ClassVar[Mapping[str, str]] = {}  # of parameters of the observer under other names
    predicts: ClassVar[str] = ""  # the estimate that begins with what is measured
    left_out: ClassVar[tuple[str, ...]] = ()  # estimates that no record's results contain
    holds_inputs: ClassVar[bool] = True  # between samples; else they are smooth

    @classmethod
    @contextmanager
    def keyed(cls) -> Iterator[None]:
        """Let an `InputError` of an observer's parameter name the key that states it."""
        try:
            with np.errstate(all="ignore"):  # of what is refused, or found not to be finite
                yield
        except InputError as error:
            name = re.match(r"\w*", error.parameter)[0]  # type: ignore[index]
            rest = error.parameter[len(name) :]
            if name in _names(get_type_hints(cls)["gains"]):
                raise error.renamed(f"gains.{name}{rest}") from None
            key = {**_KEYS, **cls.keys}.get(name, name)
            raise error.renamed(f"{key}{rest}") from None

    @classmethod
    def read(cls, tree: Tree) -> tuple[Any, Any]:
        """The system of a model's file or a specification, and its gains, None if left out.

        Raises
        ------
        InputError
            If a key is missing, unknown or wrong.
        """
        hints = get_type_hints(cls)
        for name in _names(hints["gains"]) - _names(hints["system"]):
            if name in tree:
                raise InputError(name, "must stand under gains")
        rest = {name: part for name, part in tree.items() if name != "gains"}
        gains = tree.get("gains")
        if gains is not None and hints["gains"] is NoneType:
            raise InputError("gains", "must be left out; nothing is chosen in this family")
        if gains is not None:
            gains = parse(hints["gains"], gains, "gains")
        return parse(hints["system"], rest), gains

    @classmethod
    def needs_gains(cls) -> bool:
        """True if there is no design of this family without gains."""
        hint = get_type_hints(cls)["gains"]
        return hint not in (NoneType, Any) and NoneType not in get_args(hint)

    @classmethod
    def designed(cls, tree: Tree) -> Self:
        """The design of a model's file, with gains found where it leaves them out."""
        parts = cls.read(tree)
        with cls.keyed():
            return cls.of(*parts)

    @classmethod
    def of(cls, system: Any, gains: Any = None) -> Self:
        """The design of a system (raises as `find_gains` if no gains are given)."""
        return cls(system=system, gains=cls.find_gains(system) if gains is None else gains)

    @classmethod
    def find_gains(cls, system: Any) -> Any:
        """Gains for a system, None in a family without gains.

        Raises
        ------
        InputError
            If there are none, or the family chooses none by itself.
        """
        if cls.needs_gains():
            raise InputError("gains", "are missing; a design of this kind chooses none by itself")

    @property
    def states(self) -> tuple[NamedSignal, ...]:
        """The states of the system."""
        count = len(getattr(self.system, "A", ()))
        return listed(self.system.states) or numbered("state", count)

    @property
    def inputs(self) -> tuple[NamedSignal, ...]:
        """The columns of u."""
        return listed(self.system.inputs) or numbered("input", self.observer.inputs)

    @property
    def measurements(self) -> tuple[NamedSignal, ...]:
        """The columns of y."""
        signals = listed(self.system.measurements)
        return signals or numbered("measurement", self.observer.measurements)

    @property
    def widths(self) -> tuple[tuple[int, ...], tuple[int, ...]]:
        """The numbers of columns that y and u of a record may have."""
        return (len(self.measurements),), (len(self.inputs),)

    @property
    def estimates(self) -> Mapping[str, tuple[NamedSignal, ...]]:
        """The components of each estimate of the observer, row by row if it is a matrix."""
        return {"state": self.states}

    @property
    def measured(self) -> Mapping[tuple[str, int], int]:
        """The measurement of each component of an estimate that is measured itself.

        A row of C that is one of the identity says so, or else the same name and unit.
        """
        C, D = getattr(self.system, "C", None), getattr(self.system, "D", None)
        if C is not None:
            direct = np.eye(len(C[0])).tolist()
            return {
                ("state", direct.index(row)): k for k, row in enumerate(np.asarray(C).tolist())
                if row in direct and (D is None or not np.any(D[k]))
            }  # fmt: skip
        if self.predicts:
            return {(self.predicts, k): k for k in range(len(self.measurements))}
        names = {signal: k for k, signal in enumerate(self.measurements)}
        return {
            (name, place): names[signal] for name, signals in self.estimates.items()
            for place, signal in enumerate(signals) if signal in names
        }  # fmt: skip

    @property
    def sigmas(self) -> Mapping[str, str]:
        """The estimate with the variances of another one, by the name of that."""
        return {}

    @property
    def unseen(self) -> tuple[str, ...]:
        """Sentences on what the observer cannot estimate."""
        return ()

    @property
    @abstractmethod
    def observer(self) -> Observer[Any]:
        """The observer, ready to run."""

    def start(self) -> Any:
        """The state to start from, or None if the observer starts from its first measurement."""
        initial = getattr(self.system, "initial_state", None)
        observer: Any = self.observer
        return None if initial is None else observer.init(initial)

    def begin(self, y: Array) -> Any:
        """The state before the first row of a record, from that row of y, shape (p,)."""
        state = self.start()
        return self.observer._start(y) if state is None else state

    def residual(self, y: Array, estimates: Estimates) -> Array:
        """The part of y, shape (k, p), that was not predicted, without columns if all was."""
        if not self.predicts:
            return y[:, :0]
        residual: Array = y - estimates[self.predicts][:, : y.shape[1]]
        return residual

    def residual_variance(self, estimates: Estimates) -> Array | None:
        """The variances, shape (k, p), that were predicted for the residual, None if none were."""
        return None

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

    def try_out(self) -> None:
        """Start the observer and run it over the rows on which exported code is tested.

        Raises
        ------
        InputError
            If it refuses the initial state or what it reads, or diverges; it names the key.
        """
        with self.keyed(), warnings.catch_warnings():
            warnings.simplefilter("ignore")
            try:
                self._run()
            except DivergenceError as error:
                raise InputError(self._why(), f"cannot be run: {error}") from None

    def _run(self) -> None:
        test_run(self.observer, self.start(), (self.widths[0][0], self.widths[1][0]))

    def _why(self) -> str:
        """The key with which a design diverges: a start that is not zero, a period that is long."""
        for key, other in (("initial_state", 0), ("initial_covariance", 0), ("sampling_period", 1)):
            given = getattr(self.system, key, None)
            if given is not None:
                trial = 1e-6 * other + 0.0 * np.array(given)
                with suppress(ReobserveError):
                    replace(self, system=replace(self.system, **{key: trial}))._run()
                    return key
        return "model"

    def checked(self) -> Design:
        """The design, if its certificate is the one of its system and gains, and it can start.

        Raises
        ------
        InputError
            If it is not, with the numbers; as `certify`; or if what it is to start from cannot be.
        """
        with self.keyed():
            certificate = self.certify()
            self.start()
        _compare("certificate", self.certificate, certificate)
        return self


def _names(hint: Any) -> set[str]:
    """The keys of a dataclass, or of the one among several types."""
    kinds = [kind for kind in get_args(hint) or [hint] if is_dataclass(kind)]
    return {each.name for kind in kinds for each in fields(kind)}


def plain(value: Any) -> Any:
    """A dataclass with its arrays as what JSON can hold, without what is None."""
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


def pole_text(poles: list[list[float]]) -> str:
    """Poles as a sentence lists them."""
    return ", ".join(
        f"{real:.6g}" if imag == 0 else f"{real:.6g}{imag:+.6g}j" for real, imag in poles
    )


def _compare(place: str, stated: Mapping[str, Any], actual: Mapping[str, Any]) -> None:
    """Refuse a certificate that says other than what was found."""
    for name in (*actual, *(name for name in stated if name not in actual)):
        if name not in stated:
            raise InputError(f"{place}.{name}", "is missing")
        if name not in actual:
            raise InputError(f"{place}.{name}", "is nothing that this kind of design certifies")
        if name == "poles":
            _compare_poles(f"{place}.{name}", stated[name], actual[name])
            continue
        said, computed = stated[name], actual[name]
        if isinstance(computed, float) and _is_number(said):
            same = abs(said - computed) <= _AGREE * max(abs(computed), abs(said))
        else:
            same = said == computed
        if not same:
            raise InputError(f"{place}.{name}", f"says {said}, but the gains give {computed}")


def _compare_poles(place: str, stated: Any, actual: list[list[float]]) -> None:
    """Poles that are near each other are badly determined, their polynomial is not."""
    good = isinstance(stated, list) and len(stated) == len(actual)
    good = good and all(
        isinstance(p, list) and len(p) == 2 and all(map(_is_number, p)) for p in stated
    )
    if not good:
        raise InputError(place, f"must be {len(actual)} pairs of real and imaginary part")
    said, computed = (np.array([complex(*pole) for pole in poles]) for poles in (stated, actual))
    with np.errstate(all="ignore"):
        scale = np.abs(np.poly(-np.maximum(np.abs(computed), np.finfo(float).tiny)))
        off = np.abs(np.poly(said) - np.poly(computed))
        same = bool(np.all(off <= _AGREE * scale))
    if not same:
        raise InputError(place, f"says {pole_text(stated)}, but the gains give {pole_text(actual)}")


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)
