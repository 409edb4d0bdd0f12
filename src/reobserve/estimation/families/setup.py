"""An observer with what estimation on a record needs to know of it."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

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
        What of y, shape (k, p), was not predicted, from y and the estimates; None if the observer
        predicts no measurement.
    measured, known
        The units of the columns of y and u; empty where they are not stated.
    units, names
        Of the components of estimates, by the estimate, where they are known beforehand.
    sigmas
        For an estimate, the one that holds its variances or its covariance.
    left_out
        Estimates that are not written.
    widths
        How many columns y and u may have; left out, as many as the observer reads.
    holds_inputs
        Whether inputs keep their value between samples; else they are smooth.
    unseen
        What the observer cannot estimate, as sentences.
    spread
        The standard deviations that the observer predicts for the next residual, shape (p,), from
        the state after a run; None if it predicts none.
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


def first_state_error(y: Array, estimates: Estimates) -> Array:
    """The error of the first state where that is measured."""
    found: Array = y - estimates["state"][:, :1]
    return found
