"""Suggested specifications for logs of instruments, whose preambles and rows few others have."""

from __future__ import annotations

from collections.abc import Callable
from datetime import timedelta
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from reobserve.estimation.suggestion import suggest
from tests.reobserve.estimation.test_suggested_layouts import (
    START,
    UNIT,
    ZONE,
    Log,
    cells,
    filled,
    keys_in_doubt,
    log,
    runs,
    stamp,
)

COLUMN, BELOW, WHERE = "columns.time.column", "file.below_header", "file.where"
COMMENT, PERIOD = "file.comment", "sampling.period"


def made(
    line: Callable[[int, float, float], str],
    above: str,
    period: float,
    *unsure: str,
    asked: dict[str, Any] | None = None,
    below: str = "",
) -> Log:
    """A log of 60 rows, with lines ``below`` them, and answers to what is ``asked``."""
    one = log(line, above, period, unsure, 60)
    return one._replace(text=one.text + below, answers=asked or {})


def day(k: float) -> str:
    date = START + timedelta(seconds=k)
    return f"{date.day}.{date.month}.{date.year},{date.hour}:{stamp('%M:%S.%f', k)}"


def quarter(k: int) -> str:
    """A quarter of an hour, of which midnight is the last one of a day."""
    days, left = divmod(k, 96)
    hour = f"{left // 4:02d}:{left % 4 * 15:02d}" if left else "24:00"
    return f"{27 + days - (left == 0)}.06.2024 {hour}"


TEK = ["Record Length,2.5e+03,", "Sample Interval,4.0e-06,", "Source,CH1,", "Vertical Units,V,"]
HOBO = '"Plot Title: 2012"\n"#","Date Time, GMT-05:00","Temp, °F (LGR S/N: 2, LBL: Air)","End"\n'
TWINCAT = "Name\tScope\nFile\tC:\\t.svdx\n\nName\tMain.fPos\tName\tMain.fVelo\n" + "".join(
    f"{name}\t{one}\t{name}\t{other}\n" for name, one, other in (
        ("Port", "851", "851"), ("SampleTime[ms]", "1", "1"), ("Data-Type", "REAL64", "REAL64"),
        ("Offset", "0", "0"), ("Unit", "mm", "mm/s"))) + "\n"  # fmt: skip
MOTEC = (
    '"Format","MoTeC CSV File","",""\n"Log Date","27/06/2024","",""\n'
    '"Sample Rate","50.000","Hz",""\n'
    '"Beacon Markers","45.0 67.1"\n\n\n"Time","Ground Speed","Gear"\n"s","km/h",""\n\n\n'
)
GRAPHTEC = (
    '"Vendor","GRAPHTEC Corporation"\n"CH","Signal name","Input","Range","Filter","Span"\n'
    '"CH1","CH  1","TEMP","TC_K","Off","2000.0","-500.0","degC"\n"Data"\n'
    '"Number","Date&Time","ms","CH1"\n"NO.","Time","ms","degC"\n'
)
HWINFO = 'Date,Time,"CPU Temp [°C]",\n'
INSTRUMENTS: dict[str, Log] = {
    "NMEA": made(
        lambda k, t, y: f"$GPRMC,{stamp('%H%M%S', t)}.00,A,4807.038,N,1131.00{k % 7},E,{y},84.4,"
        f"{stamp('%d%m%y', t)},3.1,W*6A\n$GPGGA,{stamp('%H%M%S', t)}.00,4807.038,N,1,08,0.9",
        "", 1.0, "columns.time", COMMENT,
        asked={
            "columns.time": {"column": ["2", "10"], "format": "%H%M%S.%f %d%m%y"}, PERIOD: 1.0,
            WHERE: {"1": "$GPRMC"}, "columns.measurements": [{"column": "8"}],
        },
    ),
    "MegaSquirt": made(
        lambda k, t, y: f"{t:.3f}\t{y}\t14.7" + "\nMARK 001 - Manual - Thu Jun 27" * (k == 40),
        '"MS3 Format 0566.08"\n"Capture Date: Thu Jun 27 23:59:30 BST 2024"\nTime\tMAP\tAFR\n'
        "s\tkPa\tAFR\n", 0.067, COMMENT, BELOW,
    ),
    "Arduino": made(
        lambda k, t, y: f"{stamp('%H:%M:%S.%f', t)} -> {y}\t{512 + k % 3}", "", 1.0,
        asked={"columns.time.day": "2024-06-27"},
    ),
    "Rigol": made(
        lambda k, t, y: f"{k},{y:e},0.1,,", "X,CH1,CH2,Start,Increment,\n"
        "Sequence,Volt,Volt,-6.0e-04,1.0e-06,\n", 1e-6, COLUMN,
        asked={UNIT: "us", PERIOD: 1e-6},
    ),
    "Tektronix": made(
        lambda k, t, y: f"{TEK[k] if k < 4 else ',,'},{t - 0.005:.6f},{y},", "", 4e-6, COLUMN,
        asked={UNIT: "s", PERIOD: 4e-6},
    ),
    "Keysight": made(
        lambda k, t, y: f"{t - 5e-4:+.8E},{y:+.8E},0.1", "x-axis,1,2\nsecond,Volt,Volt\n", 1e-6
    ),
    "HOBO": made(
        lambda k, t, y: f"{k + 1},{stamp('%m/%d/%y %I:%M:%S %p', t)},{y},", HOBO, 30.0, ZONE,
        "sampling.jitter", "sampling.missing",
        below="61,06/28/24 12:29:42 AM,,Logged\n",
    ),
    "Lascar": made(
        lambda k, t, y: f"{k},{stamp('%d/%m/%Y %H:%M:%S', t)},{y},45.5" + ",010012345" * (k == 0),
        "Logger,Time,Celsius(°C),Humidity(%rh),Serial Number\n", 10.0, ZONE,
    ),
    "TwinCAT": made(
        lambda k, t, y: f"{k}\t{y}\t{k}\t0.1", TWINCAT, 1e-3, COLUMN, BELOW,
        asked={UNIT: "ms", PERIOD: 1e-3},
    ),
    "ThingSpeak": made(
        lambda k, t, y: f"{stamp('%Y-%m-%d %H:%M:%S', t)} UTC,{k + 1},{y},,",
        "created_at,entry_id,field1,latitude,status\n", 15.0, ZONE,
    ),
    "dataflash": made(
        lambda k, t, y: f"IMU, {70000000 + 20000 * k}, 0, {y}, 0.1"
        + f"\nBARO, {k}, 10.2" * (k % 5 == 0),
        "FMT, 131, 47, IMU, QBff, TimeUS,I,GyrX,AccX\nFMT, 132, 47, BARO, Qf, TimeUS,Alt\n", 0.02,
        COMMENT, COLUMN, "file",
        asked={
            UNIT: "us", PERIOD: 0.02, "columns.measurements": [{"column": "4"}],
            WHERE: {"1": "IMU"},
        },
    ),
    "PicoScope": made(
        lambda k, t, y: f"{1e3 * t - 1:.8f},{y}," + ("∞" if k == 33 else f"23.{k:08d}"),
        "Time,Channel A,Channel B\n(ms),(V),(mV)\n\n", 1e-5,
    ),
    "EPICS": made(
        lambda k, t, y: f"{stamp('%Y/%m/%d %H:%M:%S', t)}.123456789\t{y}\tOK",
        "# Created by CSS Databrowser\n#\n# Time\tTANK:LEVEL [mm]\tTANK:LEVEL Severity\n", 1.0,
        ZONE,
    ),
    "MoTeC": made(lambda k, t, y: f'"{t:.3f}","{y}","3"', MOTEC, 0.02),
    "HWiNFO": made(
        lambda k, t, y: f"{day(t)},{y},", HWINFO, 2.0, ZONE, below=HWINFO + ',,"CPU [#0]: AMD",\n'
    ),
    "Graphtec": made(
        lambda k, t, y: f"{k + 1},{stamp('%Y/%m/%d %H:%M:%S', t)},{100 * k % 1000:3d},+  {y},",
        GRAPHTEC, 0.1, ZONE, BELOW,
    ),
    "Sea-Bird": made(
        lambda k, t, y: f"{t:11.3f}{y:11.4f}", "* Sea-Bird SBE 19plus\n# units = specified\n"
        "# name 0 = timeS: Time, Elapsed [seconds]\n# bad_flag = -9.990e-29\n*END*\n", 0.25, COLUMN,
        asked={UNIT: "s"},
    ),
    "LTspice": made(
        lambda k, t, y: f"{t:.15e}\t{y:e}\t0.1", "time\tV(L1)\tI(R1)\n", 1e-6,
        asked={UNIT: "s", PERIOD: 1e-6},
    ),
    "Car Scanner": made(
        lambda k, t, y: f'"{45123.12 + t:.2f}";"Engine RPM";"{y}";"rpm"\n'
        f'"{45123.62 + t:.2f}";"Vehicle speed";"{50 + k % 3}";"km/h"',
        '"SECONDS";"PID";"VALUE";"UNITS"\n', 1.0, asked={WHERE: {"PID": "Engine RPM"}, PERIOD: 1.0},
    ),
    "Empatica": made(
        lambda k, t, y: f"{y}, {63 - k % 5}",
        "1719532770.000000, 1719532770.000000\n32.000000, 32.000000\n", 1 / 32,
        "columns.time", "file.skip",
        asked={"file": {"skip": 2, "names": ["1", "2"]}, PERIOD: 1 / 32},
    ),
    "SMA": made(
        lambda k, t, y: f"{stamp('%d.%m.%Y %H:%M:%S', t)};{1000 + k};" + f"{y}".replace(".", ","),
        "sep=;\nVersion CSV|Tool SE\n\n;SN: 2100;SN: 2100\n;2100123456;2100123456\n"
        ";Total yield;Power\n;Counter;Analog\ndd.MM.yyyy HH:mm:ss;kWh;kW\n", 300.0, ZONE, BELOW,
        asked={"columns.measurements": [{"column": "Analog"}]},
    ),
    "FactoryTalk": made(
        lambda k, t, y: f"{stamp('%m/%d/%Y,%H:%M:%S', t)},{50 * k % 1000},0,{y}, ",
        "Date,Time,Millitm,TagIndex,Value,Status\n", 0.05, ZONE,
    ),
    "milliseconds behind a colon": made(
        lambda k, t, y: f"{stamp('%d/%m/%Y %H:%M:%S:%f', t)},{y},{('TRUE', 'FALSE')[k % 2]}",
        "Timestamp,pressure (bar),valve\n", 0.1, ZONE,
    ),
    "a spreadsheet of days": made(
        lambda k, t, y: f"{45470.25 + t / 86400:.10f},{y}", "Date,Flow [l/min]\n", 600.0,
        asked={UNIT: "d", PERIOD: 600.0},
    ),
    "ticks of 100 ns": made(
        lambda k, t, y: f"{133640099700000000 + 100000 * k},{y}", "Ticks,Flow [l/min]\n", 0.01,
        asked={COLUMN: "Ticks", UNIT: "hns", PERIOD: 0.01},
    ),
    "Gamry": made(
        lambda k, t, y: f"\t{k}\t{t:.4f}\t{y:e}\t......", "EXPLAIN\nTITLE\tLABEL\tChrono\tTest\n"
        "CURVE\tTABLE\t90\n\tPt\tT\tVf\tOver\n\t#\ts\tV vs. Ref.\tbits\n", 0.1, BELOW,
    ),
    "Polar": made(
        lambda k, t, y: f"{stamp('%Y-%m-%dT%H:%M:%S.%f', 0.5 * (k // 25))};"
        f"{772756770123456789 + k * 20000000};{y}",
        "Phone timestamp;sensor timestamp [ns];X [mg]\n", 0.02, COLUMN, ZONE, "sampling.repeated",
        asked={"columns.time": {"column": "sensor timestamp [ns]", "unit": "ns"}, PERIOD: 0.02},
    ),
    "CR10X": made(
        lambda k, t, y: f"101,{stamp('%Y', t)},{stamp('%j', t)},{int(stamp('%H%M', t))},{y}",
        "", 60.0, "columns.time",
        asked={
            "columns.time": {"column": ["2", "3", "4"], "format": "%Y %j %H%M"}, PERIOD: 60.0,
            "columns.measurements": [{"column": "5"}],
        },
    ),
    "the hour 24": made(
        lambda k, t, y: f"{quarter(k + 92)};" + f"{y}".replace(".", ","),
        "Zeit;Pegel [cm]\n", 900.0, ZONE,
    ),
}  # fmt: skip

UNSAID = {PERIOD, "columns.time", "columns.measurements", "file"}  # of which others say why


@pytest.mark.parametrize("name", INSTRUMENTS)
def test_log_of_an_instrument_is_read_or_what_is_unsure_is_said(name: str, tmp_path: Path) -> None:
    one, path = INSTRUMENTS[name], tmp_path / "r.csv"
    path.write_text(one.text, encoding="utf-8")
    text = suggest(path).text(str(path))
    assert keys_in_doubt(text) - {PERIOD} == one.unsure | {*one.answers} - UNSAID, text
    tree = filled(text, one.answers)
    times, values = cells(tree, path)
    assert len(values) - len(one.values) == (name == "HOBO"), text  # which ends with an event
    np.testing.assert_allclose(values[:60], one.values, err_msg=text)
    period = one.times[1]
    if name != "Empatica":  # which has none
        np.testing.assert_allclose(times[:60], one.times, atol=1e-3 * period, err_msg=text)
    assert tree["sampling"]["period"] == pytest.approx(period, rel=1e-3)


@pytest.mark.nightly
@pytest.mark.parametrize("name", INSTRUMENTS)
def test_log_of_an_instrument_runs(name: str, tmp_path: Path) -> None:
    one, path = INSTRUMENTS[name], tmp_path / "r.csv"
    path.write_text(one.text, encoding="utf-8")
    runs(filled(suggest(path).text(str(path)), one.answers), path)
