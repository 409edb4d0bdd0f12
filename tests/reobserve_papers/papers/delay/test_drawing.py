"""Each observer has one style in all figures, and notes follow from the parameters."""

from __future__ import annotations

from typing import Any

import pytest

from reobserve_papers.papers.delay import keys, notes
from reobserve_papers.papers.delay.styles import style_of
from reobserve_papers.parameters.job import read_job
from tests.reobserve_papers.papers import fixed_parameters


def job(figure: str, **overrides: Any) -> keys.Job:
    parameters = fixed_parameters("delay", overrides)
    return read_job(keys.Parameters, parameters.settings("plot", figure))


def test_each_observer_has_its_own_style() -> None:
    bodies = {
        name: body
        for figure in ("fig1", "fig2", "fig3")
        for name, body in job(figure).observers.items()
    }
    looks = {
        name: (style_of(body).color, str(style_of(body).linestyle)) for name, body in bodies.items()
    }
    assert looks["order1"] == looks["order1_noise"]
    assert looks["order2"] == looks["order2_noise"] == looks["extended_lag"]
    assert looks["standard"] == looks["standard_noise"]
    for part in zip(*set(looks.values()), strict=True):
        assert len(set(part)) == 6


def test_curve_for_m_1_is_blue() -> None:
    color = style_of(job("fig1").observers["order1"]).color
    red, green, blue = (int(color[i : i + 2], 16) for i in (1, 3, 5))
    assert blue > 1.4 * max(red, green)


@pytest.mark.parametrize(
    ("figure", "overrides", "said"),
    [
        ("fig1", {}, "S(0) = 1 I. Runge-Kutta steps of 5 ms.\nNo noise."),
        ("fig2", {}, "ρ = 2.5. S from the dynamic equation, S(0) = 1 I; gain of the delay off"),
        ("fig2", {}, "standard deviation of 5 % of the amplitude (1 rad for the angle), held"),
        ("fig2", {"plant": {"noise_size": "peak"}}, "Noise with a peak of 5 %"),
        ("fig2", {"plant": {"noise_amplitude": "turns"}}, "(the largest angle, with full turns)"),
        ("fig2", {"plant": {"noisy_input": "applied"}}, "that of the input also in the pendulum"),
        (
            "fig2", {"observers": {"order1_noise": {"initial_matrix": "algebraic"}}},
            "S(0) = 1 I, S from the algebraic equation",
        ),
        (
            "fig2", {"observers": {"order1_noise": {"switched": "all"}}},
            "gain of the delay, gain off where the estimated |ξ| < 0.7",
        ),
        ("fig1", {"observers": {"standard": {"rho": 3.0}}}, "ρ = 5, 3."),
    ],
)  # fmt: skip
def test_note_states_the_settings(figure: str, overrides: Any, said: str) -> None:
    assert said in notes.note(job(figure, **overrides))
