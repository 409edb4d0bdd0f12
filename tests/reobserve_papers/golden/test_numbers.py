"""Golden numbers: which are stored and compared, and with which tolerances."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Mapping
from pathlib import Path

import numpy as np
import pytest

from reobserve.core.errors import InputError, ReobserveError
from reobserve.core.files import read_rows, write_table
from reobserve_papers.golden import acceptance, conditions, golden_bench, golden_claims
from reobserve_papers.golden.comparison import Moved, compare
from reobserve_papers.golden.number_files import (
    GoldenNumber,
    Key,
    golden_file,
    golden_files,
    read_numbers,
    write_numbers,
)
from reobserve_papers.golden.tolerances import tolerance
from reobserve_papers.golden.values import _samples, evaluated_numbers, part_names, records
from reobserve_papers.signals.series import Channel, Series
from reobserve_papers.steps.evaluation import Evaluator
from tests.reobserve_papers.pipeline.conftest import EVALUATORS, PARAMETER_FILES, ROOT

METRIC: Key = ("watch", "rms", "")


def number(value: str, allowed: str = "1e-6", unit: str = "V") -> dict[Key, GoldenNumber]:
    return {METRIC: GoldenNumber(value, unit, allowed)}


def samples(values: dict[float, float], allowed: str = "") -> dict[Key, GoldenNumber]:
    return {
        ("plant", "x", f"{t:g}"): GoldenNumber(f"{x:.14g}", "m", allowed) for t, x in values.items()
    }


def moved(golden: dict[Key, GoldenNumber], found: dict[Key, GoldenNumber]) -> list[str]:
    return list(map(str, compare(golden, found, "made fig1")))


@pytest.mark.parametrize(
    ("golden", "found", "said"),
    [
        (number("0.5"), number("0.5000009"), ""),
        (
            number("0.5"),
            number("0.500002"),
            "golden 0.5, found 0.500002 V (+0.0004 %, 2 times what is allowed)",
        ),
        (number("0.5"), number("nan"), "golden 0.5, found nan V"),
        (number("nan"), number("nan"), ""),
        (number("0.5"), number("0.5", unit="A"), "golden in V, found in A"),
        (number("0.5"), {}, "golden a number, found none"),
        ({}, number("0.5"), "golden none, found a number"),
        (number("0.5", ""), number("0.7"), ""),  # listed, not compared
        (number("yes", ""), number("no"), "golden yes, found no"),
        (number("yes", ""), number(""), "golden yes, found nothing"),
        (number("2", ""), number("two"), "golden 2, found two"),
    ],
)
def test_changed_number_is_named(
    golden: dict[Key, GoldenNumber], found: dict[Key, GoldenNumber], said: str
) -> None:
    lines = moved(golden, found)
    assert len(lines) == bool(said)
    assert not said or lines[0].startswith(f"made fig1, watch rms: {said}")


def test_largest_deviation_of_a_series_is_named() -> None:
    golden = samples({0.0: 1.0, 0.5: 2.0, 1.0: 3.0}, "0.1")
    assert moved(golden, samples({0.0: 1.05, 0.5: 2.0, 1.0: 3.0})) == []
    assert moved(golden, samples({0.0: 1.2, 0.5: 1.6, 1.0: 3.0})) == [
        "made fig1, plant x at 0.5 s: golden 2, found 1.6 m (-20 %, 4 times what is allowed)"
    ]
    assert moved(golden, samples({0.0: 1.0, 0.5: 2.0})) == [
        "made fig1, plant x: golden 3 numbers up to 1 s, found 2 numbers up to 0.5 s"
    ]


def kept(step: float, steps: int) -> dict[Key, GoldenNumber]:
    time = np.arange(steps + 1) * step
    both = Channel(np.column_stack([np.sin(time), np.cos(time)]), "m")
    return _samples("plant", Series(time, {"x": both, "x_before": both}))


@pytest.mark.parametrize(("steps", "count"), [(100, 28), (1000, 28), (8, 9), (333, 23), (639, 42)])
def test_samples_are_even_and_unchanged_with_half_the_step(steps: int, count: int) -> None:
    found = kept(0.02, steps)
    values = {float(time): float(one.value) for (_, name, time), one in found.items()
              if name == "x_1"}  # fmt: skip
    assert len(found) == 2 * count
    np.testing.assert_allclose(list(values.values()), np.sin(list(values)), atol=1e-12)
    assert np.ptp(np.diff([0.0, *list(values)[3:]])[1:]) < 1e-9  # two more in the first interval
    assert found.keys() <= kept(0.01, 2 * steps).keys()


def test_record_is_stored_with_the_first_figure_showing_it() -> None:
    figures = {
        "fig1": {"scenario": "slow", "observers": ["a", "b"]},
        "fig2": {"scenario": "slow", "observers": ["b", "c"]},
        "fig3": {"scenario": "fast", "observers": ["a"]},
    }
    tree = {"figures": figures, "theory": {}}
    assert [records(tree, name) for name in figures] == [["plant", "a", "b"], ["c"], ["plant", "a"]]
    assert part_names(tree) == ["fig1", "fig2", "fig3", "theory"]


@pytest.mark.parametrize(
    ("size", "processor", "halved", "allowed"),
    [
        (1.0, 3e-9, 4e-7, 8e-7),  # twice the change with half the step
        (1.0, 3e-9, 1e-8, 3e-8),  # ten times that on another processor
        (300.0, 0.0, 0.0, 3e-10),  # rounding
        (0.0, 0.0, 0.0, 1e-15),
        (1.0, 0.0, 0.0049, 0.0098),
        (1.0, 0.0, 0.0051, None),  # more than one per cent
        (1.0, 1.1e-6, 0.0, None),  # determined by rounding
        (0.71, 0.0, 0.195, None),
        (2e-11, 0.0, 2.5e-11, 5e-11),  # zero except for the step
        (1.0, 0.0, float("inf"), None),
    ],
)
def test_tolerance_follows_from_the_measured_changes(
    size: float, processor: float, halved: float, allowed: float | None
) -> None:
    assert tolerance(size, processor, halved) == allowed


def test_only_changed_numbers_are_updated() -> None:
    """Also in its last digits; a number that has become undetermined is listed."""
    still, new = ("watch", "rms", ""), ("watch", "peak", "")
    golden = {still: GoldenNumber("0.5", "V", "2e-6"), new: GoldenNumber("3", "V", "1e-9")}
    found = {still: GoldenNumber("0.5000001", "V"), new: GoldenNumber("3.1234567", "V")}
    other = {still: GoldenNumber("0.5", "V"), new: GoldenNumber("3.1234568", "V")}
    halved = {still: GoldenNumber("0.6", "V"), new: GoldenNumber("3.1234569", "V")}
    wanted = {still: golden[still], new: GoldenNumber("3.1234567", "V", "1e-06")}
    assert acceptance.renewed(golden, found, [other], halved) == wanted
    halved[new] = GoldenNumber("3.2", "V")
    listed = acceptance.renewed(golden, found, [other], halved)
    assert listed == {still: golden[still], new: GoldenNumber("3.12", "V")}
    found[new] = GoldenNumber("3.2345678", "V")
    again = acceptance.renewed(listed, found, [found], found)
    assert again == {still: golden[still], new: GoldenNumber("3.23", "V")}


def test_each_sample_has_its_own_tolerance() -> None:
    found = samples({0.0: 1.0, 0.5: 2.0, 1.0: float("nan")})
    halved = samples({0.0: 1.0, 0.5: 2.0000084, 1.0: 3.0})
    new = acceptance.renewed({}, found, [found], halved)
    assert [one.tolerance for one in new.values()] == ["2e-12", "1.7e-05", "2e-12"]


def test_update_writes_only_changed_numbers(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    figure = {"scenario": "slow", "observers": []}
    tree = {"figures": dict.fromkeys(("fig1", "fig2"), figure), "theory": {}}
    built = {part: number("0.5", "") for part in part_names(tree)}
    monkeypatch.setattr(acceptance, "built_numbers", lambda folder, tree, part: built[part])
    monkeypatch.setattr(acceptance, "measure", lambda *arguments: [built, built])
    for part in ("fig1", "fig2", "old"):
        write_numbers(golden_file(tmp_path, "made", part), number("0.5000001"))
    golden = golden_file(tmp_path, "made", "fig2")
    golden.write_text(golden.read_text().replace("0.5", "0.6"))
    said = acceptance.renew(tmp_path, tmp_path, tree, "made", 1)
    assert [line.partition(":")[0] for line in said] == [
        "made fig2, watch rms", "made theory", "made old",
    ]  # fmt: skip
    now = {part: read_numbers(path) for part, path in golden_files(tmp_path, "made").items()}
    new = number("0.5", "5e-13")
    assert now == {"fig1": number("0.5000001"), "fig2": new, "theory": new}
    assert acceptance.renew(tmp_path, tmp_path, tree, "made", 1) == []


@pytest.mark.nightly
def test_subprocess_evaluates_like_this_process() -> None:
    golden, here = read_numbers(golden_file(ROOT, "ilo", "fig1")), EVALUATORS["ilo"]
    there = conditions.evaluate(ROOT, "ilo", {})
    assert set(there) == set(part_names(PARAMETER_FILES["ilo"].tree))
    for found in (evaluated_numbers(here, "fig1"), there["fig1"]):
        assert list(compare(golden, found, "")) == []
    halved = conditions.evaluate(ROOT, "ilo", change="halved")
    assert halved["fig1"]["sampled", "rms_error", ""] != there["fig1"]["sampled", "rms_error", ""]


def test_rounding_error_is_one_unit_in_the_last_place() -> None:
    one, other = (
        kind(PARAMETER_FILES["ilo"]).run("plant", "constant")
        for kind in (Evaluator, conditions.Rounded)
    )
    for name, values in one.flat().items():
        off = np.abs(other.flat()[name] - values)
        assert np.all(off <= np.spacing(np.abs(values)))
        assert np.array_equal(off == 0, values == np.round(values))


Reader = Callable[[Path], object]
SPOILED = ("", "nothing", "nan", "1_0", "-1")

# Of each kind: how it is read, and cells that a column may not have.
TABLES: dict[str, tuple[Reader, Mapping[str, tuple[str, ...]]]] = {
    "ilo/fig1.csv": (
        read_numbers,
        {"source": ("",), "quantity": ("",), "time": SPOILED[1:4],
         "value": ("", "nothing", "1_0"), "tolerance": SPOILED[1:]},
    ),
    "lie/table_coefficients.csv": (read_numbers, {"tolerance": SPOILED[1:]}),
    "bench/leak.csv": (
        lambda path: golden_bench.compare_task(path.parents[3], path, "leak"),
        {"method": ("",), "given_noise": ("",), "seeds": SPOILED, "error": ("nothing", "1_0"),
         "within": ("",)},
    ),
    "bench/tolerances.csv": (
        lambda path: golden_bench.read_tolerances(path.parents[3], "delay"),
        {"tolerance": SPOILED[:4]},
    ),
    "claims.csv": (
        lambda path: golden_claims.read_golden(path.parents[2]),
        {"paper": ("",), "verdict": SPOILED, "holds": SPOILED[1:]},
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", TABLES)
def test_spoiled_cell_of_any_golden_table_is_named(tmp_path: Path, name: str) -> None:
    read, columns = TABLES[name]
    path = tmp_path / "tests/golden" / name
    path.parent.mkdir(parents=True)
    header, lines = read_rows(ROOT / "tests/golden" / name)
    rows = [dict(zip(header, line, strict=True)) for line in lines[:3]]
    for column, cells in columns.items():
        for line, cell in itertools.product(range(len(rows)), cells):
            spoiled = [{**row, column: cell} if k == line else row for k, row in enumerate(rows)]
            write_table(path, spoiled, header)
            with pytest.raises(InputError, match=rf"line {line + 2}, {column}: ") as caught:
                read(path)
            assert str(path) in str(caught.value)
        write_table(path, rows, [name for name in header if name != column])
        if column not in ("error", "within"):  # of the bench, which the comparison names
            with pytest.raises(InputError, match="has the columns"):
                read(path)


def test_failing_evaluation_is_reported_in_one_sentence() -> None:
    with pytest.raises(ReobserveError, match=r"^nobody: .*there is no 'nobody'") as caught:
        conditions.evaluate(ROOT, "nobody")
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        (",1.1e-09,", ",-1,", "line 2, tolerance: -1 must be zero or more"),
        (",1.1e-09,", ",small,", "line 2, tolerance: 'small' must be a finite number or empty"),
        ("source,", "observer,", "has the columns"),
        ("sampled,late_rms_error", "sampled,rms_error", "line 4 repeats 'sampled, rms_error, '"),
        (",N m", "", "line 2 has not 6 cells"),
        (",5.7637607769146e-10,", ",,", "line 2, value: '' must be a number, nan or inf"),
    ],
)
def test_damaged_golden_file_is_named(tmp_path: Path, old: str, new: str, said: str) -> None:
    path = tmp_path / "fig1.csv"
    text = golden_file(ROOT, "ilo", "fig1").read_text(encoding="utf-8")
    path.write_text(text.replace(old, new, 1))
    with pytest.raises(InputError, match=said) as caught:
        read_numbers(path)
    assert str(path) in str(caught.value)


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("1", "1.02", "+2 %"), ("1", "0.5", "-50 %"), ("-2", "-3", "-50 %"), ("-2", "-1", "+50 %"),
        ("1", "1.98", "+98 %"), ("1", "2", "x 2"), ("1", "4.3", "x 4.3"), ("-1", "-4.3", "x 4.3"),
        ("1", "330", "x 330"), ("1", "1e-6", "x 1e-06"), ("1", "0", "x 0"), ("1", "-1", ""),
        ("-1", "4.3", ""), ("0", "1", ""), ("1", "nan", ""), ("nan", "1", ""), ("1", "inf", ""),
    ],
)  # fmt: skip
def test_change_is_in_per_cent_or_a_factor(old: str, new: str, said: str) -> None:
    assert Moved("a", old, new, "0.1").relative == said
    assert Moved("a", old, new).relative == ""
    assert "e+" not in str(Moved("a", old, new, "0.1", "m", 3.0))
