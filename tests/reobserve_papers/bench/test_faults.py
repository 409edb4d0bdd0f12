"""Random faults have the stated classes, sizes, onsets and frequencies."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from reobserve.tuning.task import Array
from reobserve_papers.bench.faults import CLASSES, random_faults
from reobserve_papers.signals.inputs import Signal

ABOUT: Any = {"onset": (1.0, 4.0), "size": (0.5, 2.0), "frequency": (0.5, 8.0)}
TIME = np.arange(0.0, 10.001, 0.005)


def faults(seed: int, classes: Any, axes: int = 1) -> list[dict[str, Any]]:
    return random_faults(np.random.default_rng(seed), classes, axes, 10.0, **ABOUT)


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
    phase = np.mod(rate * later / (2 * np.pi), 1.0)
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


def test_axes_have_different_classes_as_far_as_there_are_some() -> None:
    kinds = {"constant", "sine", "ramp", "square"}
    firsts = set()
    for seed in range(40):
        found = faults(seed, CLASSES, axes=5)
        assert [one["axis"] for one in found] == [1, 2, 3, 4, 5]
        assert {one["kind"] for one in found[:4]} == kinds
        assert found[4]["kind"] == found[0]["kind"]
        firsts.add(found[0]["kind"])
    assert firsts == kinds
