"""The study of gains and noise: its results over time, and requirements on its parameters."""

from __future__ import annotations

import copy
from typing import Any

import numpy as np
import pytest

from reobserve.core.errors import InputError
from reobserve_papers.metrics.metrics import lookup
from reobserve_papers.metrics.study_table import StudyTable
from reobserve_papers.papers.ilo import study, study_rows
from reobserve_papers.papers.ilo.observe import estimate
from reobserve_papers.papers.ilo.plant import simulate
from reobserve_papers.papers.ilo.scoring import Errors
from reobserve_papers.parameters.parameter_checks import check_parameters
from reobserve_papers.steps.evaluation import evaluate
from tests.reobserve_papers.papers import fixed_parameters
from tests.reobserve_papers.papers.ilo.conftest import typed


@pytest.fixture(scope="module")
def settings() -> dict[str, Any]:
    """One gain, one level and one run; the noise is held for an interval of the sampled variant."""
    found = copy.deepcopy(fixed_parameters("ilo", seed=1).settings("study", "matching"))
    found["study"] |= {"integral_gains": [1e5], "noise_levels": [1e-5, 1e-4], "noise_runs": 1}
    found["study"]["shown_noise"] = 1e-4
    return found


@pytest.fixture(scope="module")
def table(settings: dict[str, Any]) -> StudyTable:
    fault = fixed_parameters("ilo").section("scenarios", "aperiodic")
    record = simulate(typed({"plant": settings["plant"], "scenario": fault, "seed": 1}))
    return StudyTable.of(study.run(typed(settings), record), study_rows.KINDS)


def over_time(table: StudyTable, observer: str) -> np.ndarray:
    rows = table.where(sweep="time", observer=observer)
    assert rows["level"].tolist() == list(range(1, 11))
    return rows["relative_rms_error"].astype(float)


def test_noise_grows_only_under_the_printed_law(table: StudyTable) -> None:
    grown = over_time(table, "continuous")
    assert grown[4] > 1.5 * grown[0]
    for name in ("sampled", "forgetting", "matched"):
        assert over_time(table, name)[:5] == pytest.approx(over_time(table, name)[0], rel=0.2)


def test_noise_jumps_accumulate_with_identity_learning(
    settings: dict[str, Any],
) -> None:
    """w^ is continuous and reverses none of them: each phase of tau performs a random walk."""
    plant = settings["plant"] | {"noise": 1e-5}
    record = simulate(typed({"plant": plant, "scenario": {"fault": []}, "seed": 3}))
    observer = settings["observers"]["continuous"]
    run = estimate(typed({"plant": plant, "observer": observer}), record)
    delay = round(observer["update_interval"] / run.step)
    every = round(run.step / record.step)
    steps = (record["measured"] - record["measured_before"])[::every]
    steps[0] = 0.0  # no history before the record
    jumps = run["fault"] - run["fault_before"]
    rounds = len(steps) // delay * delay
    walks = np.cumsum(steps[:rounds].reshape(-1, delay, 3), axis=0).reshape(-1, 3)
    first = run["fault"][0]  # the effect of the first measurement at the initial phase
    walks[delay::delay] += first / observer["K2"]
    assert jumps[1:rounds] == pytest.approx(observer["K2"] * walks[1:], abs=1e-6)


def test_score_is_computed_from_the_seconds_of_the_scored_window(table: StudyTable) -> None:
    """It begins a second after the onset at 5 s."""
    for name in ("sampled", "continuous", "forgetting", "adaptive", "matched"):
        score = table.where(sweep="noise", observer=name, level=1e-4)["relative_rms_error"][0]
        seconds = over_time(table, name)[6:]
        assert np.sqrt(np.mean(seconds**2)) == pytest.approx(score, rel=1e-9), name


def test_each_second_is_relative_to_the_fault_in_the_scored_window(
    settings: dict[str, Any], table: StudyTable
) -> None:
    """The adaptive observer is too slow to respond to noise: its seconds are those without
    noise."""
    fault = fixed_parameters("ilo").section("scenarios", "aperiodic")
    record = simulate(typed({"plant": settings["plant"], "scenario": fault, "seed": 1}))
    observer = settings["observers"]["adaptive"]
    errors = Errors.of(
        record, estimate(typed({"plant": settings["plant"], "observer": observer}), record), 0
    )
    size = np.sqrt(np.mean(record["fault"][record.time > 6.0, 0] ** 2))
    seconds = [errors.window(end - 1, end).root_mean_square / size for end in range(6, 11)]
    assert over_time(table, "adaptive")[5:] == pytest.approx(seconds, rel=1e-3)


def test_shown_level_is_one_of_the_levels() -> None:
    over = {"studies": {"matching": {"shown_noise": 2e-5}}}
    with pytest.raises(InputError, match=r"matching\.shown_noise: 2e-05 must be one of the noise"):
        check_parameters(fixed_parameters("ilo", over))


def test_gain_of_each_axis_is_drawn_where_that_of_the_faulty_axis_is() -> None:
    observers = {"adaptive": {"integral_gain": [150.0, 250.0, 350.0]}}
    few = {
        "integral_gains": [1e5],
        "noise_levels": [1e-5, 1e-4],
        "noise_runs": 1,
        "shown_noise": 1e-4,
    }
    over = {"observers": observers, "studies": {"matching": few}}
    figure = evaluate(fixed_parameters("ilo", over), "fig4_matched").plot()
    lines = [line.get_xdata()[0] for line in figure.axes[0].lines if line.get_linestyle() == ":"]
    assert 150.0 in lines


def test_figure_shows_the_printed_update_beside_the_sampled_one() -> None:
    figure = evaluate(fixed_parameters("ilo"), "fig1")
    above, middle, _ = figure.plot(notes=False).axes
    for axes, lines in ((above, above.lines[1:]), (middle, middle.lines)):
        assert len(lines) == 2, axes.get_title()
        # Both start from zero; (3) as printed overshoots, v held does not.
        largest = [float(np.max(line.get_ydata()[line.get_xdata() > 5.02])) for line in lines]
        assert largest[1] > 0.1 + largest[0]


def test_constant_guesses_do_not_pass_for_the_observer() -> None:
    """Errors of the variant that is named in all norms and windows, beside those of guesses."""
    found = lookup(evaluate(fixed_parameters("ilo"), "fig2").numbers)
    for norm in ("rms", "absolute", "largest"):
        for window in ("settled", "onset"):
            name = f"relative_error norm={norm} window={window}"
            assert found["zero", name] == 1
            # sin 10 t has hardly any mean over 12 turns.
            assert found["mean", name] == pytest.approx(1, abs=0.05)
            assert found["learning", name] < 0.05 or (norm, window) == ("largest", "onset")
    scored = "relative_error norm=rms window=settled"
    assert found["learning", scored] == found["learning", "relative_rms_error"]
    # At the onset the largest error is more than that of the rest of the run.
    assert (
        found["learning", "relative_error norm=largest window=onset"]
        >= found["learning", "relative_error norm=largest window=settled"]
    )
    constant = lookup(evaluate(fixed_parameters("ilo"), "fig1").numbers)
    assert constant["zero", "late_rms_error"] == pytest.approx(0.5)
