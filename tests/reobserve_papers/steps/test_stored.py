"""Files between stages: records, designs, robustness and parameters, checked completely on
reading."""

from __future__ import annotations

import json
import math
import shutil
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as parquet
import pytest

from reobserve.core.errors import InputError
from reobserve.core.validation import parse
from reobserve_papers.cli.main import main
from reobserve_papers.papers.eso import keys as eso_keys
from reobserve_papers.papers.eso.design import stored_design
from reobserve_papers.papers.lie import keys as lie_keys
from reobserve_papers.papers.lie.setup import stored_form
from reobserve_papers.papers.lie.table import rows as table_rows
from reobserve_papers.parameters.job import read_job
from reobserve_papers.parameters.parameters import Parameters
from reobserve_papers.signals.series import Channel, Series
from reobserve_papers.steps import compute as common
from reobserve_papers.steps.build_job import read_series
from reobserve_papers.steps.compute import compute_design, read_design, signed
from reobserve_papers.steps.figures import rows_from
from tests.reobserve_papers.papers import merged
from tests.reobserve_papers.pipeline.conftest import ROOT

Change = Callable[[Series], Series]

# A short record of ilo: the plant of the parameter file over half a second.
SHORT = {
    "plant": {"horizon": 0.5},
    "scenarios": {
        "constant": {"fault": [{"kind": "constant", "axis": 1, "from": 0.25, "size": 1}]}
    },
}


MADE = {"settings": {}, "settings_digest": "a", "code_digest": "b", "packages": {"numpy": "2"}}


@pytest.fixture(scope="module")
def parameters(tmp_path_factory: pytest.TempPathFactory) -> Parameters:
    parameters = Parameters.load(ROOT, "ilo", SHORT)
    path = tmp_path_factory.getbasetemp() / "stored-parameters.json"
    path.write_text(parameters.text())
    return Parameters.read(path)


@pytest.fixture(scope="module")
def made(parameters: Parameters, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with a parameter file, a record and an estimate, made by the command line."""
    folder = tmp_path_factory.mktemp("made") / "results/ilo"
    folder.mkdir(parents=True)
    path = folder / "parameters.json"
    path.write_text(parameters.text())
    assert main(["stage", "plant", str(path), "constant"]) == 0
    assert main(["stage", "observe", str(path), "constant", "sampled"]) == 0
    return folder / "constant"


def record(path: Path, parameters: Parameters, scenario: str = "constant") -> Series:
    return read_series(path, parameters, "plant", scenario)


def estimate(path: Path, parameters: Parameters, observer: str = "sampled") -> Series:
    return read_series(path, parameters, "observe", "constant", observer)


def of(series: Series, **reported: Any) -> Series:
    return replace(series, provenance={**series.provenance, **reported})


RECORDS: dict[str, tuple[Change, str]] = {
    "of another paper": (
        lambda s: of(s, paper="eso"), r"is 'constant' of stage plant of eso, must be 'constant"),
    "an estimate": (lambda s: of(s, stage="observe"), r"of stage observe of ilo, must be 'constan"),
    "of an unknown scenario": (lambda s: of(s, job="mine"), r"is 'mine' of stage plant of ilo"),
    "of another scenario": (
        lambda s: of(s, job="periodic"), r"is 'periodic' of stage plant of ilo, must be 'constant"),
    "of other values": (
        lambda s: of(s, settings_digest="a"), r"was made from other parameters than ilo has now"),
    "of an unknown maker": (
        lambda s: replace(s, provenance={}), r"provenance.paper: is missing; the prov"),
}  # fmt: skip


@pytest.mark.parametrize("case", RECORDS)
def test_record_is_compared_with_the_parameters(
    case: str,
    made: Path,
    parameters: Parameters,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:
    change, said = RECORDS[case]
    folder = tmp_path / "results/ilo"
    path = folder / "constant/plant.parquet"
    path.parent.mkdir(parents=True)
    shutil.copy(made.parent / "parameters.json", folder)
    change(Series.read(made / "plant.parquet")).write(path)
    with pytest.raises(InputError, match=said) as caught:
        record(path, parameters)
    assert str(caught.value).startswith(str(path))
    assert main(["stage", "observe", str(folder / "parameters.json"), "constant", "sampled"]) == 1
    assert capsys.readouterr().err.count("\n") == 1
    assert not path.with_name("sampled.parquet").exists()


def test_unchanged_records_and_estimates_are_accepted(made: Path, parameters: Parameters) -> None:
    plant = record(made / "plant.parquet", parameters)
    found = estimate(made / "sampled.parquet", parameters)
    assert found.time[-1] == plant.time[-1] == 0.5
    with pytest.raises(InputError, match=r"is 'constant' of stage plant of ilo, must be 'periodic"):
        record(made / "plant.parquet", parameters, "periodic")
    with pytest.raises(InputError, match=r"is 'sampled' of .*, must be 'forgetting'"):
        estimate(made / "sampled.parquet", parameters, "forgetting")


@pytest.mark.parametrize(
    "other", [{"horizon": 1.0}, {"step": 5e-4}, {"initial_rate": [0.0, 0.0, 0.0]}]
)
def test_files_of_other_parameters_are_refused(made: Path, other: dict[str, Any]) -> None:
    now = Parameters.load(ROOT, "ilo", {**SHORT, "plant": {**SHORT["plant"], **other}})
    with pytest.raises(InputError, match=r"run the stage plant again$"):
        record(made / "plant.parquet", now)
    with pytest.raises(InputError, match=r"run the stage observe again$"):
        estimate(made / "sampled.parquet", now)


def test_new_labels_leave_files_as_they_are(made: Path) -> None:
    words = {"scenarios": {"constant": {"title": "a"}}, "observers": {"sampled": {"label": "b"}}}
    now = Parameters.load(ROOT, "ilo", {**SHORT, **merged(SHORT, words)})
    assert record(made / "plant.parquet", now)
    assert estimate(made / "sampled.parquet", now)


def test_estimates_must_be_on_the_record_of_the_figure(made: Path, parameters: Parameters) -> None:
    with pytest.raises(InputError, match=r"is an estimate on another record than that of periodic"):
        read_series(made / "sampled.parquet", parameters, "observe", "periodic", "sampled")


@pytest.mark.parametrize("value", [math.nan, math.inf])
def test_values_that_are_not_finite_are_not_written(parameters: Parameters, value: float) -> None:
    rows = np.ones((3, 2))
    rows[1, 1] = value
    series = Series(np.arange(3.0), {"x": Channel(rows, "1")})
    with pytest.raises(InputError, match=r"^ilo.constant: x is not finite at 1 s, must be a num"):
        signed(series, parameters, "plant", "constant", {})


# --- The file of a series -------------------------------------------------------------------------


def small() -> Series:
    time = np.arange(40) * 0.1
    channels = {"x": Channel(np.sin(time), "V"), "r": Channel(np.outer(time, [1.0, 2.0]), "rad/s")}
    return Series(time, channels, {"onsets": (0.5,)}, {"seed": 1})


def test_flipped_bit_is_refused_or_has_no_effect(tmp_path: Path) -> None:
    """For every 23rd bit of a small file: reading gives the original or refuses."""
    path, series = tmp_path / "run.parquet", small()
    series.write(path)
    whole, refused = path.read_bytes(), 0
    for bit in range(0, 8 * len(whole), 23):
        damaged = bytearray(whole)
        damaged[bit // 8] ^= 1 << bit % 8
        path.write_bytes(damaged)
        try:
            found = Series.read(path)
        except InputError:
            refused += 1
            continue
        assert found.time.tobytes() == series.time.tobytes()
        assert all(found[name].tobytes() == series[name].tobytes() for name in series.channels)
        assert (found.events, found.provenance) == (series.events, series.provenance)
        assert [c.unit for c in found.channels.values()] == ["V", "rad/s"]
    assert refused > 8 * len(whole) / 23 / 3


ABOUT = {
    "channels": {"x": {"unit": "V", "components": None}},
    "events": {"onsets": [0.5]},
    "provenance": {},
}
COLUMNS = {"time": [0.0, 1.0], "x": [1.0, 2.0]}


@pytest.mark.parametrize(
    ("about", "columns", "said"),
    [
        ("{", COLUMNS, "is not JSON"),
        ("[]", COLUMNS, "must be a mapping of keys to values"),
        ("null", COLUMNS, "must be a mapping of keys to values"),
        ({**ABOUT, "more": 1}, COLUMNS, r"run.parquet.more: unknown key"),
        ({**ABOUT, "events": None}, COLUMNS, "events: None must be a mapping"),
        ({**ABOUT, "events": {"a": ["x"]}}, COLUMNS, r"events.a.0: 'x' is not a number"),
        ({**ABOUT, "channels": []}, COLUMNS, r"channels: \[\] must be a mapping"),
        ({**ABOUT, "channels": {"x": 1}}, COLUMNS, "channels.x: 1 must be a mapping"),
        (
            {**ABOUT, "channels": {"x": {"unit": "V"}}},
            COLUMNS, "channels.x.components: is missing; the stored channel needs it",
        ),
        (
            {**ABOUT, "channels": {"x": {"unit": "V", "components": 10**9}}},
            COLUMNS, "components: must be a number of columns",
        ),
        (
            {**ABOUT, "channels": {"x": {"unit": "parsecond", "components": None}}},
            COLUMNS, "unit: 'parsecond' is no unit",
        ),
        (ABOUT, {"time": [0.0, 1.0]}, r"has the columns \['time'\], not those of its metadata"),
        (ABOUT, {"x": [0.0, 1.0]}, r"has the columns \['x'\], not those of its metadata"),
        (ABOUT, {**COLUMNS, "y": [1.0, 2.0]}, "has the columns .*, not those of its metadata"),
        (ABOUT, {**COLUMNS, "x": ["a", "b"]}, "the column 'x' must hold floats, and no gaps"),
        (ABOUT, {**COLUMNS, "x": [1.0, None]}, "the column 'x' must hold floats, and no gaps"),
        (ABOUT, {**COLUMNS, "x": [1, 2]}, "the column 'x' must hold floats, and no gaps"),
        (ABOUT, COLUMNS, "is damaged: its values are not those that were written"),
    ],
)  # fmt: skip
def test_file_from_another_program_is_refused(
    about: Any, columns: dict[str, list[Any]], said: str, tmp_path: Path
) -> None:
    path = tmp_path / "run.parquet"
    text = about if isinstance(about, str) else json.dumps(about)
    reported = {b"reobserve": text.encode(), b"reobserve.sha256": b"0" * 64}
    parquet.write_table(pa.table(columns).replace_schema_metadata(reported), path)
    with pytest.raises(InputError, match=said) as caught:
        Series.read(path)
    assert str(caught.value).startswith(str(path))
    reported.pop(b"reobserve.sha256")
    parquet.write_table(pa.table(columns).replace_schema_metadata(reported), path)
    with pytest.raises(InputError, match="has no digest of its values"):
        Series.read(path)


def test_series_with_non_finite_time_is_refused() -> None:
    for end in (np.inf, np.nan):
        with pytest.raises(InputError, match=r"^time: must be one column of increasing numbers$"):
            Series(np.array([0.0, 1.0, end]), {})


# --- Designs --------------------------------------------------------------------------------------

BALL = {"poles": [[-1.0, 0.0]], "norm_lower": 0.1, "norm_upper": 0.2, "floor": 0.1, "reason": ""}
ESO = {
    "filter_rate": 1.0, "method": "pi", "L": [[1.0, 0.0]] * 6, "Ld": [[0.0, 0.0]] * 6,
    "gamma": None, "solver": "SCS", "status": "optimal", "objective": 1.0, "lower": None,
    "radius": None, "certificate": BALL,
}  # fmt: skip


def eso_plant() -> eso_keys.Plant:
    return parse(eso_keys.Plant, Parameters.load(ROOT, "eso").section("plant"))


def test_eso_design_is_read_into_its_type() -> None:
    system, found = stored_design(eso_plant(), ESO)
    assert found.gains.L.shape == (system.size, 2)
    assert found.certificate.poles == ((-1.0, 0.0),)
    assert found.to_dict() == {name: value for name, value in ESO.items() if name != "filter_rate"}


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"L": [[1.0, 0.0]] * 5}, r"^design.L: has shape \(5, 2\), must be \(6, 2\)$"),
        (
            {"Ld": [[1.0, 0.0]] * 5 + [[1.0]]},
            r"^design.gains.Ld: .* is not a number or an array of numbers$",
        ),
        (
            {"L": [["x", 0.0]] * 6},
            r"^design.gains.L: \[\['x', 0.0\].* is not a number or an array of",
        ),
        ({"L": None}, "^design.gains.L: None is not a number or an array of numbers$"),
        ({"L": [[float("inf"), 0.0]] * 6}, "design.gains.L.5.0: inf must be a finite number$"),
        ({"gamma": "1"}, "^design.gamma: '1' is not a number"),
        ({"status": 1}, "^design.status: 1 must be a word$"),
        ({"filter_rate": None}, "^filter_rate: "),
        ({"filter_rate": -1.0}, "^filter_rate: "),
        ({"certificate": {}}, "^design.certificate.poles: is missing"),
        ({"certificate": {**BALL, "poles": [[1.0]]}}, r"poles.0.1: is missing$"),
        (
            {"certificate": {**BALL, "floor": True}},
            "^design.certificate.floor: True is not a number",
        ),
        ({"more": 1}, "^design.more: unknown key"),
    ],
)
def test_invalid_eso_design_is_refused(change: dict[str, Any], said: str) -> None:
    with pytest.raises(InputError, match=said):
        stored_design(eso_plant(), {**ESO, **change})
    for name in ESO.keys() - {"lower", "radius"}:
        rest = {key: value for key, value in ESO.items() if key != name}
        with pytest.raises(InputError, match=r"is missing|has no key"):
            stored_design(eso_plant(), rest)


@pytest.mark.parametrize("value", [math.nan, math.inf])
def test_non_finite_design_is_refused(value: float, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(common, "compute", lambda *_: {"gain": [[1.0, value]]})
    with pytest.raises(InputError, match=r"^lie.designs.linear: gives a number that is not finite"):
        compute_design(Parameters.load(ROOT, "lie"), "linear")


def test_invalid_lie_design_is_refused() -> None:
    parameters = Parameters.load(ROOT, "lie")
    settings, design = parameters.settings("design", "linear"), compute_design(parameters, "linear")
    job = read_job(lie_keys.Parameters, settings)
    form = stored_form(job.plant, job.design, design)
    np.testing.assert_array_equal(form.S.coefficients, design["S"])
    for change, said in (
        ({"S": design["S"][:1]}, "^design.S: has 1 rows, must have 2$"),
        ({"T": [row[:-1] for row in design["T"]]}, "^coefficients: has shape"),
        ({"gain": design["gain"][:-1]}, "^design.gain: has 3 rows, must have 4$"),
        ({"monomials": design["monomials"][::-1]}, "^design.monomials: are not those up to degree"),
        ({"S": "x"}, "^design.S: 'x' is not a number"),
        ({"more": 1}, "^design.more: unknown key"),
    ):
        with pytest.raises(InputError, match=said):
            stored_form(job.plant, job.design, {**design, **change})
    table = parameters.settings("table", "table_coefficients")
    table["table"]["degree"] = 30
    with pytest.raises(InputError, match=r"^degree: 30 is beyond that of the design"):
        table_rows(read_job(lie_keys.Parameters, table), design)


def test_design_for_another_observer_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "gains.design.json"
    reported = {"paper": "eso", "stage": "design", "job": "pi", **MADE}
    path.write_text(json.dumps({"design": ESO, "provenance": reported}))
    assert read_design(path, "eso", "pi") == ESO
    with pytest.raises(InputError, match=r"is 'pi' of eso, must be 'pd' of eso$"):
        read_design(path, "eso", "pd")
    path.write_text(json.dumps({"design": ESO, "provenance": {**reported, "stage": "search"}}))
    with pytest.raises(InputError, match=r"is 'pi' of eso, must be 'pi' of eso$"):
        read_design(path, "eso", "pi")
    path.write_text('{"design": {"a": NaN}, "provenance": {}}')
    with pytest.raises(InputError, match=r"design.a: nan must be a finite number$"):
        read_design(path, "eso", "pi")


# --- Parameter files, studies
# -----------------------------------------------------------------


@pytest.mark.parametrize(
    "change",
    [
        lambda t: t.clear(),
        lambda t: t.pop("sha256"),
        lambda t: t.pop("parameters"),
        lambda t: t.update(sha256=None),
        lambda t: t.update(seed=t["seed"] + 1),
        lambda t: t.update(paper="../x"),
        lambda t: t.update(more=1),
        lambda t: t["parameters"].pop("plant"),
        lambda t: t["parameters"].update(figures=[]),
        lambda t: t["parameters"]["figures"]["fig1"].update(scenario="x"),
        lambda t: t["parameters"]["plant"]["step"].update(value=2e-4),
        lambda t: t["parameters"]["plant"]["step"].pop("source"),
    ],
)
def test_changed_parameter_file_is_refused(change: Callable[[Any], Any], tmp_path: Path) -> None:
    path = tmp_path / "parameters.json"
    stored = json.loads(Parameters.load(ROOT, "ilo").text())
    path.write_text(json.dumps(stored))
    assert Parameters.read(path) == Parameters.load(ROOT, "ilo")
    change(stored)
    path.write_text(json.dumps(stored))
    with pytest.raises(InputError, match=r"parameters\.json: is not what was written"):
        Parameters.read(path)


def test_missing_study_rows_are_reported_with_the_file() -> None:
    found: dict[str, int] = {}
    with pytest.raises(InputError, match=r"^a.csv: has not the rows"), rows_from(Path("a.csv")):
        _ = found["x"]
    with pytest.raises(KeyError), rows_from(None):
        _ = found["x"]
    with pytest.raises(InputError, match=r"^b: c$"), rows_from(Path("a.csv")):
        raise InputError("b", "c")
