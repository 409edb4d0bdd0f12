"""Build everything the ledger states, once, and run nothing: errors show before a long build."""

from __future__ import annotations

from reobserve.errors import InputError, located
from reobserve.ledger.check import building, check_figures, check_scenarios, check_studies
from reobserve.ledger.types import Job, named
from reobserve.papers.delay import keys, observe, plant
from reobserve.papers.delay.study_tuning import SWEEPS
from reobserve.papers.delay.theory_runs import NEEDED
from reobserve.timeseries.grid import stride


def check(ledger: keys.Ledger) -> None:
    """Raise the `InputError` that a stage would raise, with the config key of the ledger."""
    check_scenarios(ledger, plant.build)
    for name, observer in ledger.observers.items():
        with building(f"observers.{name}"):
            observe.build(Job(ledger.plant, observer=observer))
            stride(ledger.plant, observer.sampling_period)
    _check_studies(ledger)
    _check_models(ledger)
    with located("theory"):
        stride(ledger.plant, ledger.theory.sampling_period)
        for name, kind in NEEDED.items():
            named(ledger.observers, name, kind)
        named(ledger.observers, "order2_noise", keys.Extended).levant()


def _check_studies(ledger: keys.Ledger) -> None:
    """Studies and their figures must be about observers that they can vary."""
    of_tuning = {name: kind for name, (kind, _, _) in SWEEPS.items()}
    check_studies(ledger, {keys.Tuning: of_tuning})
    check_figures(ledger, keys.StudyFigure, {"tuning": of_tuning})
    for name, study in ledger.studies.items():
        if isinstance(study, keys.Tradeoff):
            with located(f"studies.{name}"):
                stride(ledger.plant, study.sampling_period)
                for observer in study.observers:
                    named(ledger.observers, observer, keys.Extended)


def _check_models(ledger: keys.Ledger) -> None:
    """Observers of a figure must be told the model of its scenario, or none; some draw states."""
    for name, figure in ledger.figures.items():
        model = ledger.scenarios[figure.scenario].model
        with located(f"figures.{name}"):
            for observer in figure.observers:
                stated = ledger.observers[observer]
                # Estimators of the delay alone are for the scalar plant.
                known = getattr(stated, "model", "lag")
                if known != model:
                    problem = f"{observer!r} is for the model {known}, the scenario has {model}"
                    raise InputError("observers", problem)
                if figure.layout == "comparison" and isinstance(stated, keys.Standard):
                    raise InputError("observers", f"{observer!r} does not estimate the delay")
            if figure.layout == "states" and model != "pendulum":
                raise InputError("scenario", "must be of the pendulum, whose states are drawn")
