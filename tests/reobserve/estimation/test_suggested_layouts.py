"""Suggested specifications of the layouts of common loggers: what they read, and what they ask."""

from __future__ import annotations

import json
import re
from collections.abc import Callable, Iterable, Mapping
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from reobserve.cli.main import main
from reobserve.core.documents import dumped, parse_yaml
from reobserve.core.validation import parse
from reobserve.estimation.data_report import DataReport
from reobserve.estimation.dialect import Dialect
from reobserve.estimation.families.examples import examples, simulated
from reobserve.estimation.layout import lay_out
from reobserve.estimation.record_file import File
from reobserve.estimation.specification import Specification
from reobserve.estimation.suggestion import suggest
from tests.reobserve.estimation.test_suggestion import LAYOUTS

KALMAN: dict[str, Any] = {
    "kind": "kalman", "time": "discrete", "A": [[1.0]], "C": [[1.0]], "Q": 0.01, "R": 1.0,
    "initial_state": [0.0], "initial_covariance": 1.0e6,
}  # fmt: skip
START = datetime(2024, 6, 27, 23, 59, 30, tzinfo=UTC)
EPOCH = 1719532770000000000  # [ns]
ROWS = 200


class Log(NamedTuple):
    """A text, its times [s] and first measured values, and answers to what is asked, by key."""

    text: str
    times: list[float]
    values: list[float]
    answers: dict[str, Any]
    unsure: frozenset[str]  # besides the answers


def value(k: int) -> float:
    return round(20.0 + 0.7 * np.sin(0.1 * k) + 0.01 * (k % 7), 4)


def stamp(form: str, seconds: float) -> str:
    date = START + timedelta(seconds=seconds)
    return f"{date:{form}}" if not form.endswith("%f") else f"{date:{form}}"[:-3]


def log(
    line: Any,
    above: str,
    period: float,
    unsure: Iterable[str] = (),
    count: int = ROWS,
    **answers: Any,
) -> Log:
    """A log with lines by the number of the row, its time and its value."""
    times = [k * period for k in range(count)]
    values = [value(k) for k in range(count)]
    lines = [line(k, times[k], values[k]) for k in range(count)]
    keys = {key.replace("__", "."): part for key, part in answers.items()}
    return Log(above + "\n".join(lines) + "\n", times, values, keys, frozenset(unsure))


UNIT, ZONE, DAY = "columns.time.unit", "columns.time.zone", "columns.time.day"
LVM = "LabVIEW Measurement\t\nX_Dimension\tTime\tTime\t\n***End_of_Header***\t\t\t\n"
VBO = (
    "File created on 27/06/2024 at 23:59:30\n\n[header]\nsatellites\ntime\nvelocity kmh\n\n"
    "[column names]\ntime velocity sats\n\n[data]\n"
)
LOGS: dict[str, Log] = {
    "LabVIEW": log(
        lambda k, t, y: f"{t:.3f}\t{y}\t0.5", LVM + "X_Value\tVoltage\tCurrent\tComment\n", 0.001,
        {UNIT},
    ),
    "ulog2csv": log(
        lambda k, t, y: f"{112500000 + 4000 * k},{y},-0.1", "timestamp,xyz[0],xyz[1]\n", 0.004,
        **{"columns__time__unit": "us", "sampling__period": 0.004},
    ),
    "rostopic": log(
        lambda k, t, y: f"{EPOCH + k * 10**7},{k},{EPOCH + k * 10**7 - 9876},{y}",
        "%time,field.header.seq,field.header.stamp,field.x\n", 0.01,
    ),
    "EuRoC": log(
        lambda k, t, y: f"{1403636579758555392 + k * 5 * 10**6},{y},0.02",
        "#timestamp [ns],w_RS_S_x [rad s^-1],w_RS_S_y [rad s^-1]\n", 0.005,
    ),
    "Maccor": log(
        lambda k, t, y: f"{k}\t1\tC\t{t:.1f}\t{t:.1f}\t{y}\t{stamp('%m/%d/%Y %I:%M:%S %p', t)}",
        "Today's Date 07/01/2024  Date of Test:\t06/27/2024\nRec#\tCyc#\tStep\tTest (Sec)\tStep "
        "(Sec)\tVolts\tDPt Time\n", 10.0, {ZONE},
    ),
    "Torque": log(
        lambda k, t, y: f"Thu Jun 27 2024,{stamp('%d-%b-%Y %H:%M:%S.%f', t)},{y},-",
        "GPS Time,Device Time,Speed (km/h),Bearing\n", 1.0, {ZONE},
    ),
    "TOA5": log(
        lambda k, t, y: f'"{stamp("%Y-%m-%d %H:%M:%S.%f", t)}",{1000 + k},{y},100.2',
        '"TOA5","6843","CR3000","6843","CR3000.Std.22","CPU:FLUX.CR3","24006","ts"\n"TIMESTAMP",'
        '"RECORD","Ts","press"\n"TS","RN","C","kPa"\n"","","Avg","Smp"\n', 0.05, {ZONE},
    ),
    "InfluxDB": log(
        lambda k, t, y: ",,0,2024-06-27T00:00:00Z,2024-06-29T00:00:00Z,"
        f"{stamp('%Y-%m-%dT%H:%M:%S', t)}Z,{y},flow,boiler",
        "#group,false,false,true,true,false,false,true,true\n#datatype,string,long,dateTime:RFC3339,"
        "dateTime:RFC3339,dateTime:RFC3339,double,string,string\n#default,mean,,,,,,,\n"
        ",result,table,_start,_stop,_time,_value,_field,_measurement\n", 10.0,
    ),
    "simulated events": Log(
        "time,w\n" + "".join(
            f"{one},{20 + one}\n" for k in range(60)
            for one in [round(0.1 * k, 1)] + [round(0.1 * k, 1), 0.1 * k + 2e-10] * (k == 20)
        ),
        [0.1 * k for k in range(2)], [], {"sampling.repeated": "last"},
        frozenset({UNIT, "sampling.uneven"}),
    ),
    "OpenModelica": log(
        lambda k, t, y: f"{t:.6g},{y},0", '"time","motor.w","motor.u"\n', 0.1, {UNIT}
    ),
    "Home Assistant": log(
        lambda k, t, y: f"sensor.t,{y},{stamp('%Y-%m-%dT%H:%M:%S.%f', t)}Z",
        "entity_id,state,last_changed\n", 30.0,
    ),
    "Betaflight": log(
        lambda k, t, y: f"{32 * k},{51230000 + 500 * k},{y},3",
        '"Product","Blackbox flight data recorder"\n"Firmware","Betaflight"\n"loopIteration",'
        '"time (us)","gyroADC[0]","debug[1]"\n', 0.0005,
    ),
    "Xsens": log(
        lambda k, t, y: f"{(65400 + k) % 65536},,{y}",
        "// Start Time: Unknown\n// Sample rate: 100.0Hz\n// Firmware Version: 4.0.2\n"
        "PacketCounter,SampleTimeFine,Acc_X\n", 0.01, {"columns.time.wrap"},
        **{"columns__time__unit": "cs", "columns__time__column": "PacketCounter",
           "sampling__period": 0.01},
    ),
    "VBOX": log(
        lambda k, t, y: f"{stamp('%H%M%S.%f', t)[:-1]} {y} 008", VBO, 0.2,
        **{"columns__time__day": "2024-06-27"},
    ),
    "SIMATIC": log(
        lambda k, t, y: f'"Level";"{stamp("%d.%m.%Y %H:%M:%S", t)}";{y};1;{45383460322.81 + k:.2f}'
        .replace(".00\"", "").replace(".", ",").replace(",06,", ".06."),
        '"VarName";"TimeString";"VarValue";"Validity";"Time_ms"\n', 2.0, {ZONE},
    ),
    "elapsed": log(
        lambda k, t, y: f"{23 + int(t + 3300) // 3600}:{int(t + 3300) // 60 % 60:02d}:"
        f"{int(t + 3300) % 60:02d},{y}", "Elapsed,T\n", 10.0,
    ),
    "a title of milliseconds": log(lambda k, t, y: f"{20 * k},{y}", "ms,y\n", 0.02),
    "ArduPilot": log(lambda k, t, y: f"{7 * 10**7 + 2500 * k},{y}", "TimeUS,GyrX\n", 0.0025),
    "units above titles": log(
        lambda k, t, y: f"{20 * k},{y}", "ms,degC\nTime,Coolant\n", 0.02
    ),
    "an index without a title": log(
        lambda k, t, y: f"{k},{stamp('%Y-%m-%d %H:%M:%S.%f', t)},{y}", ",when,y\n", 0.25, {ZONE}
    ),
    "day and month": log(
        lambda k, t, y: f"03/06/2024 12:{k:02d},{y}", "t,y\n", 60.0, {ZONE}, 20,
        **{"columns__time__format": "%d/%m/%Y %H:%M"},
    ),
    "dates that decide day and month": log(
        lambda k, t, y: f"{stamp('%d/%m/%Y %H:%M', t)},{y}", "t,y\n", 60.0, {ZONE}
    ),
    "equal timestamps": log(
        lambda k, t, y: f"{stamp('%Y-%m-%dT%H:%M:%S', t)}Z,{y}", "t,y\n", 0.25,
        **{"sampling__repeated": "spread", "sampling__period": 0.25},
    ),
    "hours and minutes": log(
        lambda k, t, y: f"{stamp('%H:%M', t)},{y}", "t,y\n", 60.0,
        **{"columns__time__format": "%H:%M", "columns__time__day": "2024-06-27"},
    ),
}  # fmt: skip


def filled(text: str, answers: Mapping[str, Any]) -> dict[str, Any]:
    """The suggested specification with a model, and with answers to keys that are unsure."""
    tree: dict[str, Any] = parse_yaml(text, "suggested")
    tree["observer"] = KALMAN
    for key, answer in answers.items():
        branch = tree
        *path, last = key.split(".")
        for part in path:
            branch = branch.setdefault(part, {})
        branch[last] = answer
        if answer == "":
            del branch[last]
    return tree


def keys_in_doubt(text: str) -> set[str]:
    lines = [line.split(": ")[1] for line in text.splitlines() if line.startswith("# unsure: ")]
    return {key for key in lines if not key.startswith("the unit of")}


def cells(tree: dict[str, Any], path: Path) -> tuple[list[float], list[float]]:
    """The times and the measurement that a specification reads from a file."""
    chosen = parse(Specification, tree)
    file, report = File(path, Dialect.of(chosen)), DataReport()
    layout = lay_out(chosen.columns, chosen.observer.design(1.0), file.header(), "r", 1.0)
    blocks = list(file.blocks(layout.titles, layout.clock, report))
    read = [layout.values(block, report) for block in blocks]
    times = np.concatenate([time for time, _ in read])
    return (times - times[:1]).tolist(), np.concatenate(
        [values[:, 0] for _, values in read]
    ).tolist()


def runs(tree: dict[str, Any], path: Path) -> dict[str, Any]:
    """The report of a run."""
    stated, report = path.parent / "s.yaml", path.parent / "report.json"
    stated.write_text(dumped(tree), encoding="utf-8")
    out = ["--out", str(path.parent / "e.csv"), "--report", str(report)]
    assert main(["estimate", str(stated), str(path), *out]) == 0
    found: dict[str, Any] = json.loads(report.read_text(encoding="utf-8"))
    return found


@pytest.mark.parametrize("name", LOGS)
def test_suggestion_reads_a_log_or_says_what_is_unsure(name: str, tmp_path: Path) -> None:
    one, path = LOGS[name], tmp_path / "r.csv"
    path.write_text(one.text, encoding="utf-8")
    text = suggest(path).text(str(path))
    doubts = keys_in_doubt(text) - {"sampling.period"}
    assert doubts == {*one.answers, *one.unsure} - {"sampling.period"}, text
    tree = filled(text, one.answers)
    if not one.values:
        assert tree["sampling"]["period"] == 0.1
        assert runs(tree, path)["estimates"] == 60
        return
    times, values = cells(tree, path)
    np.testing.assert_allclose(values, one.values, err_msg=text)
    if "repeated" not in tree["sampling"]:
        np.testing.assert_allclose(times, one.times, atol=1e-6, err_msg=text)
    assert tree["sampling"]["period"] == pytest.approx(one.times[1], rel=1e-3)
    assert runs(tree, path)["estimates"] == len(one.times)


@pytest.mark.parametrize("others", [20, 1])
def test_rows_that_may_be_of_several_quantities_are_named(others: int, tmp_path: Path) -> None:
    """Two sensors in turn, and a logger's mark at the end."""
    path, rows = tmp_path / "r.csv", [f"level,{k}.5,{k % 7}.25\n" for k in range(20)]
    marks = [f"off,{k}.75,99\n" for k in range(20 - others, 20)]
    rows[20 - others :] = [a + b for a, b in zip(rows[20 - others :], marks, strict=True)]
    path.write_text("what,t [s],y\n" + "".join(rows), encoding="utf-8")
    text = suggest(path).text("r")
    assert "# unsure: file.where: 'what' is 'level' or 'off'; if rows are of several" in text
    tree = filled(text, {})
    tree["file"], tree["sampling"] = {"where": {"what": "level"}}, {"period": 1.0}
    tree["columns"]["measurements"] = [{"column": "y"}]
    assert cells(tree, path)[1] == [k % 7 + 0.25 for k in range(20)]


@pytest.mark.nightly
@pytest.mark.parametrize("name", LAYOUTS)
def test_suggested_layout_runs(name: str, tmp_path: Path) -> None:
    """With one second a row stated where the layout leaves the unit open."""
    path = tmp_path / "r.csv"
    path.write_text(LAYOUTS[name][0], encoding="utf-8")
    text = suggest(path).text("r")
    answers = {UNIT: "s", "columns.time.column": "1", "sampling.period": 1.0}
    asked = {key for key in answers if f"{key.split('.')[-1]}: '?'" in text}
    runs(filled(text, {key: answers[key] for key in asked}), path)


def test_what_is_asked_for_is_refused_by_its_key(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "r.csv"
    path.write_text(LOGS["ulog2csv"].text, encoding="utf-8")
    assert main(["estimate", "--suggest", str(path)]) == 0
    stated = tmp_path / "s.yaml"
    stated.write_text(capsys.readouterr().out, encoding="utf-8")
    tree = parse_yaml(stated.read_text(encoding="utf-8"), "s")
    for filled_in, refused in (
        ({}, "columns.time.unit"),
        ({"columns": {**tree["columns"], "time": {"column": "timestamp"}}}, "sampling.period"),
        ({"sampling": {"period": 4000.0}}, "observer: '?' must be a model"),
    ):
        tree |= filled_in
        stated.write_text(dumped(tree), encoding="utf-8")
        assert main(["estimate", str(stated), str(path), "--out", str(tmp_path / "e.csv")]) == 1
        assert refused in capsys.readouterr().err


@pytest.mark.nightly
@pytest.mark.parametrize("name", [name for name in examples() if simulated(name).logged])
def test_records_of_examples(name: str, tmp_path: Path) -> None:
    """Each has a column t, in milliseconds that no title states."""
    columns, path = simulated(name).record(), tmp_path / "r.csv"
    cells_of_rows = zip(*(one.tolist() for one in columns.values()), strict=True)
    lines = [",".join(columns), *(",".join(f"{one:.9g}" for one in row) for row in cells_of_rows)]
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    text = suggest(path).text("r")
    assert UNIT in keys_in_doubt(text), text


class Style(NamedTuple):
    """How times are written: cells by [s] since the start, their titles, and the keys for them."""

    cell: Callable[[float], str]
    titles: tuple[str, ...]
    keys: dict[str, Any]
    periods: tuple[float, ...]


def dated(form: str, key: str, *periods: float) -> Style:
    """Dates by a format of which the last digits are whole, or milliseconds."""
    keys = {"unit": "iso8601"} if key == "iso" else {"format": form}
    return Style(lambda t: stamp(form, t), ("when", "Date", "t"), keys, periods or (1.0, 10.0))


def numbers(unit: str, per: float, begin: float, titles: tuple[str, ...], form: str) -> Style:
    """Numbers of a unit of which there are so many in a second."""
    return Style(
        lambda t: form.format(begin + per * t), titles, {"unit": unit}, (0.02, 0.1, 1.0, 30.0)
    )


OWN = {"s": ("time_s", "Time (s)", "secs"), "ms": ("t_ms", "ms", "Time [ms]", "uptimeMS"),
       "us": ("t_us", "TimeUS", "time (us)"), "ns": ("t_ns", "Time [ns]")}  # fmt: skip
PLAIN = ("t", "Time", "timestamp", "x", "n")
PER = {"s": 1.0, "ms": 1e3, "us": 1e6, "ns": 1e9}
STYLES = [
    *(numbers(unit, per, begin * per, OWN[unit] + PLAIN, "{:.0f}") for unit, per in PER.items()
      if unit != "s" for begin in (0.0, 3.5, 112.5, 1e3, 2e3)),
    *(numbers(unit, per, 1719532770 * per, OWN[unit] + PLAIN, "{:.0f}") for unit, per in PER.items()
      if unit in ("ms", "us")),
    *(numbers("s", 1.0, begin, OWN["s"] + PLAIN, "{:.2f}")
      for begin in (0.0, 20.0, 86350.0, 101559.0, 120000.0, 604000.0, 1719532770.0)),
    *(numbers("s", 1.0, begin, OWN["s"] + PLAIN, "{:.0f}") for begin in (0.0, 1719532770.0)),
    numbers("ms", 1e3, 0.0, OWN["ms"] + PLAIN, "{:.3f}"),
    numbers("min", 1 / 60, 0.0, ("Time (min)", "t"), "{:.6f}"),
    numbers("h", 1 / 3600, 0.0, ("Time [h]", "hours", "t"), "{:.9f}"),
    dated("%Y-%m-%dT%H:%M:%S.%f", "iso", 0.02, 0.1, 1.0),
    dated("%Y-%m-%d %H:%M:%S", "iso"),
    dated("%Y-%m-%dT%H:%M:%SZ", "iso"), dated("%Y-%m-%dT%H:%M:%S+02:00", "iso"),
    dated("%d.%m.%Y %H:%M:%S", ""), dated("%d/%m/%Y %H:%M:%S", ""),
    dated("%m/%d/%Y %I:%M:%S %p", ""), dated("%d-%b-%Y %H:%M:%S.%f", "", 0.02, 0.1, 1.0),
    dated("%d-%m-%y %H:%M:%S", ""), dated("%y-%m-%d %H:%M:%S", ""), dated("%Y%m%d%H%M%S", ""),
    dated("%Y/%m/%d %H:%M", "", 60.0), dated("%m-%d-%Y %H:%M:%S.%f", "", 0.1),
    *(Style(lambda t, form=form: stamp(form, t), ("Time", "clock"), {"format": form, "day":
      "2024-06-27"}, periods) for form, periods in (
          ("%H:%M:%S", (1.0, 10.0)), ("%H:%M:%S.%f", (0.02, 0.1)), ("%H:%M", (60.0,)),
          ("%H%M%S", (1.0, 10.0)), ("%H%M%S.%f", (0.02, 0.2, 1.0)))),
    *(Style(lambda t, wrap=wrap, begin=begin: f"{(begin + round(100 * t)) % wrap}",
            ("Packet", "counter_t", "tick"), {"unit": "cs", "wrap": float(wrap)}, (0.01, 0.02))
      for wrap, begin in ((65536, 65500), (256, 0), (1000, 990), (100, 10))),
]  # fmt: skip


class Drawn(NamedTuple):
    """A text of a drawn layout, and what is true of it."""

    content: bytes
    times: list[float]
    values: list[float]
    keys: dict[str, Any]  # by which it is read, but for the columns
    titles: list[str]  # of the time and the measurement, none without a header
    first: bool  # the time
    unit: str


@st.composite
def layouts(draw: st.DrawFn) -> Drawn:
    """Records of two columns."""
    style = draw(st.sampled_from(STYLES))
    fits = [one for one in style.periods if style.cell(0.0) != style.cell(one)]
    period, count = draw(st.sampled_from(fits)), draw(st.sampled_from([12, 40, 130]))
    offset, digits = draw(st.sampled_from([0.0, 7.0, 40.0, 36e3])), draw(st.sampled_from([1, 3, 4]))
    title = draw(st.sampled_from(style.titles))
    halves = "%p" in style.keys.get("format", "")  # of days, behind a blank
    delimiter = draw(st.sampled_from([",", ";", "\t", "|", ";" if halves else "whitespace"]))
    decimal = draw(st.sampled_from(["."] if delimiter == "," else [".", ","]))
    name, unit = draw(st.sampled_from([("T", "°C"), ("v", "m/s"), ("y", "")]))
    units = draw(st.sampled_from(["none", "title", "below", "above"])) if unit else "none"
    above = draw(st.sampled_from(["", "# made by\n# hand\n", "\n", "Logger 7\n"]))
    headed, first = draw(st.sampled_from([True, True, True, False])), draw(st.booleans())

    times = [k * period for k in range(count)]
    values = [round(value(k + count), digits) for k in range(count)]
    spelled, keys = [style.cell(offset + t) for t in times], dict(style.keys)
    if delimiter == "whitespace":
        spelled, title = [cell.replace(" ", "_") for cell in spelled], title.replace(" ", "")
        keys |= {"format": keys["format"].replace(" ", "_")} if "format" in keys else {}
        above = "" if above == "Logger 7\n" else above
    if re.fullmatch(r"[\d.]+", spelled[0]):
        spelled = [cell.replace(".", decimal) for cell in spelled]
        keys |= {"format": keys["format"].replace(".", decimal)} if "format" in keys else {}
    header = [[title, f"{name}[{unit}]" if units == "title" else name]]
    if units == "above":  # where the header is no comment
        header[0][0] = title.lstrip("#")
    if units in ("below", "above"):
        of_time = keys.get("unit") if keys.get("unit") in {*PER, "min", "h", "cs"} else "-"
        header.insert(units == "below", [str(of_time), unit])
    lines = header if headed else []
    lines = lines + [
        [cell, f"{y:.{digits}f}".replace(".", decimal)]
        for cell, y in zip(spelled, values, strict=True)
    ]
    mark, end = (
        " " if delimiter == "whitespace" else delimiter,
        draw(st.sampled_from(["\n", "\r\n"])),
    )
    text = above + "".join(mark.join(line if first else line[::-1]) + end for line in lines)
    keys = {f"columns.time.{key}": part for key, part in keys.items()}
    keys |= {"sampling.period": period, "columns.decimal": decimal}
    content = text.encode(draw(st.sampled_from(["utf-8", "utf-8-sig", "utf-16", "cp1252"])))
    if not headed:
        return Drawn(content, times, values, keys, [], first, "")
    titles = header[units == "above"]
    return Drawn(content, times, values, keys, titles, first, unit if units != "none" else "")


@pytest.mark.nightly
@settings(max_examples=300, deadline=None, suppress_health_check=list(HealthCheck))
@given(one=layouts())
def test_drawn_layout_is_read_or_what_is_unsure_is_said(
    one: Drawn, tmp_path_factory: pytest.TempPathFactory
) -> None:
    """Keys that are not in doubt are right: the true ones are stated for the others alone."""
    path = tmp_path_factory.mktemp("drawn") / "r.csv"
    path.write_bytes(one.content)
    found = suggest(path).text("r")
    doubts, tree = keys_in_doubt(found), parse_yaml(found, "suggested")
    if "file.below_header" in doubts:
        return  # as of titles that may be units
    titles = one.titles or tree["file"]["names"][:: 1 if one.first else -1]
    truth = {**one.keys, "columns.time.column": titles[0]}
    answers = {key: truth.get(key, "") for key in doubts if key in truth or "columns.time." in key}
    if {"columns.time", "columns.time.format"} & doubts:
        answers |= {f"columns.time.{key}": "" for key in ("unit", "format", "day")} | truth
    tree = filled(found, answers)
    if "columns.time" in doubts:  # which may then be the first measurement
        tree["columns"]["measurements"] = [{"column": titles[1]}]
    elif one.unit:
        assert tree["columns"]["measurements"][0]["unit"] == one.unit, found
    read, measured = cells(tree, path)
    period = one.keys["sampling.period"]
    np.testing.assert_allclose(measured, one.values, err_msg=found)
    np.testing.assert_allclose(read, one.times, atol=2e-3 * period, err_msg=found)
    assert tree["sampling"]["period"] == pytest.approx(period, rel=1e-3), found
