"""Invalid parameters are refused by the command line in one sentence."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from reobserve_papers.cli.main import main
from tests import ROOT


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
    ({"plant": {"noise_period": 7e-3}}, "plant.noise_period: 0.007 s must be a multiple of 0.005"),
    ({"plant": {"noise_period": 0}}, "plant.noise_period: 0 must be greater than zero"),
    ({"plant": {"horizon": 120.001}}, "plant.horizon: 120.001 s must be a whole multiple of the"),
    ({"plant": {"horizon": 1e9}}, "plant.horizon: 1e+09 s is 4e+11 steps, must be 5e+06 at most"),
    ({"plant": {"step": 0.0031}}, "plant.horizon: 120 s must be a whole multiple of the step"),
    (
        {"plant": {"length": 0}},
        "plant.length: 0 must be greater than zero",
    ),
    ({"scenarios": {"sine": {"model": "penduum"}}}, "scenarios.sine.model: 'penduum' must be one"),
    (
        {"scenarios": {"sine": {"noise_share": -1}}},
        "scenarios.sine.noise_share: -1 must not be",
    ),
    ({"observrs": {}}, "observrs: unknown key; did you mean 'observers'?"),
    (changed("order2", model="penduum"), "observers.order2.model: 'penduum' must be one of pend"),
    (
        changed("order2", sampling_period=0.003),
        "observers.order2.sampling_period: 0.0015 s must",
    ),
    (changed("order2", rho=0), "observers.order2.rho: 0 must be greater than zero"),
    (changed("order2", order=0), "observers.order2.order: 0 must be 1 or more"),
    (
        changed("order2", order=3),
        "observers.order2.order: 3 must be 2 or less",
    ),
    (
        changed("order2_noise", order=3),
        "observers.order2_noise.order: 3 must be 2 or less",
    ),
    (
        changed("order2", derivatives="exat"),
        "observers.order2.derivatives: 'exat' must be one of",
    ),
    (changed("order2", initial_delay=2), "observers.order2.initial_delay: 2 s must be from 0 to"),
    (changed("order2", threshold=-1), "observers.order2.threshold: -1 must not be negative"),
    (changed("order2", switched="gain"), "observers.order2.switched: 'gain' must be one of delay"),
    (changed("order2", initial_matrix=-1.0), "observers.order2.initial_matrix: must be positive"),
    (changed("order2_noise", L=0), "observers.order2_noise.L: 0 must be greater than zero"),
    (changed("order2_noise", lambdas=[3]), "observers.order2_noise.lambdas: has shape (1,), must"),
    (changed("own", like="order2", derivatives="levant"), "observers.own.L: is missing; der"),
    (changed("standard", mean_delay=1.6), "observers.standard.mean_delay: 1.6 s must be above 0"),
]


@pytest.mark.parametrize(("overrides", "sentence"), BAD_CONFIG)
def test_invalid_parameters_are_refused(
    overrides: dict[str, Any], sentence: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    target = tmp_path / "parameters.json"
    arguments = [
        "stage",
        "parameters",
        "delay",
        "--project",
        str(ROOT),
        "--overrides",
        json.dumps(overrides),
    ]
    assert main([*arguments, "--output", str(target)]) == 1
    captured = capsys.readouterr()
    assert captured.err.count("\n") == 1, captured.err
    assert captured.err.startswith(f"reobserve-papers: delay.{sentence}")
    assert not target.exists()
