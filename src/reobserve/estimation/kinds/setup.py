"""An observer made ready for a record: how it starts, and what its numbers are."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any, Protocol

from reobserve.core.matrices import FloatArray
from reobserve.observers import contract

Array = FloatArray
Estimates = Mapping[str, Array]


@dataclass(frozen=True, eq=False)
class Setup:
    """What estimation needs to know of an observer.

    Parameters
    ----------
    observer
        Any, by its contract.
    start
        The state before the first row of a record, from that row of y.
    residual
        What of y, shape (k, p), was not foretold, from y and the estimates; None if the observer
        foretells no measurement.
    measured, known
        The units that it reads, where its model fixes them; empty where they are the user's.
    units, names
        Of the components of estimates, by the estimate, where they are known beforehand.
    sigmas
        For an estimate, the one that holds its variances or its covariance.
    left_out
        Estimates that are not written.
    widths
        How many columns y and u may have.
    holds_inputs
        Whether inputs keep their value between samples; else they are smooth.
    unseen
        What the observer cannot tell, as sentences.
    spread
        The standard deviations that the observer foretells for the next residual, shape (p,), from
        the state after a run; None if it foretells none.
    """

    observer: contract.Observer[Any]
    start: Callable[[Array], Any]
    residual: Callable[[Array, Estimates], Array] | None = None
    measured: tuple[str, ...] = ()
    known: tuple[str, ...] = ()
    units: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    names: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    sigmas: Mapping[str, str] = field(default_factory=dict)
    left_out: tuple[str, ...] = ()
    widths: tuple[tuple[int, ...], tuple[int, ...]] | None = None
    holds_inputs: bool = True
    unseen: tuple[str, ...] = ()
    spread: Callable[[Any], Array] | None = None

    @property
    def columns(self) -> tuple[tuple[int, ...], tuple[int, ...]]:
        """How many columns y and u may have."""
        return self.widths or ((self.observer.measurements,), (self.observer.inputs,))


class Kind(Protocol):
    """What every kind offers."""

    def set_up(self, period: float) -> Setup:
        """The observer at a sampling period [s]; `InputError` says what cannot be."""
