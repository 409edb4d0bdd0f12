"""Random faults have the stated classes, sizes, onsets and frequencies, on the stated channels."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from reobserve.core.errors import InputError
from reobserve.tuning.task import Array, Estimates, TaskRecord
from reobserve_papers.bench.faults import (
    CLASSES,
    FaultyPlant,
    HealthyRecord,
    random_faults,
    score,
)
from reobserve_papers.signals.inputs import Signal

STEP = 0.005  # [s]
ABOUT: Any = {"onset": (1.0, 4.0), "size": (0.5, 2.0), "frequency": (0.5, 8.0), "horizon": 10.0}
TIME = np.arange(0.0, 10.001, 0.005)


def plant_of(channels: int, **stated: Any) -> FaultyPlant:
    kind: Any = type("Plant", (FaultyPlant,), {"channels": channels})
    made: FaultyPlant = kind(**{"faults": CLASSES, **ABOUT, **stated})
    return made


def faults(
    seed: int, classes: Any, channels: int = 1, faulty: tuple[int, int] | None = None
) -> list[dict[str, Any]]:
    draw, of = np.random.default_rng(seed), faulty or (channels, channels)
    return random_faults(draw, plant_of(channels, faults=classes, faulty=of), STEP)


def drawn(seed: int, kind: str) -> Array:
    return Signal.parse("fault", faults(seed, [kind]), 1)(TIME)[:, 0]


@pytest.mark.parametrize("seed", range(1, 4))
def test_classes_share_onset_and_size_and_have_their_shapes(seed: int) -> None:
    step, sine, ramp, square = (drawn(seed, kind) for kind in CLASSES)
    begin, size = faults(seed, ["step"])[0]["from"], step[-1]
    later = TIME - begin
    rate = faults(seed, ["sine"])[0]["frequency"]
    on = later >= 0
    assert step == pytest.approx(size * on)
    assert sine == pytest.approx(size * np.sin(rate * later) * on, abs=1e-12)
    assert ramp == pytest.approx(size * later / (10.0 - begin) * on, abs=1e-12)
    half = STEP * round(np.pi / rate / STEP)
    phase = np.mod(later / (2 * half), 1.0)
    inside = on & (np.abs(phase - 0.5) > 0.01) & (np.abs(phase - 0.5) < 0.49)
    assert square[inside] == pytest.approx(size * np.where(phase < 0.5, 1.0, -1.0)[inside])
    assert not square[~on].any()


def test_draws_are_uniform_between_the_stated_ends() -> None:
    found = [faults(seed, ["sine"])[0] for seed in range(400)]
    sizes = np.array([one["amplitude"] for one in found])
    onsets, rates = (np.array([one[key] for one in found]) for key in ("from", "frequency"))
    scales = (onsets, 1.0, 4.0), (np.abs(sizes), 0.5, 2.0), (np.log2(rates), -1.0, 3.0)
    for values, low, high in scales:
        shares = (values - low) / (high - low)
        assert 0.0 <= shares.min() < 0.02
        assert 0.98 < shares.max() <= 1.0
        assert shares.mean() == pytest.approx(0.5, abs=0.05)
    assert np.mean(sizes > 0) == pytest.approx(0.5, abs=0.08)


def test_channels_have_different_classes_as_far_as_there_are_some() -> None:
    kinds = {"constant", "sine", "ramp", "square"}
    firsts = set()
    for seed in range(40):
        found = faults(seed, CLASSES, channels=5)
        assert sorted(one["axis"] for one in found) == [1, 2, 3, 4, 5]
        assert {one["kind"] for one in found[:4]} == kinds
        assert found[4]["kind"] == found[0]["kind"]
        firsts.add(found[0]["kind"])
    assert firsts == kinds


def test_jumps_are_on_the_grid() -> None:
    for seed in range(20):
        Signal.parse("fault", faults(seed, CLASSES, channels=4), 4).check_jumps("fault", STEP, 10.0)
    wrong = [{"kind": "constant", "axis": 1, "from": 0.0026, "size": 1.0}]
    with pytest.raises(InputError, match=r"fault: jumps at 0\.0026 s"):
        Signal.parse("fault", wrong, 1).check_jumps("fault", STEP, 10.0)


def test_each_number_of_faulty_channels_is_as_likely_on_any_of_them() -> None:
    found = [faults(seed, CLASSES, 3, (1, 3)) for seed in range(600)]
    counts = np.bincount([len(one) for one in found])
    assert counts[0] == 0
    assert counts[1:] == pytest.approx(200, abs=40)
    alone = np.bincount([one[0]["axis"] for one in found if len(one) == 1])
    assert alone[1:] == pytest.approx(counts[1] / 3, abs=30)
    # As many random numbers are drawn: the faults of the first channels are the same.
    for seed in range(10):
        whole, some = (faults(seed, CLASSES, 3, of) for of in ((3, 3), (2, 2)))
        assert whole[:2] == some


def test_healthy_channels_are_scored_in_units_of_the_faults_of_the_others() -> None:
    time, rng = 0.1 * np.arange(200), np.random.default_rng(1)
    truth = np.column_stack([np.zeros(200), np.full(200, 2.0), np.full(200, -2.0)])
    empty = np.zeros((200, 0))
    wrong = rng.standard_normal((200, 3))
    record = HealthyRecord(time, empty, empty, truth)
    found = score(lambda one: one.truth + wrong, record, 0.0)
    assert found.error == pytest.approx(np.sqrt((wrong[:, 0] ** 2).mean()) / 2.0)
    assert np.isnan(found.lag)
    for P in (np.full((200, 3), 4.0), np.tile(np.diag([4.0, 1.0, 1.0]), (200, 1, 1))):
        covered = score(lambda one, P=P: Estimates(one.truth + wrong, P), record, 0.0)  # type: ignore[misc]
        assert covered.nees == pytest.approx((wrong[:, 0] ** 2).mean() / 4.0)
    plain = TaskRecord(time, empty, empty, truth)
    assert score(lambda one: 0.0 * one.truth, plain, 0.0).error == pytest.approx(1.0)


def test_numbers_of_faulty_channels_that_there_are_not_are_refused() -> None:
    plant_of(3, faulty=(1, 3))
    plant_of(3, faulty=(1, 2), scored="healthy")
    for faulty, scored in (((0, 1), "all"), ((2, 1), "all"), ((1, 4), "all"), ((1, 3), "healthy")):
        with pytest.raises(InputError, match=r"faulty: .* must be two numbers from 1 to"):
            plant_of(3, faulty=faulty, scored=scored)
