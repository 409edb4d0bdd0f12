"""Maximum likelihood of a filter's parameters on records, with standard errors.

A Kalman filter computes the likelihood of its measurements by their innovations e and the
covariances S of these, up to a constant: -1/2 sum (log det S + e' S^-1 e) (Schweppe 1965). Its
maximum is the estimate of maximum likelihood; where that is inside the ranges, the inverse of the
observed information, minus the second derivatives at the maximum, is its covariance for long
records (Ljung & Caines 1979).
"""

from __future__ import annotations

import math
import warnings
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from reobserve.core.arguments import as_whole
from reobserve.core.errors import InputError, one_line, shown
from reobserve.core.progress import progress
from reobserve.observers.gaussian_state import VagueStartWarning
from reobserve.tuning.optimisers import sobol
from reobserve.tuning.search import FAILURES, Range, Settings, as_ranges, edges_of

Array = NDArray[np.float64]

_STARTS = 3  # of the local search, the best of the points tried first
_STEP = 1e-6  # of the range, of the differences for gradients
_AT_END = 1e-6  # of the range: what is nearer to an end is at it, and has no derivatives
_CHANGE = 1e-3  # of the log-likelihood, of the differences for second derivatives
_WORST = 1e300  # what a filter counts that cannot run
_MOST = 1_000_000


@dataclass(frozen=True, eq=False)
class Fit:
    """Parameters of maximum likelihood.

    Attributes
    ----------
    values
        By name.
    standard_errors
        By name, in the units of the values; nan at an end of a range, beside values at which the
        filter cannot run, and where the records do not separate the parameters.
    covariance
        Of the estimates in the order of the values, nan likewise.
    log_likelihood
        Of all records, at the maximum.
    edges
        Names of values within 2 % of an end of their range, with ``low`` or ``high``: a wider
        range may have better ones.
    measured
        The number of measurements that it is the likelihood of.
    evaluations
        How often the filter ran.
    """

    values: Settings
    standard_errors: Settings
    covariance: Array
    log_likelihood: float
    edges: dict[str, str]
    measured: int
    evaluations: int

    @property
    def bic(self) -> float:
        """The Bayesian information criterion: of two models the one with the lower is preferred."""
        return len(self.values) * math.log(self.measured) - 2.0 * self.log_likelihood

    def __repr__(self) -> str:
        parts = [
            f"{name} {value:.5g} ({self.standard_errors[name]:.2g})"
            for name, value in self.values.items()
        ]
        return one_line(f"Fit({', '.join(parts)}; log-likelihood {self.log_likelihood:.8g})")


def fit(
    make: Callable[[Settings], Any],
    ranges: Mapping[str, Any],
    records: Sequence[Any],
    *,
    budget: int = 5000,
    seed: int = 1,
) -> Fit:
    """Find the parameters of a filter under which records are most likely.

    The ranges are searched from the best of 16 points of Sobol's sequence on, by L-BFGS-B with
    gradients by differences. Parameters are values at run time, so that nothing is compiled for
    another one. On a terminal, a line on standard error shows progress.

    Parameters
    ----------
    make
        Called with a value for each name in ``ranges``; returns a filter with a likelihood and the
        state that each record starts from: ``(kalman, kalman.init(mean, covariance))``.
    ranges
        For each parameter (low, high), or (low, high, "linear") where no logarithmic scale is
        meant.
    records
        A list; each y, (y, u), or arguments of `Observer.run` by name, such as y, u and time.
    budget
        The largest number of runs over all records.
    seed
        Of the first points.

    Raises
    ------
    InputError
        If a range, the budget or a record cannot be used, the observer has no likelihood, no choice
        works on all records, or the budget is spent before the maximum is found.

    Examples
    --------
    >>> import numpy as np
    >>> from reobserve import KalmanFilter, LinearModel, fit
    >>> rng = np.random.default_rng(1)
    >>> level = np.cumsum(0.3 * rng.standard_normal(2000))
    >>> y = level + rng.standard_normal(2000)
    >>> def make(p):
    ...     kalman = KalmanFilter(LinearModel([[1]], C=[[1]], Q=p["q"], R=p["r"]))
    ...     return kalman, kalman.init([0], 1)
    >>> found = fit(make, {"q": (1e-4, 10), "r": (1e-2, 100)}, [y])
    >>> print({name: round(value, 3) for name, value in found.values.items()})
    {'q': 0.082, 'r': 1.002}
    >>> print({name: round(error, 3) for name, error in found.standard_errors.items()})
    {'q': 0.01, 'r': 0.037}
    """
    bounds = as_ranges(ranges)
    if not callable(make):
        raise InputError("make", f"{shown(make)} must be a function")
    if isinstance(records, str | Mapping) or not isinstance(records, Sequence) or not len(records):
        raise InputError("records", f"{shown(records)} must be a list of one record or more")
    runs = [_arguments(record, f"records[{k}]") for k, record in enumerate(records)]
    budget = as_whole("budget", budget, 1, _MOST)
    shown_as = f"{{}} of at most {budget} runs, log-likelihood {{:.8g}}"
    with progress(shown_as) as tell, warnings.catch_warnings():
        warnings.simplefilter("ignore", VagueStartWarning)  # of each start that is tried
        likelihood = _Likelihood(make, bounds, runs, budget, tell)
        points = sobol(len(bounds), as_whole("seed", seed, 0, 2**63 - 1))
        firsts = [likelihood(point) for point in points]
        if min(firsts) >= _WORST:
            problem = f"hold none of {len(points)} choices that work on all records"
            raise InputError("ranges", f"{problem}; the last one: {likelihood.reason}")
        best = min(
            (_descend(likelihood, points[k]) for k in np.argsort(firsts)[:_STARTS]),
            key=lambda descent: descent[0],
        )
        place, value = best[1], -best[0]
        edges = edges_of(dict(zip(bounds, place.tolist(), strict=True)))
        inside = [_AT_END < at < 1.0 - _AT_END for at in place]
        covariance = _covariance(likelihood, place, inside)
    values = {name: span.value(at) for (name, span), at in zip(bounds.items(), place, strict=True)}
    slopes = np.array([_slope(span, values[name]) for name, span in bounds.items()])
    covariance = covariance * np.outer(slopes, slopes)
    errors = np.sqrt(np.diag(covariance)).tolist()
    return Fit(
        values, dict(zip(bounds, errors, strict=True)), covariance, value, edges,
        likelihood.measured, likelihood.evaluations,
    )  # fmt: skip


def _arguments(record: Any, place: str) -> dict[str, Any]:
    """The arguments of a run by name."""
    if isinstance(record, Mapping):
        if "y" not in record or "state" in record:
            problem = "must have y, and no state, which make returns"
            raise InputError(place, problem)
        return dict(record)
    if isinstance(record, tuple) and len(record) == 2:
        return {"y": record[0], "u": record[1]}
    return {"y": record}


class _MisuseError(InputError):
    """A mistake of the caller, which other values do not mend."""


class _Likelihood:
    """Minus the log-likelihood at places in the unit cube, `_WORST` where a filter cannot run."""

    def __init__(
        self, make: Callable[[Settings], Any], bounds: Mapping[str, Range],
        runs: Sequence[dict[str, Any]], budget: int, tell: Callable[[int, float], None],
    ) -> None:  # fmt: skip
        self.make, self.bounds, self.runs = make, bounds, runs
        self.budget, self.tell = budget, tell
        self.evaluations, self.measured, self.best, self.reason = 0, 0, _WORST, ""
        self.failures = 0

    def __call__(self, place: Array) -> float:
        if self.evaluations == self.budget:
            problem = f"{self.budget} is spent before the maximum is found; raise it"
            raise InputError("budget", problem)
        self.evaluations += 1
        pairs = zip(self.bounds.items(), place, strict=True)
        values = {name: span.value(float(at)) for (name, span), at in pairs}
        try:
            total = self._total(self.make(values))
        except _MisuseError as error:
            raise error.renamed(error.parameter) from None
        except FAILURES as error:
            self.reason, self.failures = one_line(error), self.failures + 1
            total = _WORST
        self.best = min(self.best, total)
        if self.evaluations % 10 == 0:
            self.tell(self.evaluations, -self.best)
        return total

    def _total(self, made: Any) -> float:
        if not isinstance(made, tuple) or len(made) != 2 or not hasattr(made[0], "run"):
            problem = f"returned {shown(made)}, must return a filter and the state it starts from"
            raise _MisuseError("make", problem)
        observer, state = made
        if getattr(observer, "gate", None) is not None and (
            getattr(observer, "outliers", "skip") == "skip"
        ):
            problem = (
                "returned a filter whose gate skips measurements, which would make those likely "
                'that it leaves out; give it outliers="inflate", or no gate'
            )
            raise _MisuseError("make", problem)
        total, measured = 0.0, 0
        for arguments in self.runs:
            run = observer.run(start=state, **arguments)
            if "log_likelihood" not in run:
                problem = f"returned a {type(observer).__name__}, which has no log_likelihood"
                raise _MisuseError("make", problem)
            total += float(run["log_likelihood"].sum())
            measured += int(np.isfinite(np.asarray(arguments["y"], dtype=np.float64)).sum())
        if not measured:
            raise _MisuseError("records", "have no measurement")
        self.measured = measured
        return -total if math.isfinite(total) else _WORST


def _slope(span: Range, value: float) -> float:
    """The derivative of the value by its place."""
    return value * math.log(span.high / span.low) if span.scale == "log" else span.high - span.low


def _descend(likelihood: _Likelihood, start: Array) -> tuple[float, Array]:
    """The local maximum from a place on: minus its log-likelihood, and its place."""
    from scipy.optimize import minimize

    first = likelihood(start)

    def finite(place: Array) -> float:
        """The value, or a finite wall where a filter cannot run, from which a search steps back."""
        value = likelihood(place)
        return value if value < _WORST else first + 10.0 * (1.0 + abs(first))

    def with_gradient(place: Array) -> tuple[float, Array]:
        gradient = np.empty(len(place))
        for i in range(len(place)):
            ends = []
            for sign in (-1.0, 1.0):
                moved = place.copy()
                moved[i] = min(max(moved[i] + sign * _STEP, 0.0), 1.0)
                ends.append((moved[i], finite(moved)))
            (low, before), (high, after) = ends
            gradient[i] = (after - before) / (high - low)
        return finite(place), gradient

    failures = likelihood.failures
    result = minimize(
        with_gradient, start, jac=True, method="L-BFGS-B", bounds=[(0.0, 1.0)] * len(start),
        options={"ftol": 1e-13, "gtol": 1e-4, "maxiter": 500},
    )  # fmt: skip
    if likelihood.failures > failures:  # which may end it before the maximum: go on without slopes
        result = minimize(
            finite, result.x, method="Nelder-Mead", bounds=[(0.0, 1.0)] * len(start),
            options={"xatol": 1e-7, "fatol": 1e-9, "maxfev": 400 * len(start)},
        )  # fmt: skip
    return float(result.fun), np.asarray(result.x, dtype=np.float64)


def _covariance(likelihood: _Likelihood, place: Array, inside: Sequence[bool]) -> Array:
    """The inverse of the observed information, by place, nan for what is at an end."""
    covariance = np.full((len(place), len(place)), np.nan)
    free = [i for i, flag in enumerate(inside) if flag]
    if not free:
        return covariance
    base, failures = likelihood(place), likelihood.failures
    steps = [_step(likelihood, place, i, base) for i in free]

    def moved(*moves: tuple[int, float]) -> float:
        other = place.copy()
        for i, by in moves:
            other[free[i]] += by * steps[i]
        return likelihood(other)

    size = len(free)
    information = np.empty((size, size))
    for i in range(size):
        ends = moved((i, 1.0)) + moved((i, -1.0))
        information[i, i] = (ends - 2.0 * base) / steps[i] ** 2
        for j in range(i):
            four = (
                moved((i, 1.0), (j, 1.0)) - moved((i, 1.0), (j, -1.0))
                - moved((i, -1.0), (j, 1.0)) + moved((i, -1.0), (j, -1.0))
            )  # fmt: skip
            information[i, j] = information[j, i] = four / (4.0 * steps[i] * steps[j])
    if likelihood.failures > failures:
        return covariance  # a filter cannot run beside the maximum
    try:
        np.linalg.cholesky(information)
    except np.linalg.LinAlgError:
        return covariance  # the maximum is no point: the data do not separate the parameters
    covariance[np.ix_(free, free)] = np.linalg.inv(information)
    return covariance


def _step(likelihood: _Likelihood, place: Array, i: int, base: float) -> float:
    """A step along parameter i that changes the log-likelihood by about `_CHANGE`."""
    most = float(min(place[i], 1.0 - place[i]))
    step = min(1e-3, most)
    for _ in range(20):
        ends = []
        for sign in (-1.0, 1.0):
            other = place.copy()
            other[i] += sign * step
            ends.append(likelihood(other))
        change = 0.5 * sum(ends) - base
        if 0.1 * _CHANGE <= change <= 10.0 * _CHANGE:
            return step
        factor = math.sqrt(_CHANGE / change) if change > 0 else 10.0
        wider = min(step * min(max(factor, 0.1), 10.0), most)
        if wider == step:
            return step
        step = wider
    return step
