"""The command `reobserve fit`: numbers of a specification by maximum likelihood on a log."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from reobserve.core.errors import InputError
from reobserve.core.files import check_not_read, check_replaceable, write_text
from reobserve.core.matrices import as_scalar
from reobserve.estimation.estimate import Estimation
from reobserve.estimation.gaps import Stretch, joined
from reobserve.tuning.fit import Fit, fit
from reobserve.tuning.search import Settings
from reobserve.tuning.tuned_specification import TunedSpecification


def run(
    specification: Path, data: Path, ranges: Sequence[tuple[str, str, str]],
    linear: Sequence[str], output: Path | None, budget: int,
) -> None:  # fmt: skip
    """Fit numbers of a specification, print them with standard errors, and write the whole."""
    if output is not None:
        check_replaceable(output)
        check_not_read([output], [specification, data])
    tuned = TunedSpecification(specification)
    bounds: dict[str, Any] = {}
    for key, low, high in ranges:
        if not key.startswith("observer."):
            raise InputError(key, "must be a number of the observer: observer.KEY")
        ends = tuple(_number(key, text) for text in (low, high))
        bounds[key] = (*ends, "linear") if key in linear else ends
        tuned.number(key)
    for key in linear:
        if key not in bounds:
            raise InputError(f"--linear {key}", "has no --range")
    records = _records(tuned, data)
    before = _total(tuned, {}, records)

    def make(values: Settings) -> tuple[Any, Any]:
        design = tuned.design(values)
        return design.observer, design.start()

    fitted = fit(make, bounds, records, budget=budget)
    print(table(fitted, {key: tuned.number(key) for key in bounds}, before))
    if output is not None:
        rounded = {name: float(f"{value:.6g}") for name, value in fitted.values.items()}
        write_text(output, tuned.text(rounded))


def _number(key: str, text: str) -> float:
    try:
        return as_scalar(key, float(text))
    except ValueError:
        raise InputError(key, f"the range's end {text!r} must be a number") from None


def _records(tuned: TunedSpecification, data: Path) -> list[dict[str, Any]]:
    """The rows of a log as the observer reads them, from each of its starts on."""
    estimation = tuned.estimation({}, data)
    if not hasattr(estimation.observer, "init") or "log_likelihood" not in estimation.sample:
        problem = f"a {type(estimation.observer).__name__} has no likelihood; Kalman filters have"
        raise InputError("observer.kind", problem)
    stretches: list[Stretch] = []
    _collect(estimation, stretches)
    estimation.feed(tuned.cells(data))
    estimation.finish()
    starts = [k for k, stretch in enumerate(stretches) if stretch.fresh]
    if not starts:
        raise InputError(str(data), "has no row from which the observer could start")
    parts = [
        joined(stretches[since:until])
        for since, until in zip(starts, [*starts[1:], len(stretches)], strict=True)
    ]
    return [{"y": part.y, "u": part.u if part.u.shape[1] else None} for part in parts]


def _collect(estimation: Estimation, stretches: list[Stretch]) -> None:
    """Let an estimation collect the stretches that it runs."""
    run_stretch = estimation._run

    def collected(stretch: Stretch) -> Any:
        stretches.append(stretch)
        return run_stretch(stretch)

    estimation._run = collected  # type: ignore[method-assign]


def _total(tuned: TunedSpecification, values: Settings, records: Sequence[dict[str, Any]]) -> float:
    """The log-likelihood of records with the numbers as they are stated."""
    design = tuned.design(values)
    runs = [design.observer.run(start=design.start(), **record) for record in records]
    return float(sum(run["log_likelihood"].sum() for run in runs))


def table(fitted: Fit, before: Settings, likelihood: float) -> str:
    """The values with standard errors, and what the likelihood says, as lines of text."""
    width = max(map(len, fitted.values))
    lines = [f"{'number':<{width}}  {'stated':>12} {'fitted':>12} {'standard error':>15}"]
    for name, value in fitted.values.items():
        error = fitted.standard_errors[name]
        spread = f"{error:>15.3g}" if np.isfinite(error) else f"{'-':>15}"
        edge = fitted.edges.get(name)
        note = f"  at the {edge} end of its range" if edge else ""
        lines.append(f"{name:<{width}}  {before[name]:>12.6g} {value:>12.6g} {spread}{note}")
    lines += [
        f"log-likelihood {likelihood:.8g} as stated, {fitted.log_likelihood:.8g} fitted, of "
        f"{fitted.measured} measurements",
    ]
    if not fitted.edges and not np.isfinite(fitted.covariance).all():
        lines.append("no standard errors: the record does not separate these numbers")
    return "\n".join(lines)
