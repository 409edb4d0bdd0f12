"""Golden numbers are renewed with tolerances that were measured, and keep what has not moved."""

from __future__ import annotations

import platform
from collections.abc import Mapping
from pathlib import Path
from types import SimpleNamespace
from typing import Any, ClassVar

import llvmlite.binding
import numpy as np
import pytest

from reobserve.errors import InputError, ReobserveError
from reobserve.evidence.golden import digests, files, kept, tables
from reobserve.evidence.golden.comparison import Worst, compare, differences
from reobserve.evidence.golden.files import Golden, text_of, write_series
from reobserve.evidence.golden.kept import Kept, KeptPaper, kept_records
from reobserve.evidence.golden.renewal import Evidence, _at_times_of, prepare
from reobserve.evidence.golden.tolerances import (
    Tolerance,
    determined,
    measured,
    rounded_up,
    two_digits_up,
)
from reobserve.timeseries.series import Channel, Series

TIME = np.arange(21) * 0.1
ULP = 2.0**-52
KEPT = sorted((Path(__file__).parents[2] / "golden").glob(f"*/{digests.FILE}"))


def figure(series: Mapping[str, object], **metrics: float) -> KeptPaper:
    part = Kept(
        {name: Channel(np.asarray(values, dtype=float), "V") for name, values in series.items()},
        {f"watch:{name}": Channel(np.array([value]), "1") for name, value in metrics.items()},
    )
    return KeptPaper({"fig1": part}, {"plant slow": "ab", "metrics fig1": "cd"})


def moved(golden: Path, found: KeptPaper) -> list[str]:
    return list(map(str, compare(found.parts["fig1"], "ilo", "fig1", golden)))


def contents(golden: Path) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in golden.iterdir()}


def test_rounding_is_up_to_one_two_five() -> None:
    numbers = [1e-12, 1.0001e-12, 2e-9, 2.1e-9, 5.0, 5.1, 0.7, 9.99e7]
    assert list(map(rounded_up, numbers)) == [1e-12, 2e-12, 2e-9, 5e-9, 5.0, 10.0, 1.0, 1e8]


def test_steps_are_rounded_up_to_two_digits() -> None:
    numbers = [3.16e-4, 0.3, 1.0e-7, 1.001e-7, 99.2, 5e22]
    assert list(map(two_digits_up, numbers)) == [3.2e-4, 0.3, 1.0e-7, 1.1e-7, 100.0, 5e22]


def test_a_tolerance_is_ten_times_what_was_seen_and_twice_what_halving_changed() -> None:
    assert measured(3e-9, 4e-7, 1.0) == Tolerance(5e-8, 8e-7)
    assert measured(3e-9, 4e-7, 1.0).allowed == 8e-7
    assert measured(3e-9, 2e-8, 1.0) == Tolerance(5e-8)  # halving changes less than rounding
    assert measured(0, 0, 300.0) == Tolerance(5e-10)  # of the largest number of the column
    assert measured(0, 0, 0.0) == Tolerance(1e-15)


@pytest.mark.parametrize(
    ("seen", "halved", "stays"),
    [
        (3e-9, 4e-7, True),
        (9e-9, 4e-7, True),  # still five times what was seen
        (1.1e-8, 4e-7, False),
        (6e-11, 4e-7, True),
        (4e-11, 4e-7, False),  # a thousand times too large
        (3e-9, 9e-7, True),
        (3e-9, 2e-6, False),
        (3e-9, 4e-9, False),  # a step that was there is gone
    ],
)
def test_a_tolerance_stays_while_it_is_right(seen: float, halved: float, stays: bool) -> None:
    before = Tolerance(5e-8, 1e-6)
    assert (measured(seen, halved, 1.0, before) == before) is stays


def test_what_rounding_moves_by_a_millionth_is_not_determined() -> None:
    assert determined(1e-6, 1.0)
    assert not determined(1.1e-6, 1.0)
    assert not determined(2e-7, 1.0, before=False)  # once left out, it must be clearly better
    assert determined(1e-10, 1e-13)  # a zero but for rounding
    assert not determined(float("nan"), 1.0)


def test_a_series_and_its_tolerances_are_written(tmp_path: Path) -> None:
    wave = np.sin(TIME)
    here = figure({"plant.x": wave}, rms=0.5)
    there = figure({"plant.x": wave + 3e-9}, rms=0.5)
    fine = figure({"plant.x": wave * (1 + 1e-5)}, rms=0.5 + 1e-4)
    renewal = prepare("ilo", Evidence(here, [there], fine), tmp_path)
    assert contents(tmp_path) == {}  # nothing is written before all is known
    assert renewal.moved[0].startswith("ilo fig1: written anew (")
    renewal.write()
    assert (tmp_path / "fig1.tolerances.csv").read_text() == (
        "column,unit,rounding,step\nplant.x,V,5e-08,2e-05\n"
    )
    assert (tmp_path / "fig1.metrics.csv").read_text() == (
        "observer,metric,value,unit,rounding,step\nwatch,rms,0.5,1,5e-13,0.0002\n"
    )
    assert moved(tmp_path, here) == []
    assert moved(tmp_path, figure({"plant.x": wave + 1.9e-5}, rms=0.5)) == []
    wave[3] += 2.1e-5
    assert moved(tmp_path, figure({"plant.x": wave}, rms=0.5003)) == [
        "ilo fig1, plant.x at 0.3 s: golden 0.295520207, found 0.295541207, "
        "off by 2.1e-05, allowed 2e-05",
        "ilo fig1, watch:rms: golden 0.5, found 0.5003, off by 0.0003, allowed 0.0002",
    ]


@pytest.fixture
def written(tmp_path: Path) -> Path:
    here = figure({"plant.x": np.sin(TIME), "watch.x": np.cos(TIME)}, rms=0.5, ratio=np.nan)
    prepare("ilo", Evidence(here, [here], here), tmp_path).write()
    return tmp_path


def test_a_nan_in_a_series_deviates(written: Path) -> None:
    hole = np.sin(TIME)
    hole[7] = np.nan
    found = figure({"plant.x": hole, "watch.x": np.cos(TIME)}, rms=0.5, ratio=np.nan)
    (said,) = moved(written, found)
    assert said.startswith("ilo fig1, plant.x at 0.7 s: golden 0.644217687, found nan")
    found = figure({"plant.x": np.sin(TIME), "watch.x": np.cos(TIME)}, rms=np.nan, ratio=1.0)
    assert len(moved(written, found)) == 2


@pytest.mark.parametrize("rows", [20, 22])
def test_a_shorter_and_a_longer_series_deviate(written: Path, rows: int) -> None:
    longer = np.sin(np.arange(rows) * 0.1)
    found = figure({"plant.x": longer, "watch.x": np.cos(TIME)}, rms=0.5, ratio=np.nan)
    (said,) = moved(written, found)
    assert said.startswith(f"ilo fig1, rows of plant.x: golden 21, found {rows}")
    worst = Worst.of(differences(found.parts["fig1"], "ilo", "fig1", written))
    assert (worst.ratio, worst.count, worst.exceeded) == (np.inf, 4, 1)


def test_other_names_do_not_fit(written: Path) -> None:
    with pytest.raises(InputError, match=r"fig1\.series\.csv: does not fit .*'watch\.x'"):
        moved(written, figure({"plant.x": np.sin(TIME)}, rms=0.5, ratio=np.nan))
    both = {"plant.x": np.sin(TIME), "watch.x": np.cos(TIME)}
    more = figure(both, rms=0.5, ratio=np.nan, more=1)
    with pytest.raises(InputError, match=r"fig1\.metrics\.csv: does not fit .*'watch:more'"):
        moved(written, more)


def test_renewing_on_another_processor_changes_no_byte(written: Path) -> None:
    """All in the last places is other: the bytes stay, and so do tolerances."""
    before = contents(written)
    rng = np.random.default_rng(1)

    def other(scale: float) -> KeptPaper:
        def shaken(values: np.ndarray) -> np.ndarray:  # type: ignore[type-arg]
            return values * (1 + scale * ULP * rng.uniform(-1, 1, values.shape))

        both = {"plant.x": shaken(np.sin(TIME)), "watch.x": shaken(np.cos(TIME))}
        return figure(both, rms=0.5 * (1 + ULP), ratio=np.nan)

    renewal = prepare("ilo", Evidence(other(100), [other(100), other(20)], other(100)), written)
    renewal.write()
    assert contents(written) == before
    assert renewal.moved == []


def test_only_what_moved_is_renewed(written: Path) -> None:
    before = (written / "fig1.series.csv").read_text().splitlines()
    wave = np.sin(TIME)
    wave[3] += 1e-3
    found = figure({"plant.x": wave, "watch.x": np.cos(TIME)}, rms=0.5, ratio=np.nan)
    renewal = prepare("ilo", Evidence(found, [found], found), written)
    assert [line.partition(":")[0] for line in renewal.moved] == ["ilo fig1, plant.x at 0.3 s"]
    renewal.write()
    after = (written / "fig1.series.csv").read_text().splitlines()
    assert after != before
    assert [row.split(",")[2] for row in after] == [row.split(",")[2] for row in before]
    assert moved(written, found) == []


def test_another_unit_alone_is_renewed(written: Path) -> None:
    """The digits are new, too: those that were kept were never of this unit."""
    numbers = {"plant.x": np.sin(TIME) + 3e-13, "watch.x": np.cos(TIME)}
    found = figure(numbers, rms=0.5, ratio=np.nan)
    series = found.parts["fig1"].series
    series["plant.x"] = Channel(series["plant.x"].values, "A")  # type: ignore[index]
    prepare("ilo", Evidence(found, [found], found), written).write()
    kept_now = files.read_series(written, "fig1")
    assert kept_now["plant.x"].unit == "A"
    assert kept_now["plant.x"].text == files.text_of(numbers["plant.x"])
    assert kept_now["watch.x"].unit == "V"


def test_the_processor_that_moves_most_sets_the_tolerance(tmp_path: Path) -> None:
    wave = np.sin(TIME)
    here, *others = (figure({"plant.x": wave + off}, rms=0.5) for off in (0.0, 3e-9, 1e-11, 0.0))
    prepare("ilo", Evidence(here, others, here), tmp_path).write()
    tolerance = files.read_series(tmp_path, "fig1")["plant.x"].tolerance
    assert tolerance == measured(3e-9, 0.0, 1.0)
    assert tolerance != measured(1e-11, 0.0, 1.0)


def test_what_is_chaotic_is_listed_and_not_kept(tmp_path: Path) -> None:
    wave = np.sin(TIME)
    here = figure({"plant.x": wave, "wild.x": wave}, rms=0.5, wild_rms=2.0, residual=1e-13)
    there = figure(
        {"plant.x": wave, "wild.x": wave + 3e-5}, rms=0.5, wild_rms=np.nan, residual=3e-13
    )
    prepare("ilo", Evidence(here, [there], here), tmp_path).write()
    assert files.read_undetermined(tmp_path) == {"fig1": {"wild.x": 3e-05, "watch:wild_rms": 1.0}}
    assert list(files.read_series(tmp_path, "fig1")) == ["plant.x"]
    assert list(files.read_metrics(tmp_path, "fig1")) == ["watch:rms", "watch:residual"]
    assert moved(tmp_path, there) == []
    # Renewed, they stay out, with the number that was seen first.
    before = contents(tmp_path)
    there = figure({"plant.x": wave, "wild.x": wave + 1e-5}, rms=0.5, wild_rms=9.0, residual=3e-13)
    prepare("ilo", Evidence(here, [there], here), tmp_path).write()
    assert contents(tmp_path) == before
    # Mended, they come back, and the list goes.
    prepare("ilo", Evidence(here, [here], here), tmp_path).write()
    assert files.read_undetermined(tmp_path) == {}
    assert not (tmp_path / files.UNDETERMINED).exists()
    assert list(files.read_series(tmp_path, "fig1")) == ["plant.x", "wild.x"]


def test_anew_means_new_digits_and_tolerances(written: Path) -> None:
    wave = {"plant.x": np.sin(TIME) * (1 + 100 * ULP), "watch.x": np.cos(TIME)}
    found = figure(wave, rms=0.5, ratio=np.nan)
    before = contents(written)
    prepare("ilo", Evidence(found, [found], found), written).write()
    assert contents(written) == before
    prepare("ilo", Evidence(found, [found], found), written, anew=True).write()
    assert contents(written)["fig1.series.csv"] != before["fig1.series.csv"]


def test_a_processor_is_read_of_as_the_compiler_reads_it() -> None:
    if platform.system() != "Linux" or platform.machine() != "x86_64":
        assert not digests.fused_multiply_add()
        return
    features = llvmlite.binding.get_host_cpu_features()
    flags = digests.processor_flags()
    assert {"fpu", "sse2"} <= flags
    assert {name: name in flags for name in ("avx", "avx2", "fma", "bmi1")} == {
        name: features.get(feature, False)
        for name, feature in {"avx": "avx", "avx2": "avx2", "fma": "fma", "bmi1": "bmi"}.items()
    }
    assert digests.fused_multiply_add() is (features["avx2"] and features["fma"])


def test_digests_stay_where_another_processor_renews(
    written: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    here = digests.environment()
    kept_numbers = figure({"plant.x": np.sin(TIME), "watch.x": np.cos(TIME)}, rms=0.5, ratio=np.nan)
    other = KeptPaper(kept_numbers.parts, {"plant slow": "ab", "metrics fig1": "ee"})
    said = digests.first_difference(written, other.digests)
    assert said == "1 of 2 stages differ in their last bits, the first is `metrics fig1`"
    monkeypatch.setattr(digests, "environment", lambda: {**here, "numpy": "3.0"})
    said = digests.first_difference(written, other.digests)
    assert said.endswith(f"; the digests were made under numpy {here['numpy']}, here 3.0")
    before = contents(written)
    prepare("ilo", Evidence(other, [other], other), written).write()
    assert contents(written) == before
    monkeypatch.undo()
    prepare("ilo", Evidence(other, [other], other), written).write()
    assert digests.first_difference(written, other.digests) == ""


def test_a_damaged_digest_is_named(written: Path) -> None:
    path = written / digests.FILE
    for text in ("{", "[]", '{"environment": 1, "stages": {}}', "[" * 100_000):
        path.write_text(text)
        with pytest.raises(InputError, match="is damaged") as caught:
            digests.read(written)
        assert len(str(caught.value)) < 200 + len(str(path))
    path.unlink()
    with pytest.raises(InputError, match="cannot be read"):
        digests.read(written)


@pytest.mark.parametrize("path", KEPT, ids=lambda path: path.parent.name)
def test_digests_that_are_written_again_are_the_same_bytes(path: Path, tmp_path: Path) -> None:
    where, stages = digests.read(path.parent)
    digests.write(tmp_path, stages, where)
    assert (tmp_path / digests.FILE).read_bytes() == path.read_bytes()


def test_digests_are_a_line_each(tmp_path: Path) -> None:
    digests.write(tmp_path, {"plant slow": "ab"}, {"numpy": "3.0"})
    wanted = (
        '{\n "environment": {\n  "numpy": "3.0"\n },\n "stages": {\n  "plant slow": "ab"\n }\n}\n'
    )
    assert (tmp_path / digests.FILE).read_text() == wanted


ROWS = (
    {"term": "x1", "printed": "2.5", "computed": "2.0"},
    {"term": "x1 x2", "printed": "", "computed": "3000000.0"},
    {"term": "x2^2", "printed": "-", "computed": "0.0"},
)


def table(*rows: Mapping[str, str]) -> KeptPaper:
    return KeptPaper({"table1": Kept(cells=tuple(map(dict, rows)))}, {})


def test_a_table_keeps_its_text_within_rounding(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for module in (kept, tables):
        monkeypatch.setattr(module, "paper_module", lambda paper, stage: _Header)
    here = table(*ROWS)
    there = table(ROWS[0] | {"computed": "2.00000001"}, *ROWS[1:])
    prepare("ilo", Evidence(here, [there], here), tmp_path).write()
    assert (tmp_path / "table1.tolerances.csv").read_text() == (
        "column,unit,rounding,step\ncomputed,,5e-06,0\n"
    )
    before = contents(tmp_path)
    prepare("ilo", Evidence(there, [here], there), tmp_path).write()
    assert contents(tmp_path) == before
    words = table(ROWS[0] | {"printed": "2.6"}, *ROWS[1:])
    with pytest.raises(
        ReobserveError, match="ilo table1: the words in 'printed' depend on the proc"
    ):
        prepare("ilo", Evidence(here, [words], here), tmp_path)
    assert contents(tmp_path) == before


class _Header:
    HEADER = ("term", "printed", "computed")
    KINDS: ClassVar[dict[str, Any]] = {}


@pytest.mark.parametrize(
    ("step", "period", "rows"), [(0.25, 0.25, 9), (0.03, 0.06, 5), (0.05, 0.1, 5), (2.0, 2.0, 9)]
)
def test_rows_are_kept_at_times_that_the_record_has(
    tmp_path: Path, step: float, period: float, rows: int
) -> None:
    """Also where a step is longer than the usual period, or does not divide it."""
    time = np.arange(9) * step
    series = Series(time, {"x": Channel(np.sin(time), "m")}, {}, {})
    evaluation: Any = SimpleNamespace(plant=series, estimates={})
    kept = kept_records(evaluation, "slow")["slow/plant"]
    assert kept.period == pytest.approx(period, rel=1e-12)
    column = Golden(text_of(kept.series["x"].values), "m", Tolerance(1e-12))
    write_series(tmp_path, "slow", {"x": column}, kept.period)
    table = np.loadtxt(tmp_path / "slow.series.csv", delimiter=",", skiprows=1)
    assert len(table) == rows
    np.testing.assert_allclose(table[:, 1], np.sin(table[:, 0]), atol=1e-12)
    # Halving the step changes no value here; rows are compared at the times that both have.
    half = np.arange(17) * step / 2
    finer = Series(half, {"x": Channel(np.sin(half), "m")}, {}, {})
    refined = kept_records(SimpleNamespace(plant=finer, estimates={}), "slow")["slow/plant"]  # type: ignore[arg-type]
    found = _at_times_of(kept, refined)["x"].values
    there = np.isfinite(found)
    assert there[0]
    assert there.sum() > 1
    np.testing.assert_allclose(found[there], kept.series["x"].values[there], atol=1e-12)
