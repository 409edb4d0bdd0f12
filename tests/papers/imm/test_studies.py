"""The studies: how far numbers may move, what depends on what, and how close models may come."""

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

from reobserve.errors import InputError
from reobserve.ledger.types import Job, read_job
from reobserve.papers.imm import keys, study, study_changes, study_closeness, study_neighbourhood
from reobserve.papers.imm.metrics import diagnoses, enough_gap, reach
from reobserve.papers.imm.plot_closeness import wilson
from reobserve.papers.imm.setup import modes
from reobserve.papers.imm.study_neighbourhood import QUANTITIES, read_kept
from reobserve.papers.imm.tuning import TUNED, Calibration, Trial, within
from reobserve.plain_data.typed_tree import parse
from reobserve.scoring.study_table import StudyTable
from reobserve.synthesis.nu_gap import nu_gap
from tests.papers.imm.test_paper import ROOT, Tree, ledger, measured, record

Row = dict[str, Any]

COLUMNS = ("observer", "sweep", "level", "quantity", "value")


def table(rows: Sequence[Row]) -> StudyTable:
    return StudyTable.of(rows, {name: study.KINDS[name] for name in COLUMNS})


KEPT = ROOT / "config" / "searches" / "imm_calibrated.json"


def values(rows: Sequence[Row]) -> dict[tuple[str, str, float, str], float]:
    return {(r["observer"], r["sweep"], r["level"], r["quantity"]): r["value"] for r in rows}


# --- How far each number may move ---------------------------------------------------------------

RULES = Job(
    plant=None,
    observers={
        "loud": SimpleNamespace(quoted=[0.4, 0.6], quoted_high=True),
        "quiet": SimpleNamespace(quoted=[0.2, 0.8], quoted_high=False),
    },
    metrics=SimpleNamespace(band=0.1),
)


def rows_of(sweep: str, level: float, **off: float) -> list[Row]:
    """What a trial tells: each mean as far ``off`` as is said, as text like in a table."""
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
    """What a trial with a diverged filter tells."""
    return [
        {"observer": "all", "sweep": sweep, "level": level, "quantity": "distance", "value": "nan"}
    ]


STATED = rows_of("stated", 1.0)


def test_reach_is_where_the_worst_of_all_values_leaves_the_band() -> None:
    rows = [
        *STATED,
        *rows_of("leave", 0.5, loud_normal=0.05),
        *rows_of("leave", 0.25, loud_normal=0.06, quiet_leakage=-0.25),
        *rows_of("leave", 2.0, quiet_normal=0.02),
        *rows_of("leave", 8.0, quiet_normal=-0.1),
        *rows_of("leave", 32.0, loud_before=0.18),
        *rows_of("process_noise_1", 2.0, loud_normal=5.0),
    ]
    least, greatest = reach(RULES, table(rows), "leave")
    assert least == pytest.approx(0.5 * 0.5 ** ((0.1 - 0.05) / (0.25 - 0.05)))
    # At 8 the distance is the band, up to rounding; beyond, it leaves it at once.
    assert greatest == pytest.approx(8.0, rel=1e-6)


@pytest.mark.parametrize(
    ("rows", "wanted"),
    [
        ([*rows_of("leave", 0.1), *rows_of("leave", 10.0)], (0.1, 10.0)),
        ([*rows_of("leave", 0.1), *rows_of("leave", 2.0, loud_leakage=0.2)], (0.1, 2**0.5)),
        # What the paper is silent about does not count.
        ([*rows_of("leave", 0.1, quiet_before=0.9), *rows_of("leave", 2.0)], (0.1, 2.0)),
        # Nothing is known between a factor that is well and one that diverges.
        ([*rows_of("leave", 0.1), *rows_of("leave", 2.0), *lost("leave", 4.0)], (0.1, 2.0)),
        ([*lost("leave", 0.5), *lost("leave", 2.0)], (1.0, 1.0)),
        # Values that come back into the band have left it.
        (
            [*rows_of("leave", 0.5), *rows_of("leave", 2.0, loud_normal=0.4),
             *rows_of("leave", 4.0)],
            (0.5, 2**0.25),
        ),
    ],
)  # fmt: skip
def test_reach_of_known_rows(rows: list[Row], wanted: tuple[float, float]) -> None:
    for order in (1, -1):
        assert reach(RULES, table([*STATED, *rows][::order]), "leave") == pytest.approx(wanted)


def test_numbers_that_are_outside_as_stated_may_not_move() -> None:
    rows = [
        *rows_of("stated", 1.0, loud_normal=0.2),
        *rows_of("leave", 0.5),
        *rows_of("leave", 2.0, loud_normal=0.15),
    ]
    assert reach(RULES, table(rows), "leave") == (1.0, 1.0)


def test_within_is_what_reach_asks_for() -> None:
    means = {"loud": (0.45, 0.52, 0.95), "quiet": (0.2, 0.8, 0.3)}
    observers = RULES.observers
    assert within(Trial(means, 0.0), observers, 0.081)
    assert not within(Trial(means, 0.0), observers, 0.079)
    assert not within(Trial({**means, "loud": (0.4, 0.6, 0.88)}, 0.0), observers, 0.1)
    assert not within(Trial({}, float("nan")), observers, 0.1)


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
        (kept_text(found={"leave": 0.1}), "holds other numbers than the search tunes; run it anew"),
    ],
)
def test_a_kept_file_that_is_none(tmp_path: Path, text: str | None, said: str) -> None:
    path = tmp_path / "kept.json"
    if text is not None:
        path.write_text(text, encoding="utf-8")
    with pytest.raises(InputError, match=said) as caught:
        read_kept(path)
    assert caught.value.parameter.startswith(str(path))
    assert "\n" not in str(caught.value)


@cache
def settings_of(name: str) -> Tree:
    return ledger().settings("study", name)


def neighbourhood(changes: Tree | None = None, factors: Sequence[float] = ()) -> list[Row]:
    settings = deepcopy(settings_of("neighbourhood"))
    settings["study"].update(kept=str(KEPT), factors=list(factors))
    for body in settings["observers"].values():
        body.update(changes or {})
    return study.run(settings, record("step"))


def test_the_ledger_has_what_the_search_found() -> None:
    found = values(neighbourhood())
    assert found["search", "kept", 1.0, "as_found"] == 1.0
    kept = json.loads(KEPT.read_text(encoding="utf-8"))["search"]
    for name in ("trials", "tuned", "targets", "distance"):
        assert found["search", "kept", 1.0, name] == kept[name]
    assert found["all", "stated", 1.0, "distance"] == pytest.approx(kept["distance"], rel=1e-9)


def test_other_numbers_in_the_ledger_are_not_as_found() -> None:
    stay = settings_of("neighbourhood")["observers"]["kalman_tuned"]["stay"]
    found = values(neighbourhood({"stay": stay - 1e-4}))
    assert found["search", "kept", 1.0, "as_found"] == 0.0


def test_each_factor_moves_one_number_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    tried: list[list[float]] = []

    def try_out(self: Calibration, numbers: Any) -> Trial:
        tried.append(list(numbers / self.stated()))
        return Trial({}, 0.0)

    monkeypatch.setattr(Calibration, "try_out", try_out)
    monkeypatch.setattr(study_neighbourhood, "THREADS", 1)
    rows = neighbourhood(factors=[2.0, 5.0])
    wanted = [[1.0] * 9]
    for index in range(9):
        wanted += [
            [factor if i == index else 1.0 for i in range(9)] for factor in (0.5, 2.0, 0.2, 5.0)
        ]
    np.testing.assert_allclose(tried, wanted, rtol=1e-12)
    told = [(r["sweep"], r["level"]) for r in rows if r["observer"] == "all"]
    steps = (0.5, 2.0, 0.2, 5.0)
    assert told == [("stated", 1.0), *((name, level) for name in TUNED for level in steps)]


def test_banks_that_are_tuned_together_share_their_numbers() -> None:
    settings = deepcopy(settings_of("neighbourhood"))
    settings["observers"]["svsf_thin_tuned"]["stay"] = 0.9

    def calibration() -> Calibration:
        job = read_job(keys.Ledger, settings)
        return Calibration(job.plant, job.observers, job.metrics, record("step"))

    with pytest.raises(InputError, match=r"^observers.svsf_thin_tuned: must have the noise of"):
        calibration().stated()
    settings["observers"]["kalman_tuned"]["realisation"] = "velocity"
    with pytest.raises(InputError, match=r"^observers.kalman_tuned.realisation: must be motion"):
        calibration().stated()


# --- One thing changed --------------------------------------------------------------------------


def changes(**stated: Any) -> list[Row]:
    settings = deepcopy(settings_of("changes"))
    settings["study"].update({"periods": [], "shares": [], "layer_factors": [], **stated})
    return study.run(settings, record("step"))


def test_as_stated_are_the_numbers_of_the_figures() -> None:
    found = values(changes())
    for figure in ("fig5", "fig7"):
        numbers = measured(figure)
        for name in ledger().section("figures", figure, "observers"):
            for quantity in QUANTITIES:
                value = found[name, "as_stated", 1.0, quantity]
                assert value == pytest.approx(numbers[name, quantity], rel=1e-12), (name, quantity)
    # Guards: what is changed has an effect.
    for sweep in ("unmixed", "prbs", "square", "sweep", "friction"):
        gap = abs(found["all", sweep, 1.0, "distance"] - found["all", "as_stated", 1.0, "distance"])
        assert gap > 1e-3, sweep


def test_a_change_to_what_it_was_changes_nothing() -> None:
    scenario = ledger().section("scenarios", "step")
    rows = changes(
        prbs=scenario["input"], square=scenario["input"], sweep=scenario["input"],
        periods=[scenario["period"]], shares=[1.0], layer_factors=[1.0], noise=scenario["noise"],
    )  # fmt: skip
    found: dict[str, list[tuple[str, str, float]]] = {}
    for row in rows:
        found.setdefault(row["sweep"], []).append((row["observer"], row["quantity"], row["value"]))
    for sweep in ("prbs", "square", "sweep", "period", "share", "layer", "noise"):
        assert found[sweep] == found["as_stated"], sweep


def test_layers_are_those_of_the_svsfs_and_mixing_is_everybodys() -> None:
    found = values(changes(layer_factors=[1e-4]))
    quantities = [("kalman_tuned", q) for q in QUANTITIES]
    for name, quantity in quantities:
        same = found[name, "as_stated", 1.0, quantity]
        assert found[name, "layer", 1e-4, quantity] == same
        assert found[name, "unmixed", 1.0, quantity] != same
    # A hundredth of its layer makes the one SVSF the other.
    thinner = values(changes(layer_factors=[0.01]))
    for quantity in QUANTITIES:
        value = thinner["svsf_tuned", "layer", 0.01, quantity]
        stated = thinner["svsf_thin_tuned", "as_stated", 1.0, quantity]
        assert value == pytest.approx(stated, rel=1e-12)


def test_a_study_refuses_before_it_runs_what_it_cannot_use(monkeypatch: pytest.MonkeyPatch) -> None:
    """With the key of the study, and without one run."""
    for method in study.METHODS:
        monkeypatch.setitem(study.METHODS, method, lambda *_: pytest.fail("has run"))
    with pytest.raises(InputError, match=r"^study\.horizon: "):
        close(horizon=1.6001)
    with pytest.raises(InputError, match=r"^study\.periods"):
        changes(periods=[1e-9])


# --- How close two models may come --------------------------------------------------------------

FEW: Tree = {
    "shares": [0.05, 0.3], "noise_levels": [0.03, 0.3, 1.0], "runs": 3, "horizon": 1.6,
    "onset": 0.8, "judged": 0.4,
}  # fmt: skip


def close(**stated: Any) -> list[Row]:
    settings = deepcopy(settings_of("closeness"))
    settings["study"].update({**FEW, **stated})
    settings["study"]["input"][0]["until"] = settings["study"]["horizon"]
    return study.run(settings, record("plain"))


@cache
def few() -> list[Row]:
    return close()


def test_rows_are_the_same_on_one_thread_and_two(monkeypatch: pytest.MonkeyPatch) -> None:
    for module in (study_closeness, study_changes, study_neighbourhood):
        monkeypatch.setattr(module, "THREADS", 1)
    assert close() == few()
    settings = deepcopy(settings_of("changes"))
    settings["study"].update({"periods": [0.01], "shares": [0.9], "layer_factors": [0.1]})
    alone = study.run(settings, record("step"))
    monkeypatch.setattr(study_changes, "THREADS", 2)
    assert study.run(settings, record("step")) == alone


def test_rows_come_by_noise_then_models_then_runs() -> None:
    banks = ("kalman", "kalman_unmixed", "svsf")
    wanted = []
    for noise in ("noise_0.03", "noise_0.3", "noise_1"):
        wanted += [("models", noise, share, 0) for share in FEW["shares"]]
        wanted += [
            (name, noise, share, run)
            for run in (1, 2, 3) for share in FEW["shares"] for name in banks
        ]  # fmt: skip
    assert [(r["observer"], r["sweep"], r["level"], r["run"]) for r in few()] == wanted
    assert all(0 <= r["value"] <= 1 for r in few())


def test_the_gap_is_the_one_between_the_models() -> None:
    normal, _, leakage = modes(parse(keys.Plant, ledger().section("plant")))
    for row in few():
        if row["observer"] == "models":
            assert row["quantity"] == "nu_gap"
            pairs = []
            for model in (normal, normal.blended(leakage, row["level"])):
                b, a = model.coefficients
                pairs.append((b.tolist(), [1.0, *a.tolist()]))
            assert row["value"] == nu_gap(*pairs)


def test_more_runs_leave_the_first_as_they_were() -> None:
    fewer = close(runs=1, shares=[0.3], noise_levels=[0.3])
    kept = [r for r in few() if (r["sweep"], r["level"]) == ("noise_0.3", 0.3) and r["run"] < 2]
    assert fewer == kept


def test_noise_makes_no_diagnosis_better() -> None:
    means = {
        key: {share: float(np.mean(runs["value"])) for (share,), runs in found.groups("level")}
        for key, found in table(few()).groups("observer", "sweep")
    }
    # Of Kalman filters: the SVSF's gain knows nothing of the noise, and its bank may do better with
    # more of it, as R grows along.
    for bank in ("kalman", "kalman_unmixed"):
        for share in FEW["shares"]:
            by_noise = [means[bank, f"noise_{level:g}"][share] for level in FEW["noise_levels"]]
            assert by_noise == sorted(by_noise, reverse=True), (bank, share)
        # Under noise as large as the signal nothing is told, of the closest models least.
        assert abs(means[bank, "noise_1"][0.05] - 0.5) < 0.1
        assert means[bank, "noise_0.03"][0.3] > 0.8


def test_a_pair_of_models_is_counted_once_a_run() -> None:
    """Against the numbers that the figure's metrics tell."""
    rows = table(few())
    for share, gap, right, runs in zip(
        FEW["shares"], *diagnoses(rows, "kalman", "noise_0.3"), strict=True
    ):
        mine = rows.where(observer="kalman", sweep="noise_0.3", level=share)
        assert gap == rows.value(observer="models", sweep="noise_0.3", level=share)
        assert (right, runs) == (sum(value > 0.5 for value in mine["value"]), FEW["runs"])


def test_the_gap_that_is_enough() -> None:
    gaps = [0.01, 0.02, 0.08, 0.32]
    assert enough_gap(gaps, [0.5, 0.9, 1.0, 1.0], 0.95) == pytest.approx(0.04)
    assert enough_gap(gaps, [0.5, 0.75, 0.75, 1.0], 0.95) == pytest.approx(0.08 * 4**0.8)
    # What is told well once and worse again further away is not told from there on.
    assert enough_gap(gaps, [0.5, 1.0, 0.5, 1.0], 0.75) == pytest.approx(0.16)
    assert enough_gap(gaps, [1.0, 1.0, 0.95, 1.0], 0.95) == 0.01
    assert np.isnan(enough_gap(gaps, [1.0, 1.0, 1.0, 0.9], 0.95))


@pytest.mark.parametrize(
    ("right", "runs", "low", "high"),
    [  # Newcombe (1998), Table I, method 3
        (81, 263, 0.2553, 0.3662),
        (15, 148, 0.0624, 0.1605),
        (0, 20, 0.0, 0.1611),
        (1, 29, 0.0061, 0.1718),
    ],
)
def test_wilson_intervals_as_they_are_published(
    right: int, runs: int, low: float, high: float
) -> None:
    found = wilson(np.array([right]), np.array([runs]))
    assert found[0][0] == pytest.approx(low, abs=5e-5)
    assert found[1][0] == pytest.approx(high, abs=5e-5)


def test_wilson_ends_are_as_far_as_the_normal_quantile_says() -> None:
    right, runs = np.array([3.0, 20.0, 39.0]), np.array([40.0, 40.0, 40.0])
    for end in wilson(right, runs):
        off = np.abs(right / runs - end) / np.sqrt(end * (1 - end) / runs)
        np.testing.assert_allclose(off, 1.959963984540054, rtol=1e-12)
