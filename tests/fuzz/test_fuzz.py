"""Some thousands of odd inputs of every class: each is accepted, or refused in one sentence."""

from __future__ import annotations

import importlib
import inspect
import pkgutil
from collections.abc import Iterator
from typing import Any

import pytest

import reobserve.designs
import reobserve.models
import reobserve.observers
import reobserve.plants
import reobserve.synthesis

from .classes import CLASSES, make
from .harness import EXAMPLES, Worker, distinct, run
from .judge import ACCEPTED, REFUSED
from .subjects import subjects

SEED = 13

# What the library's own parts hand to each other, checked where users hand it in.
INNER = {
    # What the command line hands on, tried by its own classes of cases.
    "designs.command.read_model",
    "designs.command.run",
    "designs.file.naming",
    "designs.signals.check_signals",
    # Checks of one argument, tried by what takes it.
    "designs.poles.as_pole_list",
    "designs.triangular.step_growth",
    "models.linear.as_covariance",
    "observers.contract.as_sample_rows",
    "observers.contract.check_state",
    "observers.contract.raises",
    "observers.delay_estimator.check_rate",
    "observers.extended_state_loop.read_pair",
    "observers.fixed_step.run_on_halves",
    "observers.row_derivatives.as_signal_rows",
    "observers.linear_filter.as_controls",
    "observers.linear_filter.check_belief",
    "observers.linear_filter.check_sample",
    "observers.linear_filter.sample_before",
    "observers.rigid_body_observer.whole_steps",
    "observers.run_plot.plot",
    "synthesis.extended_state.certificate.as_strip",
    "synthesis.normal_form.problem.check_stable",
    "synthesis.normal_form.problem.refuse_undetectable",
    "synthesis.normal_form.resonance.check_nonresonant",
    # What filters derive from.
    "observers.linear_filter.LinearFilter",
    # Steps of a design, on a problem that it states.
    "synthesis.extended_state.central_path.minimiser",
    "synthesis.extended_state.design.accepted",
    "synthesis.extended_state.design.optimised",
    "synthesis.extended_state.polishing.polished",
    "synthesis.extended_state.start.strictly_feasible",
    "synthesis.normal_form.gain.gain_at",
    "synthesis.normal_form.known_inputs.input_injection",
    "synthesis.ilo_error_system.solved",
}


@pytest.fixture(scope="module")
def worker() -> Iterator[Worker]:
    """One process for all classes: what is compiled or made once is made once."""
    shared = Worker()
    yield shared
    shared.close()


@pytest.mark.parametrize("name", CLASSES)
def test_odd_input_is_accepted_or_refused_in_a_sentence(worker: Worker, name: str) -> None:
    verdict, text = worker.judge(name, SEED, EXAMPLES)
    assert verdict.word == ACCEPTED, f"a valid example is {verdict}: {text}"
    tally = run(worker, name, SEED, range(CLASSES[name].cases))
    told = "\n".join(str(failure) for failure in distinct(tally.failures))
    assert not tally.failures, f"{dict(tally.counts)}\n{told}"
    # Changes that nothing notices, and those that break everything, test nothing.
    assert min(tally.counts[ACCEPTED], tally.counts[REFUSED]) > 0.02 * tally.counts.total()


def test_everything_that_promises_to_refuse_is_tried() -> None:
    tried = {name.partition(",")[0] for name in subjects()}
    missing = [
        name
        for name in promised()
        if name not in INNER
        and not any(each == name or each.startswith(f"{name}.") for each in tried)
    ]
    assert missing == []


def promised() -> Iterator[str]:
    """The public classes and functions whose description says that they raise `InputError`."""
    rooms = (reobserve.designs, reobserve.models, reobserve.observers)
    for package in (*rooms, reobserve.plants, reobserve.synthesis):
        for found in pkgutil.walk_packages(package.__path__, f"{package.__name__}."):
            module = importlib.import_module(found.name)
            for name, thing in vars(module).items():
                own = not name.startswith("_") and getattr(thing, "__module__", "") == found.name
                if own and promises(thing):
                    yield f"{found.name.removeprefix('reobserve.')}.{name}"


def promises(thing: Any) -> bool:
    """Whether a class or function says that it raises `InputError`; kernels say nothing."""
    if not inspect.isclass(thing) and not inspect.isfunction(thing):
        return False
    return not inspect.isabstract(thing) and "InputError" in (thing.__doc__ or "")


@pytest.mark.parametrize("name", ["yaml", "overrides", "samples", "expressions"])
def test_a_seed_and_a_number_make_the_same_case(name: str) -> None:
    texts = [[make(name, SEED, number).text for number in range(20)] for _ in range(2)]
    assert texts[0] == texts[1]
    assert len(set(texts[0])) > 10
