"""Checks that need systems and observers to be constructed: errors show before a long build."""

from __future__ import annotations

from collections.abc import Mapping

from reobserve.core.errors import InputError, located
from reobserve.core.matrices import as_vector
from reobserve.observers.normal_form import IdentityObserver
from reobserve.synthesis.normal_form.transform import NormalForm, normal_form
from reobserve_papers.metrics.responses import check_windows
from reobserve_papers.papers.lie import keys, plant, theory
from reobserve_papers.papers.lie.setup import build_observer, build_problem
from reobserve_papers.papers.lie.study import check_study
from reobserve_papers.parameters.parameter_checks import Checks
from reobserve_papers.signals.grid import stride


def _design(job: keys.Job) -> NormalForm:
    problem = build_problem(job.plant, job.design)
    return normal_form(problem.system, problem.degree, injection=problem.injection)


def _observer(job: keys.Job, form: NormalForm) -> None:
    stride(job.plant.step, build_observer(job.observer, form).sampling_period)


def _theory(job: keys.Job, forms: Mapping[str, NormalForm]) -> None:
    for name in ("linear", "nonlinear"):
        if name not in forms:
            raise InputError("designs", f"must have {name!r}")
    as_vector("initial_state", job.theory.initial_state, forms["linear"].S.variables)
    theory.siegel(job.theory)
    with located("compared_order"):
        IdentityObserver(forms["linear"], order=job.theory.compared_order, sampling_period=1.0)


def _metrics(job: keys.Job) -> None:
    periods = [body.sampling_period for body in job.observers.values()]
    period = max(periods, default=job.plant.step)
    windows = {"decay_window": job.metrics.decay_window}
    check_windows(windows, job.plant.horizon, period, least=2)


CHECKS = Checks(
    build={
        "scenario": plant.build,
        "design": _design,
        "observer": _observer,
        "metrics": _metrics,
        "study": lambda job, form: check_study(job.study, form),
        "theory": _theory,
    },
    about={
        keys.OrdersStudy: {"injection": keys.Observer},
        keys.EnsembleStudy: {"constant": keys.Observer},
        keys.InjectionsStudy: {"constant": keys.Identity, "cubic4": keys.Identity},
        keys.Theory: {
            "constant": keys.Identity,
            "injection": keys.Observer,
            "order4": keys.Observer,
        },
    },
)
