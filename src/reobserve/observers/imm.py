"""Interacting multiple model (Blom & Bar-Shalom 1988; Gadsden et al. 2011, (7) to (23)).

A bank of filters, one for each mode that the plant may be in, and a Markov chain that says how the
plant moves between them. A step mixes the filters' posteriors (interaction), lets each take the
sample (prediction, correction), weighs the modes by how well each predicted it, and combines the
posteriors.

What is mixed are the filters' states as they stand. The filters must therefore mean the same by
their states, or at least nearly so: in other coordinates of each model the same bank gives other
probabilities. Position, velocity and acceleration can be mixed; the states of transfer functions
that were identified one by one have no common meaning but by the realisation that is chosen.
Without mixing the coordinates do not matter to Kalman filters. To the SVSF they do even then, if it
has fewer outputs than states: the pseudo-inverse of C depends on the units of the states.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from reobserve.core.arguments import as_flag
from reobserve.core.covariances import as_covariances
from reobserve.core.errors import InputError, shown
from reobserve.core.loop_function import RaisedAfterLoop
from reobserve.core.matrices import (
    as_floats,
    as_numbers,
    as_positive,
    as_probabilities,
    as_row_stochastic,
)
from reobserve.core.value import for_loop
from reobserve.observers.contract import Observer
from reobserve.observers.estimated_noise import refuse_given
from reobserve.observers.filter_rules import Rules, forgetting
from reobserve.observers.gaussian_filter import GaussianFilter
from reobserve.observers.gaussian_state import (
    Matrices,
    ModeFilter,
    check_held,
    check_noise,
    check_sample,
    check_time,
    inputs_of_rows,
    periods_of,
    sample_before,
)
from reobserve.observers.imm_loop import Bank, run_bank
from reobserve.observers.imm_one_by_one import run_one_by_one
from reobserve.observers.imm_state import ImmState, check_filters, size_of
from reobserve.observers.imm_work import Posteriors, new_bank_rows, new_bank_work
from reobserve.observers.kalman import LINEAR
from reobserve.observers.linear_loop import NEGATIVE_CAUSE
from reobserve.observers.record import Record, Rows, check_state
from reobserve.observers.run import AxisNames, names_by_model
from reobserve.observers.uneven_times import uneven_times
from reobserve.observers.vague_start import warn_of_start
from reobserve.systems.linear import ModelRows
from reobserve.systems.periods import wrapped

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False, repr=False)
class IMM(Observer[ImmState]):
    """Bank of filters and a Markov chain of modes (Gadsden et al. 2011, after (23)).

        mu(i|j) = p_ij mu_i / c_j,    c_j = sum_i p_ij mu_i        by which filters are mixed
        mu_j proportional to L_j c_j,    L_j the likelihood of the measurement in mode j
        x = sum_j mu_j x_j,    P = sum_j mu_j (P_j + (x_j - x) (x_j - x)')

    `init` takes mean, covariance and probabilities. `run` and `step` take y, shape (k, m), nan
    where missing, and u, (k, p); of a bank of filters on linear models, by name, also A, B, C, D,
    Q, R and S, as `GaussianFilter` has them, for all modes, or (k, r, ., .), one for each mode.
    Estimates, in units of the models: ``state``, x, shape (k, n), ``covariance``, P, (k, n, n), and
    its diagonal ``variance``, (k, n); ``probability``, mu, (k, r); ``innovation``, (k, r, m), of
    each filter, nan where missing; and ``log_likelihood``, (k,), of the measurement over all modes,
    zero where missing.

    Parameters
    ----------
    filters
        One a mode. Kalman filters and SVSFs of one kind run as one compiled loop; other filters,
        of a user's own, need `ModeFilter`'s two methods and are called one by one.
    transition
        p_ij, shape (r, r): the probability that mode i is followed by mode j in the next row,
        however far that is. Rows sum to one.
    mixing
        Whether posteriors interact, (9) and (10). Without, each filter goes its own way and only
        the probabilities of the modes follow the chain.
    gate
        As `GaussianFilter` has it, for the bank: an output is left out if all filters would leave
        it out, as ``outlier``, (k, m), says.
    noise_memory
        As `GaussianFilter` has it, of a bank of Kalman filters whose R is the same: what a row says
        of R is the mean over the modes by their probabilities.

    Raises
    ------
    InputError
        If there is no filter, two differ in their numbers of states, inputs or outputs or in their
        sampling periods or in the periods of angles, one has a gate or a memory of its own, or the
        transition has a negative entry or a row that does not sum to one.

    Examples
    --------
    >>> from reobserve import IMM, KalmanFilter, LinearModel
    >>> models = [LinearModel([[a]], C=[[1]], Q=1e-4, R=1e-2) for a in (0.9, 0.5)]
    >>> bank = IMM([KalmanFilter(one) for one in models], [[0.99, 0.01], [0.01, 0.99]])
    >>> run = bank.run([1.0, 0.9, 0.8, 0.4, 0.2, 0.1], state=bank.init([1.0], 0.1))
    >>> print(run["probability"][[2, 5]].round(2))
    [[1.   0.  ]
     [0.01 0.99]]
    """

    filters: tuple[ModeFilter, ...]
    transition: Array
    mixing: bool = True
    sampling_period: float = field(init=False)
    gate: float | None = field(default=None, kw_only=True)
    noise_memory: float | None = field(default=None, kw_only=True)

    reads_between: ClassVar[bool] = False
    reads_missing: ClassVar[bool] = True
    takes: ClassVar[tuple[str, ...]] = (*ModelRows._fields, "S")
    units: ClassVar[Mapping[str, str]] = {
        "state": "", "variance": "", "covariance": "", "probability": "1", "innovation": "",
        "log_likelihood": "",
    }  # fmt: skip

    if TYPE_CHECKING:  # what it takes is wider than what it then holds

        def __init__(
            self, filters: Sequence[ModeFilter], transition: ArrayLike, mixing: bool = ..., *,
            gate: float | None = ..., noise_memory: float | None = ...,
        ) -> None: ...  # fmt: skip

    def __post_init__(self) -> None:
        filters: Any = self.filters
        check_filters(filters)
        self._set("filters", tuple(filters))
        self._set("transition", as_row_stochastic("transition", self.transition, len(filters)))
        self._set("mixing", as_flag("mixing", self.mixing))
        self._set("sampling_period", filters[0].model.sampling_period)
        for name in ("gate", "noise_memory"):
            value = getattr(self, name)
            self._set(name, None if value is None else as_positive(name, value))
        if self.noise_memory is not None:
            self._check_noise_memory()

    def _check_noise_memory(self) -> None:
        """Refuse to estimate R where not one of the filters can see it, or there is no one R."""
        if not self._linear or any(not each.has_kalman_gain for each in self._linear):
            problem = "must be left out: it is for banks of Kalman filters on linear models"
            raise InputError("noise_memory", problem)
        first = self._linear[0].model.R
        for j, mode in enumerate(self._linear):
            if not np.array_equal(mode.model.R, first):
                raise InputError("noise_memory", f"must be left out: filters[{j}] has another R")
        refused: InputError | None = None
        for mode in self._linear:
            try:
                replace(mode, noise_memory=self.noise_memory)
            except InputError as error:
                refused = refused or error
            else:
                return
        assert refused is not None
        raise refused

    @property
    def _periods(self) -> Mapping[str, Array]:
        periods, _ = periods_of(self.filters[0])
        return {"state": periods} if periods.any() else {}

    @cached_property
    def _rules(self) -> Rules:
        """The settings of the filters beside their models, without the bank's gate."""
        weight = forgetting(self.noise_memory, self.sampling_period)
        return Rules(*periods_of(self.filters[0]), np.inf, False, weight)

    @property
    def measurements(self) -> int:
        """The number of measurements in a row of y."""
        return size_of(self.filters[0])[2]

    @property
    def inputs(self) -> int:
        """The number of known inputs in a row of u."""
        return size_of(self.filters[0])[1]

    @property
    def component_names(self) -> Mapping[str, AxisNames]:
        """Names of components of estimates, by the model of the first filter."""
        first = self.filters[0]
        names = names_by_model(getattr(first, "whole", first.model))
        if "innovation" in names:
            names["innovation"] = (None, *names["innovation"])
        return names

    def init(
        self,
        mean: ArrayLike,
        covariance: ArrayLike,
        probabilities: ArrayLike | None = None,
        *,
        u: ArrayLike | None = None,
    ) -> ImmState:
        """The state before the first row of a record.

        Parameters
        ----------
        mean
            Shape (n,) for all filters, or (r, n).
        covariance
            A number, n numbers or (n, n) for all filters, or (r, n, n).
        probabilities
            mu, shape (r,), all the same if left out.
        u
            Left out, all these are meant at the first row, whose measurement corrects them. Given,
            they are meant a sampling period before it, and u, shape (p,), is the input that is
            held up to it: the bank then mixes and predicts first.

        Raises
        ------
        InputError
            If one of them is not that, or the probabilities do not sum to one.
        """
        r, (n, _, m), inputs = len(self.filters), size_of(self.filters[0]), self.inputs
        means = as_floats("mean", mean)
        if means.shape not in ((n,), (r, n)):
            raise InputError("mean", f"has shape {means.shape}, must be ({n},) or ({r}, {n})")
        means = wrapped(np.broadcast_to(means, (r, n)), periods_of(self.filters[0])[0])
        covariances = as_covariances("covariance", covariance, n, r)
        covariances = np.broadcast_to(covariances, (r, n, n)).copy()
        chosen = np.full(r, 1.0 / r) if probabilities is None else probabilities
        with np.errstate(divide="ignore"):
            logarithms = np.log(as_probabilities("probabilities", chosen, r))
        held, noise = sample_before(u, m, inputs), None
        if self.noise_memory is not None:
            noise = np.diag(self._linear[0].model.R).copy()
        return ImmState(means, covariances, np.zeros((r, m)), logarithms, held, noise=noise)

    def _checked(self, state: Any) -> ImmState:
        r, (n, _, m), inputs = len(self.filters), size_of(self.filters[0]), self.inputs
        shapes = [np.shape(getattr(state, part, ())) for part in ("means", "covariances", "errors")]
        given = check_state(
            state, ImmState,
            f"has arrays of shapes {', '.join(map(str, shapes))}, must be of {r} filters of {n} "
            f"states and {m} outputs",
            means=(r, n), covariances=(r, n, n), errors=(r, m),
        )  # fmt: skip
        logarithms = as_numbers("state.log_probabilities", given.log_probabilities, writable=False)
        if logarithms.shape != (r,) or np.isnan(logarithms).any() or logarithms.max() == -np.inf:
            raise InputError("state.log_probabilities", f"must be {r} logarithms of probabilities")
        sample = check_sample(given.sample, m, inputs)
        held: Any = given.held
        if held is not None:
            modes = self._linear
            if type(held) is not tuple or len(held) != len(modes):
                raise InputError("state.held", f"{shown(held)} must be of {len(modes)} filters")
            held = tuple(
                check_held(matrices, mode, f"state.held[{j}]") or {}
                for j, (matrices, mode) in enumerate(zip(held, modes, strict=True))
            )
        time = check_time(given.time)
        noise = check_noise(given.noise, self.noise_memory is not None, m)
        same = logarithms is given.log_probabilities and sample is given.sample
        if same and noise is given.noise and held is None:
            return given
        return replace(
            given, log_probabilities=logarithms, sample=sample, held=held, time=time, noise=noise
        )

    def _timed(
        self, time: ArrayLike | None, state: ImmState, record: Record
    ) -> tuple[Array, Record]:
        able = (
            self._linear
            and self.noise_memory is None
            and all(mode.model.density is not None or "Q" in record.given for mode in self._linear)
        )
        timed = uneven_times(self.filters[0].model, time, state, record) if able else None
        return super()._timed(time, state, record) if timed is None else timed

    def _fill(self, state: ImmState, record: Record) -> Rows:
        r, (n, _, m), k = len(self.filters), size_of(self.filters[0]), len(record.y)
        parts = state.means, state.covariances, state.errors, state.log_probabilities
        noise = np.ones(m) if state.noise is None else state.noise.copy()
        count = np.array([float(state.count + (state.sample is not None))])
        posteriors = Posteriors(*(part.copy() for part in (*parts, noise, count)))
        (inputs, past), fresh = self._inputs(state, record), state.sample is None
        gated, learned = self.gate is not None, self.noise_memory is not None
        rows, held = new_bank_rows(k, r, n, m, gated, learned), None
        refuse_given(self, record.given)
        why = ""
        if not self._linear:
            if record.given:
                problem = "is taken by banks of filters of one kind on linear models alone"
                raise InputError(next(iter(record.given)), problem)
            good, why = run_one_by_one(self, posteriors, record.y, inputs[:, 0], fresh, rows)
        else:
            model = self._model
            if record.given or state.held is not None or record.periods is not None:
                model, inputs, held = self._in_record(state, record, inputs)
            with RaisedAfterLoop():
                good = run_bank(
                    Bank(
                        model, self._parameters, for_loop(self.transition),
                        self.mixing, np.inf if self.gate is None else self.gate,
                    ),
                    self._linear[0].method.function, posteriors, record.y, inputs, fresh,
                    new_bank_work(posteriors, self.mixing, self._rules), rows,
                )  # fmt: skip
        variance = rows.covariance.diagonal(axis1=1, axis2=2)
        if state.count <= n and n * m > 1:
            start = state.covariances.diagonal(0, 1, 2).max(axis=0)
            warn_of_start(start, variance[: min(good, n + 1)])
        estimates = {"state": rows.state, "variance": variance, **rows._asdict()}
        if not gated:
            del estimates["outlier"]
        if not learned:
            del estimates["noise_variance"]
        reached = ImmState(
            *posteriors[:4], np.concatenate([record.y[-1], record.u[-1]]),
            state.count + k - fresh, held,
            None if record.time is None else float(record.time[-1]),
            posteriors.noise if learned else None, past,
        )  # fmt: skip
        if good < k and (posteriors.covariances.diagonal(0, 1, 2) < 0).any():
            why = NEGATIVE_CAUSE
        return Rows(estimates, good, reached, finding=why)

    def _inputs(self, state: ImmState, record: Record) -> tuple[Array, Array | None]:
        """The input of the row before a record, then of each row, (k + 1, 1 or r, p), and past."""
        return inputs_of_rows(state.sample, record)[:, None], None

    def _in_record(
        self, state: ImmState, record: Record, inputs: Array
    ) -> tuple[ModelRows, Array, tuple[Matrices, ...] | None]:
        """The models of all modes by row, (., r, ...), their inputs, and what the state holds."""
        rows = []
        for j, kf in enumerate(self._linear):
            given = {name: self._of_mode(name, value, j) for name, value in record.given.items()}
            for name in given:
                if name not in kf.takes:
                    problem = f"is not taken by {type(kf).__name__}, which is a filter of the bank"
                    raise InputError(name, problem)
            before = None if state.held is None else state.held[j]
            shared = inputs[None, :, 0]
            rows.append(kf._in_record(given, record.y, shared, before, record.periods))
        model = ModelRows(
            *(
                np.stack(np.broadcast_arrays(*matrices), axis=1)
                for matrices in zip(*(row.model for row in rows), strict=True)
            )
        )
        held = tuple(row.held or {} for row in rows)
        stacked = np.stack([row.inputs[0] for row in rows], axis=1)
        return model, stacked, held if any(held) else None

    def _of_mode(self, name: str, value: Any, mode: int) -> Any:
        """The values given for one mode: for all of them, or (k, r, ., .)."""
        matrices = as_floats(name, value)
        if matrices.ndim < 4:
            return matrices
        if matrices.shape[1] != len(self.filters):
            problem = f"has shape {matrices.shape}, must be (k, {len(self.filters)}, ., .)"
            raise InputError(name, problem)
        return matrices[:, mode] if len(matrices) > 1 else matrices[0, mode]

    @cached_property
    def _linear(self) -> list[GaussianFilter]:
        """The filters, if one loop can run them all: one gain function, as many parameters."""
        linear = [
            kf
            for kf in self.filters
            if isinstance(kf, GaussianFilter) and kf.steps is LINEAR and kf.whole is kf.model
        ]
        alike = {(kf.method.function, len(kf.method.parameters)) for kf in linear}
        return linear if len(linear) == len(self.filters) and len(alike) == 1 else []

    @cached_property
    def _model(self) -> ModelRows:
        """The matrices of all modes, (1, r, ...)."""
        arrays = zip(*(mode.model.arrays for mode in self._linear), strict=True)
        return ModelRows(*(np.array([matrices]) for matrices in arrays))

    @cached_property
    def _parameters(self) -> Array:
        """Parameters of the gain of each filter, (r, .)."""
        return np.array([mode.method.parameters for mode in self._linear])
