"""What a user of the extended observer relies on: streams, reports, and one sentence for errors."""

from __future__ import annotations

import json
import warnings
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from reobserve.cli import main
from reobserve.errors import DivergenceError, InputError
from reobserve.observers.extended_high_gain import (
    ExtendedHighGainObserver,
    State,
    SwitchedOffWarning,
)
from tests.observers.test_extended_high_gain import (
    FIRST_DELAY,
    Case,
    observed,
    observer,
    record,
    together,
)
from tests.plants.test_delayed_plants import PENDULUM

ROOT = Path(__file__).parents[2]


# ---- Streams


@pytest.mark.parametrize("switched", ["delay", "all"])
def test_stepping_and_running_in_pieces_give_the_bits_of_a_batch(switched: str) -> None:
    """With noise on y and u, held over two steps, and the dynamic S."""
    case, h = Case("sine", 5.0, 2, 0.7, switched, dynamic=True), 0.01
    (y, u), built = record("sine", h, 10.0), observer(case, h)
    noise = np.repeat(np.random.default_rng(1).normal(0, 0.05, (len(y) // 4 + 1, 2)), 4, axis=0)
    right, left = noise[: len(y)], np.vstack([noise[:1], noise])[: len(y)]
    pair = np.column_stack([y, u[:, 0]])
    (y, a), (y_before, b) = (pair + right).T, (pair + left).T
    rate = u[:, 1:]
    rows = (y, np.column_stack([a, rate]), y_before, np.column_stack([b, rate]))
    start = built.init([0.0, 0.0], FIRST_DELAY)
    whole = built.run(*rows[:2], start, *rows[2:])
    assert 0.05 < whole.switched_off.mean() < 0.4
    state, stepped = start, [[0.0, 0.0, FIRST_DELAY]]
    for k in range(len(whole.delay) - 1):
        three = [row[2 * k : 2 * k + 3] for row in rows]
        state, x, delay = built.step(state, *three)
        stepped.append([*x, delay])
    assert np.array_equal(stepped, together(whole))
    first = built.run(*(r[:801] for r in rows[:2]), start, *(r[:801] for r in rows[2:]))
    rest = built.run(*(r[800:] for r in rows[:2]), first.state, *(r[800:] for r in rows[2:]))
    assert np.array_equal(together(rest), together(whole)[400:])
    assert rest.state.count == state.count == whole.state.count
    # The limits from the left are read: without them the run is another one.
    assert not np.array_equal(built.run(*rows[:2], start).delay, whole.delay)


def test_a_run_leaves_its_arguments_as_they_were() -> None:
    y, u = (values.copy() for values in record("sine", 0.01, 1.0))
    kept, built = (y.copy(), u.copy()), observer(Case("sine", 5.0, 2), 0.01)
    start = built.init([0.1, 0.0], FIRST_DELAY)
    built.run(y, u, start)
    assert np.array_equal(y, kept[0])
    assert np.array_equal(u, kept[1])
    assert start.values.tolist() == [0.1, 0.0, FIRST_DELAY]


# ---- Reports


def test_a_step_beyond_the_method_diverges_and_says_when() -> None:
    """rho times the step is 8, far above 2.78: the record grows until numbers end."""
    case, step = Case("sine", 80.0, 2, 0.7), 0.1
    run = observed(case, step, 20.0)
    assert run.diverged_at is not None
    assert 0 < run.diverged_at < 20
    assert len(run.delay) == round(run.diverged_at / step) + 1 == len(run.switched_off) + 1
    assert np.isfinite(together(run)).all()
    assert run.state.count == 0, "the state that the run started from"
    (y, u), built = record("sine", step, 20.0), observer(case, step)
    last = 2 * (len(run.delay) - 1)
    before = built.run(y[: last + 1], u[: last + 1], built.init([0.0, 0.0], FIRST_DELAY))
    assert before.diverged_at is None
    with pytest.raises(DivergenceError, match=f"finite up to t = {run.diverged_at:g} s and not"):
        built.step(before.state, y[last : last + 3], u[last : last + 3])


@pytest.mark.parametrize("switched", ["delay", "all"])
def test_a_threshold_that_is_never_passed_warns_with_the_share(switched: str) -> None:
    """|xi| of the pendulum is 4 at most, and 2 tau / 5 more for m = 2."""
    sentence = r"^threshold: 5 is above \|xi\^\| for 100 % of the record, so the delay was never "
    with pytest.warns(SwitchedOffWarning, match=sentence):
        run = observed(Case("sine", 2.5, 2, 5.0, switched), 0.01, 10.0)
    assert np.array_equal(run.switched_off, np.ones(1000))
    assert np.array_equal(run.delay, np.full(1001, FIRST_DELAY))
    with warnings.catch_warnings():
        warnings.simplefilter("error", SwitchedOffWarning)
        some = observed(Case("sine", 2.5, 2, 3.9, switched), 0.01, 10.0)
    assert 0.5 < some.switched_off.mean() < 1


# ---- One sentence

GOOD: dict[str, Any] = {
    "model": PENDULUM.model, "step_size": 0.01, "rho": 5.0, "order": 2, "delay_bounds": (0.0, 1.5),
}  # fmt: skip
SKEW = [[1, 2, 0], [0, 1, 0], [0, 0, 1]]
BAD_OBSERVERS: list[Any] = [
    ({"rho": 0}, "rho: 0 must be greater than zero"),
    ({"rho": -1}, "rho: -1 must be greater than zero"),
    ({"rho": np.nan}, "rho: nan has an entry that is not finite"),
    ({"rho": "5"}, "rho: '5' is not a number"),
    ({"rho": 1e200}, "rho: 1e+200 1/s must keep S and the gains inside the float range"),
    ({"step_size": 0}, "step_size: 0 must be greater than zero"),
    ({"order": 0}, "order: 0 must be a whole number, 1 or more: order 0 holds no delay"),
    ({"order": 2.5}, "order: 2.5 must be a whole number"),
    ({"order": "2"}, "order: '2' must be a whole number"),
    ({"order": True}, "order: True must be a whole number"),
    ({"delay_bounds": (1, 1)}, "delay_bounds: [1, 1] s must be 0 or more, rising"),
    ({"delay_bounds": (1.5, 0)}, "delay_bounds: [1.5, 0] s must be 0 or more, rising"),
    ({"delay_bounds": (-0.1, 1)}, "delay_bounds: [-0.1, 1] s must be 0 or more, rising"),
    ({"delay_bounds": (1,)}, "delay_bounds: has shape (1,), must be a list of 2 numbers"),
    ({"delay_bounds": (0, np.inf)}, "delay_bounds: [0.0, inf] has an entry that is not finite"),
    ({"threshold": -0.1}, "threshold: -0.1 must not be negative"),
    ({"threshold": np.nan}, "threshold: nan has an entry that is not finite"),
    ({"switched": "gain"}, "switched: 'gain' must be one of delay, all"),
    ({"switched": None}, "switched: None must be one of delay, all"),
    ({"initial_matrix": -1.0}, "initial_matrix: must be positive definite, its eigenvalues are"),
    ({"initial_matrix": [1, 1]}, "initial_matrix: has shape (2,), must be one number"),
    ({"initial_matrix": SKEW}, "initial_matrix: [[1.0, 2.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1"),
    ({"initial_matrix": "algebraic"}, "initial_matrix: 'algebraic' is not a number"),
]


def refused(call: Any, sentence: str) -> None:
    with pytest.raises(InputError) as caught:
        call()
    said = str(caught.value)
    assert said.startswith(sentence)
    assert "\n" not in said
    assert ". " not in said, "more than one sentence"


@pytest.mark.parametrize(("change", "sentence"), BAD_OBSERVERS)
def test_observers(change: dict[str, Any], sentence: str) -> None:
    refused(lambda: ExtendedHighGainObserver(**{**GOOD, **change}), sentence)


@pytest.mark.parametrize(
    ("estimate", "delay", "sentence"),
    [
        ([0, 0], 1.6, "initial_delay: 1.6 s must be inside its bounds, [0, 1.5] s"),
        ([0, 0], -0.1, "initial_delay: -0.1 s must be inside its bounds, [0, 1.5] s"),
        ([0, 0], np.nan, "initial_delay: nan has an entry that is not finite"),
        ([0, 0], [0.3], "initial_delay: [0.3] must be one number"),
        ([0, 0, 0], 0.3, "initial_estimate: has shape (3,), must be a list of 2 numbers"),
        ([0, np.inf], 0.3, "initial_estimate: [0.0, inf] has an entry that is not finite"),
        ("ab", 0.3, "initial_estimate: 'ab' is not a number"),
    ],
)
def test_starts(estimate: Any, delay: Any, sentence: str) -> None:
    refused(lambda: ExtendedHighGainObserver(**GOOD).init(estimate, delay), sentence)


Y, U = np.zeros(5), np.ones((5, 3))
HOLED = np.where(np.arange(5) == 2, np.nan, 0.0)
DERIVATIVES = "must have 3 columns: u and its derivatives up to the order 2"
ROWS = "must have an odd number of rows, 3 or more, of 3 numbers"
BAD_RECORDS: list[Any] = [
    ((Y, U[:, :1]), f"inputs: has shape (5, 1), {DERIVATIVES}"),
    ((Y, U[:, :2]), f"inputs: has shape (5, 2), {DERIVATIVES}"),
    ((Y, np.ones((5, 4))), f"inputs: has shape (5, 4), {DERIVATIVES}"),
    ((Y, Y), f"inputs: has shape (5,), {DERIVATIVES}"),
    ((Y, [[1, 2, 3], [1, 2], [1]]), f"inputs: has shape (3,), {DERIVATIVES}"),
    ((Y[:4], U[:4]), f"inputs: has shape (4, 3), {ROWS}"),
    ((Y[:1], U[:1]), f"inputs: has shape (1, 3), {ROWS}"),
    ((Y, U + HOLED[:, None]), "inputs: sample 2 is [nan, nan, nan], must be finite"),
    ((Y, [["a"] * 3] * 5), "inputs: is no array of numbers"),
    ((Y[:3], U), "output: has 3 rows, must have 5 like u"),
    ((HOLED, U), "output: sample 2 is nan, must be finite"),
    ((list("abcde"), U), "output: is no array of numbers"),
    (([[1], [1, 2], [1], [1], [1]], U), "output: is no array of numbers"),
    ((Y, U, Y[:3]), "output_before: has 3 rows, must have 5 like u"),
    ((Y, U, HOLED), "output_before: sample 2 is nan, must be finite"),
    ((Y, U, Y, U[:, :2]), f"inputs_before: has shape (5, 2), {DERIVATIVES}"),
    ((Y, U, None, U[:3]), "inputs_before: has 3 rows, must have 5"),
]


@pytest.mark.parametrize(("rows", "sentence"), BAD_RECORDS)
def test_records(rows: tuple[Any, ...], sentence: str) -> None:
    built = ExtendedHighGainObserver(**GOOD)
    start = built.init([0, 0], FIRST_DELAY)
    refused(lambda: built.run(rows[0], rows[1], start, *rows[2:]), sentence)
    refused(lambda: built.step(start, *rows), sentence)


def test_states_of_another_observer() -> None:
    built = ExtendedHighGainObserver(**GOOD)
    refused(lambda: built.run(Y, U, State(np.zeros(2))), "state: must be of an observer of 2 stat")


# ---- Through the command line


def delay_of(*pieces: dict[str, Any]) -> dict[str, Any]:
    return {"plant": {"delay": [{"kind": "constant", "axis": 1, **piece} for piece in pieces]}}


def changed(name: str, **entries: Any) -> dict[str, Any]:
    return {"observers": {name: entries}}


LATE = [{"from": 0, "until": 20.001, "size": 0.6}, {"from": 20.001, "size": 0.3}]
BAD_CONFIG: list[Any] = [
    (delay_of({"size": 1.6}), "plant.delay: is 1.6 s at t = 0 s, must be from 0 to 1.5 s"),
    (delay_of({"size": -0.1}), "plant.delay: is -0.1 s at t = 0 s, must be from 0 to 1.5 s"),
    (delay_of(*LATE), "plant.delay: jumps at 20.001 s, must jump at a multiple of 0.0025 s"),
    (
        {"plant": {"delay_bounds": [1.5, 0]}},
        "plant.delay_bounds: [1.5, 0] must be 0 or more",
    ),
    ({"plant": {"noise_period": 1e-3}}, "plant.noise_period: 0.001 s must be a multiple of 0.005"),
    ({"plant": {"noise_period": 0}}, "plant.noise_period: 0 must be greater than zero"),
    ({"plant": {"horizon": 120.001}}, "plant.horizon: 120.001 s must be a whole multiple of the"),
    ({"plant": {"horizon": 1e9}}, "plant.horizon: 1e+09 s is 4e+11 steps, must be 5e+06 at most"),
    ({"plant": {"step": 0.0031}}, "plant.horizon: 120 s must be a whole multiple of the step"),
    (
        {"plant": {"length": 0}},
        "plant.length: 0 must be greater than zero",
    ),
    ({"scenarios": {"sine": {"model": "penduum"}}}, "scenarios.sine.model: 'penduum' must be one"),
    ({"scenarios": {"sine": {"output_noise": -1}}}, "scenarios.sine.output_noise: -1 must not be"),
    ({"observrs": {}}, "observrs: unknown key; did you mean 'observers'?"),
    (changed("order2", model="penduum"), "observers.order2.model: 'penduum' must be one of pend"),
    (changed("order2", step_size=0.003), "observers.order2.step_size: 0.0015 s must be a whole"),
    (changed("order2", rho=0), "observers.order2.rho: 0 must be greater than zero"),
    (changed("order2", order=0), "observers.order2.order: 0 must be from 1 to 2"),
    (
        changed("order2", order=3),
        "observers.order2.order: 3 must be from 1 to 2",
    ),
    (
        changed("order2_noise", order=3),
        "observers.order2_noise.order: 3 must be from 1 to 2",
    ),
    (
        changed("order2", derivatives="exat"),
        "observers.order2.derivatives: 'exat' must be one of",
    ),
    (changed("order2", initial_delay=2), "observers.order2.initial_delay: 2 s must be inside its"),
    (changed("order2", threshold=-1), "observers.order2.threshold: -1 must not be negative"),
    (changed("order2", switched="gain"), "observers.order2.switched: 'gain' must be one of delay"),
    (changed("order2", initial_matrix=-1.0), "observers.order2.initial_matrix: must be positive"),
    (changed("order2_noise", L=0), "observers.order2_noise.L: 0 must be greater than zero"),
    (changed("order2_noise", lambdas=[3]), "observers.order2_noise.lambdas: has shape (1,), must"),
    (changed("own", like="order2", derivatives="levant"), "observers.own.L: is missing; der"),
    (changed("standard", mean_delay=1.6), "observers.standard.mean_delay: 1.6 s must be above 0"),
]


@pytest.mark.parametrize(("overrides", "sentence"), BAD_CONFIG)
def test_the_ledger(
    overrides: dict[str, Any], sentence: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    target = tmp_path / "ledger.json"
    arguments = ["ledger", "delay", "--project", str(ROOT), "--overrides", json.dumps(overrides)]
    assert main([*arguments, "--output", str(target)]) == 1
    captured = capsys.readouterr()
    assert captured.err.count("\n") == 1, captured.err
    assert captured.err.startswith(f"reobserve: delay.{sentence}")
    assert not target.exists()
