"""Interacting multiple model (Blom & Bar-Shalom 1988; Gadsden et al. 2011, (7)-(10), (19)-(23)).

A bank of filters, one for each mode that the plant may be in, and a Markov chain that says how the
plant moves between them. A step mixes the filters' beliefs (interaction), lets each take the sample
(prediction, correction), weighs the modes by how well each foretold it, and combines the beliefs.

What is mixed are the filters' states as they stand. The filters must therefore mean the same by
their states, or at least nearly so: in other coordinates of each model the same bank gives other
probabilities. Position, velocity and acceleration can be mixed; the states of transfer functions
that were identified one by one have no common meaning but by the realisation that is chosen.
Without mixing the coordinates do not matter to Kalman filters. To the SVSF they do even then, if it
has fewer outputs than states: the pseudo-inverse of H depends on the units of the states.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

from reobserve.errors import DivergenceError, InputError, shown
from reobserve.models.linear import ModelArrays, as_covariance
from reobserve.numerics.arguments import as_flag
from reobserve.numerics.matrices import as_floats, as_numbers, as_row, as_samples, as_vector
from reobserve.observers.contract import OnDivergence, check_state, raises
from reobserve.observers.imm_loop import (
    Bank,
    Beliefs,
    combine,
    interact,
    mixing_probabilities,
    run_bank,
    update_probabilities,
)
from reobserve.observers.linear_filter import (
    Belief,
    LinearFilter,
    ModeFilter,
    as_controls,
    check_belief,
)
from reobserve.observers.linear_filter_loop import new_work

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class State:
    """All the bank remembers: a belief of each filter, and the logarithms of mu, shape (r,)."""

    beliefs: tuple[Belief, ...]
    log_probabilities: Array


@dataclass(frozen=True, eq=False)
class Run:
    """What the bank makes of a record, one row a sample.

    ``estimate``, shape (k, n), and ``covariance``, (k, n, n), are those of (22) and (23),
    ``probability``, (k, r), is mu, and ``innovation``, (k, r, m), what each filter
    did not foretell. ``missing`` counts the samples that were not taken. ``diverged_at`` is None,
    or the first row that is not finite; then k counts the rows before it. ``state`` is the one to
    go on from, or after a divergence the one that the run started from.
    """

    estimate: Array
    covariance: Array
    probability: Array
    innovation: Array
    missing: int
    state: State
    diverged_at: int | None


@dataclass(frozen=True, eq=False)
class InteractingMultipleModel:
    """A bank of filters and a Markov chain of modes.

    Parameters
    ----------
    filters
        One a mode. Kalman filters and SVSFs of one kind run as one compiled loop; other filters,
        of a user's own, need `ModeFilter`'s two methods and are called one by one.
    transition
        p_ij, shape (r, r): the probability that mode i is followed by mode j. Rows sum to one.
    mixing
        Whether beliefs interact, (9) and (10). Without, each filter goes its own way and only the
        probabilities of the modes follow the chain.

    Raises
    ------
    InputError
        If there is no filter, two differ in their numbers of states, inputs or outputs, or the
        transition has a negative entry or a row that does not sum to one.
    """

    filters: Sequence[ModeFilter]
    transition: ArrayLike
    mixing: bool = True

    def __post_init__(self) -> None:
        if not isinstance(self.filters, list | tuple):
            raise InputError("filters", f"{shown(self.filters)} must be a list of filters")
        filters = tuple(self.filters)
        object.__setattr__(self, "mixing", as_flag("mixing", self.mixing))
        for j, one in enumerate(filters):
            wanted = ("predict", "correct", "model")
            if isinstance(one, type) or not all(hasattr(one, part) for part in wanted):
                raise InputError(
                    f"filters[{j}]", f"{shown(one)} must have a model, predict and correct"
                )
        if not filters:
            raise InputError("filters", "are none, must be one or more")
        first = _size(filters[0])
        for j, other in enumerate(filters):
            if _size(other) != first:
                raise InputError(
                    f"filters[{j}]",
                    f"has {_size(other)} states, inputs and outputs, the first filter {first}",
                )
        object.__setattr__(self, "filters", filters)
        object.__setattr__(self, "transition", _as_transition(self.transition, len(filters)))

    def init(
        self,
        means: ArrayLike,
        covariances: ArrayLike,
        probabilities: ArrayLike | None = None,
    ) -> State:
        """The state before the first sample.

        Parameters
        ----------
        means
            Shape (n,) for all filters, or (r, n).
        covariances
            A number, n numbers or (n, n) for all filters, or (r, n, n).
        probabilities
            mu, shape (r,), all the same if left out.

        Raises
        ------
        InputError
            If one of them is not that, or the probabilities do not sum to one.
        """
        r, (n, _, m) = len(self.filters), _size(self.filters[0])
        mean, spread = as_floats("means", means), as_floats("covariances", covariances)
        each = mean if mean.ndim == 2 else np.tile(mean, (r, 1))
        if each.shape != (r, n):
            raise InputError("means", f"has shape {mean.shape}, must be ({n},) or ({r}, {n})")
        wide = spread if spread.ndim == 3 else [spread] * r
        if len(wide) != r:
            raise InputError("covariances", f"are {len(wide)}, must be one, or {r} like filters")
        chosen = np.full(r, 1.0 / r) if probabilities is None else probabilities
        mu = as_vector("probabilities", chosen, r)
        if mu.min() < 0 or abs(mu.sum() - 1) > 1e-9:
            raise InputError(
                "probabilities",
                f"{shown(mu.tolist())} must be 0 or more and sum to 1, not {mu.sum():g}",
            )
        beliefs = tuple(
            Belief(each[j].copy(), as_covariance("covariances", wide[j], n), np.zeros(m))
            for j in range(r)
        )
        with np.errstate(divide="ignore"):
            return State(beliefs, np.log(mu))

    def step(
        self, state: State, measurement: ArrayLike, control: ArrayLike = ()
    ) -> tuple[State, Run]:
        """Take one sample: the next state, and what `run` says of that sample.

        Stepping through a record gives the bits that `run` gives.

        Raises
        ------
        InputError
            If the shapes do not fit.
        DivergenceError
            As `run`; the sample is number 0.
        """
        held = as_floats("control", control).reshape(1, -1)
        run = self.run(as_row("measurements", measurement), state, held)
        return run.state, run

    def run(
        self,
        measurements: ArrayLike,
        state: State,
        controls: ArrayLike | None = None,
        *,
        on_divergence: OnDivergence = "raise",
    ) -> Run:
        """Filter a record.

        Parameters
        ----------
        measurements
            At the end of each step, shape (k, m); a row with a nan is a missing one.
        state
            From `init`, or from an earlier run to go on.
        controls
            Held over each step, shape (k, p); left out for models without inputs.
        on_divergence
            ``raise``, or ``return`` what there was up to then, with `Run.diverged_at`.

        Raises
        ------
        InputError
            If the shapes do not fit, or a control is not finite.
        DivergenceError
            If a filter leaves the range of floating-point numbers; it gives the sample.
        """
        loud = raises(on_divergence)
        n, inputs, m = _size(self.filters[0])
        taken = as_samples("measurements", measurements, m, missing=True)
        held = as_controls(controls, len(taken), inputs)
        rows, r = len(taken), len(self.filters)
        checked = self._checked(state, n, m)
        estimates, covariances = np.empty((rows, n)), np.empty((rows, n, n))
        probabilities, innovations = np.empty((rows, r)), np.empty((rows, r, m))
        beliefs = Beliefs(
            np.array([belief.mean for belief in checked.beliefs]),
            np.array([belief.covariance for belief in checked.beliefs]),
            np.array([belief.error for belief in checked.beliefs]),
            checked.log_probabilities.copy(),
        )
        found = estimates, covariances, probabilities, innovations
        if self._bank is None:
            good = self._run_one_by_one(beliefs, taken, held, *found)
        else:
            law = self._linear[0].law
            good = run_bank(
                (0,) * n, (0,) * m, self._bank, law, beliefs, taken, held, new_work(n, m), *found
            )
        if good < rows and loud:
            raise DivergenceError(type(self).__name__, good, sample=True)
        moved = tuple(Belief(*(part[j].copy() for part in beliefs[:3])) for j in range(r))
        return Run(
            estimates[:good],
            covariances[:good],
            probabilities[:good],
            innovations[:good],
            int(np.isnan(taken[:good]).any(axis=1).sum()),
            State(moved, beliefs.log_probabilities) if good == rows else state,
            None if good == rows else good,
        )

    def _checked(self, state: State, states: int, outputs: int) -> State:
        """The state, of this bank; `InputError` if it is not."""
        r = len(self.filters)
        beliefs = getattr(check_state(state, State, ""), "beliefs", ())
        if not isinstance(beliefs, list | tuple) or len(beliefs) != r:
            count = len(beliefs) if isinstance(beliefs, list | tuple) else "no"
            raise InputError("state", f"has {count} beliefs, must have {r}")
        checked = tuple(
            check_belief(f"state.beliefs[{j}]", belief, states, outputs)
            for j, belief in enumerate(beliefs)
        )
        logarithms = as_numbers("state.log_probabilities", state.log_probabilities)
        if logarithms.shape != (r,) or np.isnan(logarithms).any() or logarithms.max() == -np.inf:
            raise InputError("state.log_probabilities", f"must be {r} logarithms of probabilities")
        return State(checked, logarithms)

    def _run_one_by_one(
        self,
        beliefs: Beliefs,
        measurements: Array,
        controls: Array,
        estimates: Array,
        covariances: Array,
        probabilities: Array,
        innovations: Array,
    ) -> int:
        """What the compiled loop does, with filters that are called: they may be anyone's."""
        r, n = beliefs.means.shape
        states = (0,) * n
        transition = np.ascontiguousarray(self.transition, dtype=np.float64)
        weights, predicted, log_likelihoods = np.empty((r, r)), np.empty(r), np.empty(r)
        mixed, spread = np.empty((r, n)), np.empty((r, n, n))
        for k, (measurement, control) in enumerate(zip(measurements, controls, strict=True)):
            mixing_probabilities(transition, beliefs.log_probabilities, weights, predicted)
            if self.mixing:
                interact(states, weights, beliefs.means, beliefs.covariances, mixed, spread)
            else:
                mixed[:], spread[:] = beliefs.means, beliefs.covariances
            for j, one in enumerate(self.filters):
                before = Belief(mixed[j].copy(), spread[j].copy(), beliefs.errors[j].copy())
                try:
                    told = one.correct(one.predict(before, control), measurement, control)
                except DivergenceError:
                    return k
                beliefs.means[j], beliefs.covariances[j] = told.belief.mean, told.belief.covariance
                beliefs.errors[j] = told.belief.error
                innovations[k, j], log_likelihoods[j] = told.innovation, told.log_likelihood
            update_probabilities(predicted, log_likelihoods, beliefs.log_probabilities)
            probabilities[k] = [math.exp(value) for value in beliefs.log_probabilities]
            combine(
                states, probabilities[k], beliefs.means, beliefs.covariances,
                estimates[k], covariances[k],
            )  # fmt: skip
            found = estimates[k], covariances[k], probabilities[k]
            if not all(np.isfinite(part).all() for part in found):
                return k
        return len(measurements)

    @cached_property
    def _linear(self) -> list[LinearFilter]:
        """The filters, if one compiled loop can run them all: one law, one number of parameters."""
        linear = [one for one in self.filters if isinstance(one, LinearFilter)]
        alike = {(id(one.law), len(one.law_parameters)) for one in linear}
        return linear if len(linear) == len(self.filters) and len(alike) == 1 else []

    @cached_property
    def _bank(self) -> Bank | None:
        linear = self._linear
        if not linear:
            return None
        arrays = [one.model.arrays for one in linear]
        return Bank(
            ModelArrays(*(np.array(parts) for parts in zip(*arrays, strict=True))),
            np.array([one.law_parameters for one in linear]),
            np.ascontiguousarray(self.transition, dtype=np.float64),
            self.mixing,
        )


def _size(one: ModeFilter) -> tuple[int, int, int]:
    return one.model.states, one.model.inputs, one.model.outputs


def _as_transition(value: ArrayLike, size: int) -> Array:
    """A row-stochastic matrix; the first row that is none is named."""
    matrix = as_floats("transition", value)
    if matrix.shape != (size, size):
        raise InputError("transition", f"has shape {matrix.shape}, must be {(size, size)}")
    for i, row in enumerate(matrix):
        if row.min() < 0 or abs(row.sum() - 1.0) > 1e-9:
            raise InputError(
                "transition",
                f"row {i} is {shown(row.tolist())} and sums to {row.sum():g}, must be "
                "probabilities that sum to 1",
            )
    return matrix
