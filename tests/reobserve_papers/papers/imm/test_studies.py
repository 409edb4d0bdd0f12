"""The studies: how far numbers may change, and the effect of each cause."""

from __future__ import annotations

import json
from collections.abc import Sequence
from copy import deepcopy
from functools import cache
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from reobserve.core.errors import InputError
from reobserve_papers.metrics.study_table import StudyTable
from reobserve_papers.papers.imm import calibration, keys, study, study_causes, study_rows
from reobserve_papers.papers.imm.calibration import (
    QUANTITIES,
    Calibration,
    CalibrationTrial,
    read_kept,
)
from reobserve_papers.papers.imm.metrics import reach
from reobserve_papers.papers.imm.study_rows import TUNED
from reobserve_papers.parameters.job import AnyJob, read_job
from tests.reobserve_papers.papers.imm.test_paper import ROOT, Tree, measured, parameters, record

Row = dict[str, Any]

COLUMNS = ("observer", "sweep", "level", "quantity", "value")


def table(rows: Sequence[Row]) -> StudyTable:
    return StudyTable.of(rows, {name: study_rows.KINDS[name] for name in COLUMNS})


KEPT = ROOT / "config" / "searches" / "imm_calibrated.json"


def values(rows: Sequence[Row]) -> dict[tuple[str, str, float, str], float]:
    return {(r["observer"], r["sweep"], r["level"], r["quantity"]): r["value"] for r in rows}


# --- Range of each number -----------------------------------------------------------------------

RULES = AnyJob(
    plant=None,
    observers={
        "loud": SimpleNamespace(quoted=[0.4, 0.6], quoted_high=True),
        "quiet": SimpleNamespace(quoted=[0.2, 0.8], quoted_high=False),
    },
)


def rows_of(sweep: str, level: float, **off: float) -> list[Row]:
    """Results of a trial: each mean ``off`` by the given amount, as text as in a table."""
    found = [("all", "distance", off.get("distance", 0.0))]
    for name, body in RULES.observers.items():
        normal, leakage = body.quoted
        found += [
            (name, "normal_after", normal + off.get(f"{name}_normal", 0.0)),
            (name, "leakage_after", leakage - off.get(f"{name}_leakage", 0.0)),
            (name, "normal_before", 1.0 - off.get(f"{name}_before", 0.0)),
        ]
    return [
        {"observer": name, "sweep": sweep, "level": f"{level!r}", "quantity": what, "value": f"{x}"}
        for name, what, x in found
    ]


def lost(sweep: str, level: float) -> list[Row]:
    """Results of a trial with a diverged filter."""
    return [
        {"observer": "all", "sweep": sweep, "level": level, "quantity": "distance", "value": "nan"}
    ]


STATED = rows_of("stated", 1.0)


def test_range_ends_where_the_worst_value_leaves_the_band() -> None:
    rows = [
        *STATED,
        *rows_of("leave", 0.5, loud_normal=0.05),
        *rows_of("leave", 0.25, loud_normal=0.06, quiet_leakage=-0.25),
        *rows_of("leave", 2.0, quiet_normal=0.02),
        *rows_of("leave", 8.0, quiet_normal=-0.1),
        *rows_of("leave", 32.0, loud_before=0.18),
        *rows_of("process_noise_1", 2.0, loud_normal=5.0),
    ]
    least, greatest = reach(RULES, 0.1, table(rows), "leave")
    assert least == 0.5
    assert greatest == 8.0  # where the distance is that of the band


@pytest.mark.parametrize(
    ("rows", "wanted"),
    [
        ([*rows_of("leave", 0.1), *rows_of("leave", 10.0)], (0.1, 10.0)),
        ([*rows_of("leave", 0.1), *rows_of("leave", 2.0, loud_leakage=0.2)], (0.1, 1.0)),
        # Within a hundredth of what is stated, too.
        ([*rows_of("leave", 0.1), *rows_of("leave", 1.005, loud_leakage=0.2)], (0.1, 1.0)),
        # Quantities that the paper does not report do not count.
        ([*rows_of("leave", 0.1, quiet_before=0.9), *rows_of("leave", 2.0)], (0.1, 2.0)),
        # A filter that diverges has left it.
        ([*rows_of("leave", 0.1), *rows_of("leave", 2.0), *lost("leave", 4.0)], (0.1, 2.0)),
        ([*lost("leave", 0.5), *lost("leave", 2.0)], (1.0, 1.0)),
        # Values that return into the band have left it.
        (
            [*rows_of("leave", 0.5), *rows_of("leave", 2.0, loud_normal=0.4),
             *rows_of("leave", 4.0)],
            (0.5, 1.0),
        ),
    ],
)  # fmt: skip
def test_range_of_known_rows_is_exact(rows: list[Row], wanted: tuple[float, float]) -> None:
    for order in (1, -1):
        assert reach(RULES, 0.1, table([*STATED, *rows][::order]), "leave") == pytest.approx(wanted)


def test_numbers_outside_the_band_as_stated_have_no_range() -> None:
    rows = [
        *rows_of("stated", 1.0, loud_normal=0.2),
        *rows_of("leave", 0.5),
        *rows_of("leave", 2.0, loud_normal=0.15),
    ]
    assert reach(RULES, 0.1, table(rows), "leave") == (1.0, 1.0)


def kept_text(**changes: Any) -> str:
    stored = json.loads(KEPT.read_text(encoding="utf-8"))["search"]
    return json.dumps({"search": {**stored, **changes}})


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (None, r"cannot be read \(No such file or directory\)"),
        ("{", "is not JSON"),
        ("[1, 2]", "must be a mapping of keys to values"),
        ('{"provenance": {}}', "search: is missing"),
        ('{"search": 3}', "search: 3 must be a mapping of keys to values"),
        ('{"search": {"found": {}}}', "search.distance: is missing; the kept search needs it"),
        (kept_text(trials=-0.5), "search.trials: -0.5 must be a whole number"),
        (kept_text(distance=None), "search.distance: None is not a number"),
        (kept_text(found={"leave": 0.1}), "holds other numbers than the search tunes; rerun it"),
    ],
)
def test_invalid_stored_file_is_refused(tmp_path: Path, text: str | None, said: str) -> None:
    path = tmp_path / "kept.json"
    if text is not None:
        path.write_text(text, encoding="utf-8")
    with pytest.raises(InputError, match=said) as caught:
        read_kept(path)
    assert caught.value.parameter.startswith(str(path))
    assert "\n" not in str(caught.value)


@cache
def settings_of(name: str) -> Tree:
    return parameters().settings("study", name)


def neighbourhood(changes: Tree | None = None, factors: Sequence[float] = ()) -> list[Row]:
    settings = deepcopy(settings_of("neighbourhood"))
    settings["study"].update(kept=str(KEPT), factors=list(factors))
    for body in settings["observers"].values():
        body.update(changes or {})
    return study.run(read_job(keys.Parameters, settings), record("step"))


def test_parameter_file_holds_the_search_result() -> None:
    found = values(neighbourhood())
    kept = json.loads(KEPT.read_text(encoding="utf-8"))["search"]
    for name in ("trials", "tuned", "targets", "distance"):
        assert found["search", "kept", 1.0, name] == kept[name]
    assert found["all", "stated", 1.0, "distance"] == pytest.approx(kept["distance"], rel=1e-9)


def met(calibration: Calibration) -> dict[str, tuple[float, float, float]]:
    """Means of all banks as the paper quotes them."""
    return {name: (*map(float, body.quoted), 1.0) for name, body in calibration.observers.items()}  # type: ignore[misc]


def test_end_of_a_range_is_bisected(monkeypatch: pytest.MonkeyPatch) -> None:
    """Filters diverge beyond the factor 3 of one number."""

    def try_out(self: Calibration, numbers: Any) -> CalibrationTrial:
        factors = numbers / self.tuned_numbers()
        if factors[0] > 3.0:
            return CalibrationTrial({}, float("nan"))
        return CalibrationTrial(met(self), 0.0)

    monkeypatch.setattr(Calibration, "try_out", try_out)
    rows = table(neighbourhood(factors=[2.0, 5.0]))
    _, greatest = reach(RULES, 0.1, rows, TUNED[0])
    assert 3.0 / 2.5 ** (1 / 64) < greatest <= 3.0
    assert reach(RULES, 0.1, rows, TUNED[1]) == (0.2, 5.0)


def test_each_factor_changes_only_one_number(monkeypatch: pytest.MonkeyPatch) -> None:
    tried: list[list[float]] = []

    def try_out(self: Calibration, numbers: Any) -> CalibrationTrial:
        tried.append(list(numbers / self.tuned_numbers()))
        return CalibrationTrial(met(self), 0.0)

    monkeypatch.setattr(Calibration, "try_out", try_out)
    monkeypatch.setattr(calibration, "THREADS", 1)
    rows = neighbourhood(factors=[2.0, 5.0])
    wanted = [[1.0] * 9]
    for index in range(9):
        wanted += [
            [factor if i == index else 1.0 for i in range(9)] for factor in (0.5, 2.0, 0.2, 5.0)
        ]
    np.testing.assert_allclose(tried, wanted, rtol=1e-12)
    listed = [(r["sweep"], r["level"]) for r in rows if r["observer"] == "all"]
    steps = (0.5, 2.0, 0.2, 5.0)
    assert listed == [("stated", 1.0), *((name, level) for name in TUNED for level in steps)]


def test_jointly_tuned_banks_must_share_their_numbers() -> None:
    settings = deepcopy(settings_of("neighbourhood"))
    settings["observers"]["svsf_thin_tuned"]["self_transition"] = 0.9

    def calibration() -> Calibration:
        job = read_job(keys.Parameters, settings)
        return Calibration(job.plant, job.observers, job.metrics, record("step"))

    with pytest.raises(InputError, match=r"^observers.svsf_thin_tuned: must have the noise of"):
        calibration().tuned_numbers()
    settings["observers"]["kalman_tuned"]["realisation"] = "velocity"
    with pytest.raises(InputError, match=r"^observers.kalman_tuned.realisation: must be motion"):
        calibration().tuned_numbers()


# --- One change at a time -----------------------------------------------------------------------


def changes(**stated: Any) -> list[Row]:
    settings = deepcopy(settings_of("changes"))
    settings["study"].update(
        {"periods": [], "shares": [], "layer_factors": [], "initial_covariances": [], **stated}
    )
    return study.run(read_job(keys.Parameters, settings), record("step"))


def test_unmodified_settings_agree_with_the_figures() -> None:
    found = values(changes())
    for figure in ("fig5", "fig7"):
        numbers = measured(figure)
        for name in parameters().section("figures", figure, "observers"):
            for quantity in (*QUANTITIES, "friction_after"):
                value = found[name, "as_stated", 1.0, quantity]
                wanted = pytest.approx(numbers[name, quantity], rel=1e-12, abs=1e-13)
                assert value == wanted, (name, quantity)
    # Preconditions: each change has an effect.
    for sweep in (
        "unmixed", "prbs", "square", "sweep", "friction", "states",
    ):  # fmt: skip
        gap = abs(found["all", sweep, 1.0, "distance"] - found["all", "as_stated", 1.0, "distance"])
        assert gap > 1e-3, sweep
    for sweep, least in (("weighted", 1e-3), ("outputs", 1e-5), ("certain", 1e-5)):
        rows = [found[f"svsf{thin}_tuned", way, 1.0, "normal_after"]
                for thin in ("", "_thin") for way in (sweep, "as_stated")]  # fmt: skip
        assert max(abs(rows[0] - rows[1]), abs(rows[2] - rows[3])) > least, sweep


def test_change_to_the_present_value_changes_nothing() -> None:
    scenario = parameters().section("scenarios", "step")
    rows = changes(
        prbs=scenario["input"], square=scenario["input"], sweep=scenario["input"],
        periods=[scenario["period"]], shares=[1.0], layer_factors=[1.0], noise=scenario["noise"],
        initial_covariances=[parameters().section("observers", "svsf_tuned", "initial_covariance")],
    )  # fmt: skip
    found: dict[str, list[tuple[str, str, float]]] = {}
    for row in rows:
        found.setdefault(row["sweep"], []).append((row["observer"], row["quantity"], row["value"]))
    for sweep in ("prbs", "square", "sweep", "period", "share", "layer", "noise", "start"):
        assert found[sweep] == found["as_stated"], sweep


def test_layer_changes_affect_only_svsfs_and_mixing_affects_all() -> None:
    found = values(changes(layer_factors=[1e-4]))
    quantities = [("kalman_tuned", q) for q in QUANTITIES]
    for name, quantity in quantities:
        same = found[name, "as_stated", 1.0, quantity]
        assert found[name, "layer", 1e-4, quantity] == same
        assert found[name, "unmixed", 1.0, quantity] != same
    # One per cent of its layer turns one SVSF into the other.
    thinner = values(changes(layer_factors=[0.01]))
    for quantity in QUANTITIES:
        value = thinner["svsf_tuned", "layer", 0.01, quantity]
        stated = thinner["svsf_thin_tuned", "as_stated", 1.0, quantity]
        assert value == pytest.approx(stated, rel=1e-12)


def test_study_refuses_invalid_settings_before_any_run(monkeypatch: pytest.MonkeyPatch) -> None:
    """With the key of the study, and without a single run."""
    for module, run in (
        (calibration, "run_neighbourhood"), (calibration, "run_changes"), (study_causes, "run"),
    ):  # fmt: skip
        monkeypatch.setattr(module, run, lambda *_: pytest.fail("has run"))
    with pytest.raises(InputError, match=r"^study\.periods"):
        changes(periods=[1e-9])


def test_rows_do_not_depend_on_the_number_of_threads(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(calibration, "THREADS", 1)
    settings = deepcopy(settings_of("changes"))
    settings["study"].update({"periods": [0.01], "shares": [0.9], "layer_factors": [0.1]})
    alone = study.run(read_job(keys.Parameters, settings), record("step"))
    monkeypatch.setattr(calibration, "THREADS", 2)
    assert study.run(read_job(keys.Parameters, settings), record("step")) == alone
