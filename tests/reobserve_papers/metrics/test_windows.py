"""Windows over which errors are scored: what holds no sample is refused by its key."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from reobserve.core.errors import InputError
from reobserve_papers import replicate
from reobserve_papers.metrics.responses import check_windows, scored, window
from reobserve_papers.parameters.parameter_checks import check_parameters
from reobserve_papers.parameters.parameters import Parameters
from tests import ROOT

AFTER, SHORT = "must start before the end at", "must hold"
EMPTY = [
    ("delay", "start", 121.0, AFTER),
    ("delay", "late", 1e-4, SHORT),
    ("delay", "ripple", 0.01, "must hold three samples"),
    ("delay", "varying_from", 110.0, None),
    ("delay", "varying_from", 130.0, AFTER),
    ("delay", "varying_until", 60.0, SHORT),
    ("delay", "radius", [200.0, 300.0], AFTER),
    ("delay", "radius", [80.0001, 80.0002], SHORT),
    ("eso", "actuator_varying", [20.0, 30.0], AFTER),
    ("eso", "sensor_constant", [12.0, 12.0009], "must hold two samples"),
    ("ilo", "settling_skip", 10.0, AFTER),
    ("ilo", "late_window", 1e-5, SHORT),
    ("imm", "before", [10.0, 11.0], AFTER),
    ("imm", "after", [7.0001, 7.0002], SHORT),
    ("imm", "overshoot", [7.0, 7.001], None),
    ("lie", "decay_window", [20.0, 21.0], AFTER),
    ("lie", "decay_window", [5.0, 5.001], "must hold two samples"),
]


@pytest.mark.parametrize(("paper", "key", "value", "said"), EMPTY)
def test_check_refuses_a_window_without_samples(
    paper: str, key: str, value: Any, said: str | None
) -> None:
    parameters = Parameters.load(ROOT, paper, {"metrics": {key: value}})
    if said is None:
        check_parameters(parameters)
        return
    with pytest.raises(InputError) as caught:
        check_parameters(parameters)
    changed = "varying_from" if key == "varying_until" else key  # where the window begins
    assert caught.value.parameter == f"{paper}.metrics.{changed}"
    assert said in caught.value.problem


def test_figure_is_refused_if_a_window_of_its_metrics_holds_no_sample() -> None:
    with pytest.raises(InputError, match=r"^ilo\.metrics\.settling_skip: 9 s after each onset"):
        replicate("ilo", "fig1", {"metrics": {"settling_skip": 9.0}})
    with pytest.raises(InputError, match=r"^lie\.metrics\.decay_window: starts at 1e\+08 s, must"):
        replicate("lie", "fig1", {"metrics": {"decay_window": [1e8, 1e9]}})


@pytest.mark.parametrize("closed", ["left", "right"])
def test_window_is_refused_as_its_samples_are_counted(closed: Any) -> None:
    time = np.arange(11) * 0.1
    for start, end in np.random.default_rng(0).integers(-3, 14, (200, 2)) * 0.1:
        held = np.count_nonzero(window(time, start, end, closed=closed))
        for least in (1, 2, 3):
            try:
                check_windows({"a": (start, end)}, 1.0, 0.1, least=least, closed=closed)
                accepted = True
            except InputError:
                accepted = False
            assert accepted == (held >= least), (start, end)
        if held:
            assert scored("a", time, start, end, closed=closed).sum() == held
        else:
            with pytest.raises(InputError, match=r"^a: "):
                scored("a", time, start, end, closed=closed)
