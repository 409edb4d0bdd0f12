"""Each cell of the table of abilities: tried on a record, or refused in a sentence."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from docs.generate.abilities import ABILITIES, REASONS, families, observers, reason
from reobserve import IMM, FaultBank, LinearModel, rts_smoother
from reobserve.core.documents import parse_yaml
from reobserve.core.errors import InputError
from reobserve.estimation.families import FAMILIES, family
from reobserve.estimation.families.observer_section import DesignFile, as_observer
from reobserve.estimation.families.program import program_of
from reobserve.estimation.observer_design import Design
from tests.reobserve.codegen.cases import CASES as EXPORTED
from tests.reobserve.observers.by_row import differing, remembered
from tests.reobserve.observers.case import Case
from tests.reobserve.observers.cases import CASES

Array = NDArray[np.float64]
Try = Callable[[Case], Any]

ROWS = 30
TIMES = np.arange(ROWS) + (np.arange(ROWS) > 5)  # in sampling periods
KEEP = ["predicted_state", "predicted_covariance", "gain"]


@cache
def cases() -> Mapping[str, Case]:
    """The first rows of a record for each public observer."""
    found: dict[str, Case] = {}
    for make in CASES.values():
        case = make()
        name = type(case.observer).__name__
        if name in observers() and name not in found:
            u = None if case.u is None else case.u[:ROWS].reshape(ROWS, -1)
            found[name] = replace(case, y=case.y[:ROWS].reshape(ROWS, -1), u=u)
    return found


def run(case: Case, **given: Any) -> Any:
    whole = {"y": case.y, "u": case.u, "start": case.state, **given}
    return case.observer.run(**whole)


def changed(observer: Any, **parts: Any) -> Any:
    """The same filter on another model; a bank, all its filters."""
    if isinstance(observer, IMM) and not isinstance(observer, FaultBank):
        return replace(observer, filters=[changed(one, **parts) for one in observer.filters])
    return replace(observer, model=replace(observer.model, **parts))


def model_of(observer: Any) -> Any:
    banked = isinstance(observer, IMM) and not isinstance(observer, FaultBank)
    return (observer.filters[0] if banked else observer).model


def equals_other_model(case: Case, **parts: Any) -> None:
    """To give matrices for each row is to have another model."""
    rows = {
        name: value
        if isinstance(value, dict)
        else np.broadcast_to(np.atleast_2d(value), (ROWS, *np.atleast_2d(value).shape))
        for name, value in parts.items()
    }
    found, wanted = run(case, **rows), run(replace(case, observer=changed(case.observer, **parts)))
    for name in wanted:
        np.testing.assert_allclose(found[name], wanted[name], rtol=1e-9, atol=1e-12)
    assert differing(found.estimates, run(case).estimates)


def try_nan(case: Case) -> None:
    """Rows before it know nothing of it, over it the estimate is predicted."""
    y = case.y.copy()
    y[10], y[20, 0] = np.nan, np.nan
    found, whole = run(case, y=y), run(case)
    assert found.missing == 2
    assert np.array_equal(found["state"][:10], whole["state"][:10])
    assert found["log_likelihood"][10] == 0.0
    assert np.isnan(found["innovation"][10]).all()
    assert np.isfinite(found["state"]).all()
    if not isinstance(case.observer, IMM):
        kept = run(case, y=y, keep=KEEP)
        n = found["state"].shape[1]
        assert np.array_equal(kept["predicted_state"][10, :n], found["state"][10])


def try_noise(case: Case) -> None:
    """The same as a model with it."""
    model = model_of(case.observer)
    equals_other_model(case, Q=4.0 * model.Q, R=9.0 * model.R)


def try_model(case: Case) -> None:
    """The same as another model."""
    model = model_of(case.observer)
    if "A" in case.observer.takes:
        equals_other_model(case, A=0.98 * model.A)
    else:
        equals_other_model(case, parameters={**model.parameters, "length": 0.6})


def try_uneven(case: Case) -> None:
    """Rows that are left out are rows of nan."""
    observer, kept = continuous(case.observer), np.delete(np.arange(ROWS), [3, 4, 9, 17])
    time = observer.sampling_period * np.arange(ROWS)
    u = None if case.u is None else np.repeat(case.u[:1], ROWS, axis=0)  # held over gaps
    y = np.full_like(case.y, np.nan)
    y[kept] = case.y[kept]
    whole = replace(case, observer=observer, u=u)
    wanted = run(whole, y=y)
    found = run(whole, y=y[kept], u=None if u is None else u[kept], time=time[kept])
    for name in ("state", "covariance", "log_likelihood"):
        np.testing.assert_allclose(found[name], wanted[name][kept], rtol=1e-6, atol=1e-9)


def continuous(observer: Any) -> Any:
    """The same filter on a model of an equation whose noise has a density."""
    if isinstance(observer, IMM):  # its chain is that from row to row, whatever is between them
        filters = [continuous(one) for one in observer.filters]
        return replace(observer, filters=filters, transition=np.eye(len(filters)))
    model = observer.model
    if isinstance(model, LinearModel):
        T = model.sampling_period
        model = LinearModel.from_ode(
            (model.A - np.eye(model.states)) / T, model.B / T, model.C, model.D, R=model.R,
            density=model.Q / T, sampling_period=T,
        )  # fmt: skip
    else:
        model = replace(model, density=model.Q / model.sampling_period)
    return replace(observer, model=model)


def try_smoother(case: Case) -> None:
    """The last row is the run's; others are no less certain than it."""
    keep = [name for name in getattr(case.observer, "keeps", ()) if name not in KEEP]
    found = run(case, keep=keep) if keep else run(case)
    smooth = rts_smoother(found)
    assert np.array_equal(smooth["state"][-1], found["state"][-1])
    assert (smooth["variance"] <= found["variance"] * (1 + 1e-9)).all()
    assert not np.array_equal(smooth["state"], found["state"])


def try_covariance(case: Case) -> None:
    """A covariance, with the variance on its diagonal."""
    found = run(case)
    P = found["covariance"]
    assert np.array_equal(P.diagonal(axis1=1, axis2=2), found["variance"])
    assert np.array_equal(P, P.transpose(0, 2, 1))
    assert (np.linalg.eigvalsh(P) >= -1e-12).all()


def try_predicted(case: Case) -> None:
    """The gain times the innovation leads from it to the estimate."""
    found = run(case, keep=KEEP)
    moved = (found["gain"] @ found["innovation"][:, :, None])[:, :, 0]
    n = found["state"].shape[1]
    whole = (found["predicted_state"] + moved)[:, :n]
    np.testing.assert_allclose(found["state"], whole, rtol=1e-9, atol=1e-12)
    assert not differing({name: found[name] for name in run(case)}, run(case).estimates)


def try_gain(case: Case) -> None:
    """For any gain P+ = P - K C P - P C' K' + K S K', and here C P = cov(e, x) is not kept.

    Its size is tested here, what it does with the predicted state; and that it is kept alone.
    """
    found, whole = run(case, keep="gain"), run(case, keep=KEEP)
    assert found["gain"].shape[-1] == case.observer.measurements
    assert np.array_equal(found["gain"], whole["gain"])
    assert "predicted_state" not in found


def try_names(case: Case) -> None:
    """A component by its name."""
    n = model_of(case.observer).states
    names = [f"signal_{chr(ord('a') + i)}" for i in range(n)]
    if model_of(case.observer).state_names is None:
        observer = changed(case.observer, state_names=names)
    else:  # text has its own
        observer, names = case.observer, list(model_of(case.observer).state_names)
    found = run(replace(case, observer=observer))
    for i, name in enumerate(names):
        assert np.array_equal(found[f"state_{name}"], found["state"][:, i])
        assert f"state_{name}" in found.to_pandas()


def try_bank(case: Case) -> None:
    """A bank of twice the same filter is that filter."""
    bank = IMM([case.observer, case.observer], [[0.9, 0.1], [0.2, 0.8]])
    posterior = case.state.posterior
    start = bank.init(posterior.mean, posterior.covariance)
    found, alone = bank.run(case.y, case.u, start=start), run(case)
    n = alone["state"].shape[1]
    np.testing.assert_allclose(found["state"][:, :n], alone["state"], rtol=1e-7, atol=1e-10)
    np.testing.assert_allclose(
        found["log_likelihood"], alone["log_likelihood"], rtol=1e-7, atol=1e-9
    )


def try_batch(case: Case) -> None:
    """The bits of each record alone."""
    scales = (1.0, 0.5)
    y = np.array([scale * case.y for scale in scales])
    u = None if case.u is None else np.array([scale * case.u for scale in scales])
    found = run(case, y=y, u=u)
    for r in range(2):
        alone = run(case, y=y[r], u=None if u is None else u[r])
        assert not differing(found.record(r).estimates, alone.estimates)
        assert not differing(remembered(found.end[r]), remembered(alone.end))
        assert found.record(r).missing == alone.missing


@cache
def designs() -> tuple[Design, ...]:
    """What the examples of all families make."""
    found = []
    for name in FAMILIES:
        for example in family(name).records.values():
            tree: Any = parse_yaml(example.observer + example.gains, "record.yaml")
            one = as_observer(tree["observer"], 0.01)
            assert not isinstance(one, DesignFile)
            found.append(one.design(0.01))
    return tuple(found)


def try_specification(case: Case) -> None:
    """An example makes it; `estimate` is compared with calls of the library elsewhere."""
    if not any(type(one.observer) is type(case.observer) for one in designs()):
        raise InputError("kind", f"no example makes {type(case.observer).__name__}")


def try_C(case: Case) -> None:
    """It becomes a program; its C is compared with the library elsewhere, for each observer."""
    kind = type(case.observer)
    mine = [one for one in designs() if type(one.observer) is kind]
    if not mine:
        program_of(case.observer, case.state)
    for one in mine:
        program = program_of(one.observer, one.start(), (len(one.measurements), len(one.inputs)))
        assert program.measurements == len(one.measurements)
    assert kind in exported()


@cache
def exported() -> set[type]:
    """The observers whose C is compared with them: cases, and examples of all families."""
    made = {type(make()[0]) for make in EXPORTED.values()}
    return made | {type(one.observer) for one in designs()}


# How to try an ability, and how who lacks it says so.
TRIES: dict[str, tuple[Try, str]] = {
    "nan": (try_nan, r"y: sample 0 is .*, must be finite"),
    "noise": (try_noise, r"[QR]: is not taken by \w+"),
    "model": (try_model, r"(A|parameters): is not taken by \w+"),
    "uneven": (try_uneven, r"time: goes from .* must go on by the sampling period"),
    "smoother": (try_smoother, r"run: .* must be one of a Kalman filter, extended or unscented"),
    "covariance": (try_covariance, r"estimate: there is no 'covariance'"),
    "predicted": (try_predicted, r"keep: is not taken by \w+"),
    "gain": (try_gain, r"keep: is not taken by \w+"),
    "names": (try_names, r"estimate: there is no 'state_signal'"),
    "bank": (try_bank, r"filters\[0\]: .* must have a model, predict and correct"),
    "batch": (try_batch, "never"),
    "specification": (try_specification, r"kind: no example makes \w+"),
    "C": (try_C, r"observer: a \w+ cannot be exported; .* can"),
}

# What is asked of an observer that has no model to make the same from.
ASKED: dict[str, Try] = {
    "nan": lambda case: run(case, y=np.full_like(case.y, np.nan)),
    "noise": lambda case: run(case, Q=1.0, R=1.0),
    "model": lambda case: run(case, A=1.0, parameters={}),
    "uneven": lambda case: run(case, time=TIMES * case.observer.sampling_period),
    "names": lambda case: run(case)["state_signal"],
    "bank": lambda case: IMM([case.observer], [[1.0]]),
}


def test_every_public_observer_has_a_record() -> None:
    assert list(ABILITIES) == list(TRIES)
    assert set(cases()) == set(observers())


@pytest.mark.nightly_cases("AdaptiveObserver-C")
@pytest.mark.parametrize("ability", ABILITIES)
@pytest.mark.parametrize("name", observers())
def test_cell(name: str, ability: str) -> None:
    """What the table says is so."""
    case, (attempt, refusal) = cases()[name], TRIES[ability]
    if ABILITIES[ability].known(type(case.observer)):
        attempt(case)
        return
    by_python = "got an unexpected keyword argument"
    with pytest.raises((InputError, TypeError), match=f"^{refusal}|{by_python}"):
        ASKED.get(ability, attempt)(case)


@pytest.mark.parametrize("ability", REASONS)
def test_reasons_are_those_of_empty_cells(ability: str) -> None:
    empty = [kind for kind in observers().values() if not ABILITIES[ability].known(kind)]
    given = {reason(ability, kind) for kind in empty}
    for text in given:
        assert re.match(r"[A-Z].*\.$", text)
    if ability not in ("specification", "C"):  # which all observers may have
        assert given == {*REASONS[ability].values()}


def test_kinds_of_an_observer_are_those_that_make_it() -> None:
    for name, kind in observers().items():
        made = {one for one in FAMILIES if any(
            type(design) is family(one) and type(design.observer) is kind for design in designs()
        )}  # fmt: skip
        assert made <= set(families(kind)), name
