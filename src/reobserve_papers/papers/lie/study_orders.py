"""The identity form over the order and the kind of its gain, and why its errors decay.

Along the limit cycle a small error obeys e' = (f'(x) + L(x) (l(h))'(x)) e. Its Floquet exponents
are the rates at which it decays there. All trajectories of the example end on the limit cycle.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

from reobserve.core.errors import located
from reobserve.observers.normal_form import IdentityObserver
from reobserve.synthesis.normal_form.identity_gain import GAINS, gain_at
from reobserve.synthesis.normal_form.transform import NormalForm
from reobserve_papers.papers.lie import keys
from reobserve_papers.papers.lie.floquet import LimitCycle, floquet_exponents, limit_cycle
from reobserve_papers.papers.lie.observe import observe
from reobserve_papers.papers.lie.scoring import integral_of_squares, settling_time
from reobserve_papers.papers.lie.setup import build_observer, forms
from reobserve_papers.papers.lie.study_rows import Row, summary
from reobserve_papers.signals.series import Series

NAN = float("nan")


def run(
    job: keys.Job, study: keys.OrdersStudy, plant: Series, design: Mapping[str, Any]
) -> list[Row]:
    """Rows by gain and order, of the study's observers, of the limit cycle and of a plant's copy.

    `copy` is the plant without any correction.
    """
    observers = job.observers
    known = forms(job, study.design, design)
    form = known[study.design]
    with located("studies.orders"):
        cycle = limit_cycle(form.problem.system, plant["state"][0], study.settle)
    where = cycle.points(2 * (study.cycle_points // 2))
    rows = [summary("cycle", 0, "period", cycle.period, "s")]
    model = next(iter(observers.values()))
    for gain in GAINS:
        for order in study.orders:
            with located("studies.orders"):
                observer = IdentityObserver(
                    form, order=order, gain=gain, sampling_period=model.sampling_period
                )
            rows += _errors(job, plant, gain, order, observer, model.initial_estimate)
            rows.append(_exponent(cycle, where, form, gain, order, gain))
    for name, body in observers.items():
        with located(f"observers.{name}"):
            other = known[body.design]
            built = build_observer(body, other)
        rows += _errors(job, plant, name, built.order, built, body.initial_estimate)
        rows.append(_exponent(cycle, where, other, "jacobian", built.order, name))
    n = form.problem.system.states
    slopes = form.problem.system.dynamics.jacobian()(where).reshape(-1, n, n)
    exponent = floquet_exponents(cycle, slopes)[0]
    rows.append(summary("copy", 0, "floquet_exponent", exponent, "1/s"))
    return rows


def _errors(
    job: keys.Job, plant: Series, name: str, order: int, observer: Any, initial: Any
) -> Iterator[Row]:
    run, every = observe(observer, initial, job.plant, plant, "return")
    step = observer.sampling_period
    ise, settled, lost = NAN, NAN, NAN
    if run.diverged_at is not None:
        lost = run.diverged_at
    else:
        error = run["state"] - plant["state"][:: 2 * every]
        ise = float(integral_of_squares(error, step).sum())
        settled = settling_time(error, step, job.metrics.settling_band)
    yield summary(name, order, "ise", ise, "s")
    yield summary(name, order, "settling_time", settled, "s")
    yield summary(name, order, "diverged_at", lost, "s")


def _exponent(cycle: LimitCycle, x: Any, form: NormalForm, gain: str, order: int, name: str) -> Row:
    """The largest Floquet exponent, for which the normal form is designed for -0.5."""
    problem, n = form.problem, form.problem.system.states
    injected = problem.injection.after(
        problem.system.output, problem.injection.degree * problem.system.output.degree
    )
    slopes = problem.system.dynamics.jacobian()(x).reshape(-1, n, n)
    corrected = gain_at(gain, order, form.S, form.T, form.gain, x)
    jacobians = slopes + corrected @ injected.jacobian()(x).reshape(-1, n, n)
    return summary(name, order, "floquet_exponent", floquet_exponents(cycle, jacobians)[0], "1/s")
