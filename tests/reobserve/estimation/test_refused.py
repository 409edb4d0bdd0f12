"""Conflicting specifications and options, each refused naming the key."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import pytest

from reobserve.cli.main import main
from reobserve.core.errors import InputError
from reobserve.estimation.estimate import Estimation
from reobserve.estimation.families.examples import simulated
from tests.reobserve.estimation.records import specification


def inputs(*given: dict[str, Any]) -> dict[str, Any]:
    return {"columns": {"inputs": [{"unit": "V", **one} for one in given]}}


CHAIN = {"transition": [[0.9, 0.1], [0.1, 0.9]]}
ALARM = {"name": "fast", "of": "speed", "beyond": 1.0}
AXES = [{"column": one, "unit": "rpm", "model_unit": "rpm"} for one in ("wx", "wy", "wz")]
REFUSED: list[tuple[str, dict[str, Any], str]] = [
    ("kalman", {"columns": {"measurements": []}}, "columns.measurements: are none, must be one or"),
    ("kalman", inputs({"column": "speed"}), "columns.inputs: take the column 'speed' a second"),
    ("kalman", inputs({"column": "t"}), "columns.inputs: take the column 't' a second time"),
    ("kalman", inputs({"column": "voltage", "range": [5, 5]}), "columns.inputs.0.range: [5, 5]"),
    ("kalman", inputs({"column": ""}), "columns.inputs.0.column: '' must be a name that can be"),
    ("kalman", inputs({"column": "voltage", "unit": "dB"}), "columns.inputs.0.unit: 'dB' counts"),
    ("kalman", inputs(*[{"column": f"v{k}"} for k in range(101)]), "columns.inputs: has 101"),
    (
        "extended-high-gain", inputs({"column": "u"}, {"column": "u_rate"}),
        "columns.inputs: are 2 columns, the observer reads 1 or 3",
    ),
    ("kalman", {"sampling": {"jitter": 0.5}}, "sampling.jitter: 0.5 periods must be below half of"),
    ("kalman", {"sampling": {"gap": -1.0}}, "sampling.gap: -1 must not be negative"),
    ("kalman", {"alarms": [ALARM, ALARM]}, "alarms: have the name 'fast' twice"),
    ("eso", {"observer": {"gains": {"L": [[-9, 0]] * 6}}}, "observer.gains.L: and Ld give no s"),
    ("imm-svsf", {"observer": {"gains": {**CHAIN, "filter": "svsf", "boundary_layer": 1.0}}},
     "observer.gains.convergence_rate: is missing with the filter svsf"),
    ("ilo-forgetting", {"observer": {"gains": {"K1": 1.0, "K2": 1.0, "observer_gain": 9.0}}},
     "observer.gains.K1: has the spectral radius 1; to"),
    ("augmented-kalman", {"observer": {"faults_matrix": 1.0}},
     "observer.faults_matrix: unknown key; did you mean 'fault_matrix'?"),
    ("svsf", {"observer": {"gains": {"convergence": 0.1}}},
     "observer.gains.convergence: unknown key; did you mean 'convergence_rate'?"),
    ("kalman", {"observer": {"kind": "Kalman"}}, "observer.kind: 'Kalman' must be one of kalman,"),
    ("eso", {"observer": {"time": "discrete"}}, "observer.time: 'discrete' must be continuous"),
    ("levant", {"observer": {"L": 1.0}}, "observer.L: must stand under gains"),
    ("kalman", {"observer": {"gains": {"gain": [[1.0]]}}}, "observer.gains: must be left out whe"),
    ("kalman", {"observer": {"sampling_period": 1.0}}, "observer.sampling_period: must be left"),
    ("luenberger", {"observer": {"poles": [2.25, -1]}}, "observer.poles.0: 2.25 is not stable"),
    ("luenberger", {"observer": {"poles": ["1+2j"]}}, "observer.poles.0: '1+2j' is not stable"),
    ("normal-form-identity", {"observer": {"poles": [-1, 0]}}, "observer.poles.1: 0 is not stabl"),
    ("augmented-kalman", {"observer": {"fault_matrix": [[1.0]]}}, "observer.fault_matrix: has sh"),
    ("extended-kalman", {"observer": {"parameters": {"stiffness": 9.81}}},
     "observer.dynamics.rate: '-stiffness*sin(angle) - friction*rate + gain*torque' names fric"),
    ("extended-kalman", {"observer": {"parameters": {"friction": "x"}}},
     "observer.parameters.friction: 'x' is not a number"),
    ("extended-kalman", {"observer": {"output": {"angle": "sin("}}}, "observer.output.angle: 's"),
    ("extended-kalman", {"observer": {"R": -1.0}}, "observer.R: "),
    ("extended-kalman", {"observer": {"substeps": 20_000}}, "observer.substeps: 20000 must be a"),
    ("extended-kalman", {"observer": {"initial_covariance": -1.0}}, "observer.initial_covarianc"),
    ("unscented-kalman", {"observer": {"gains": {"alpha": 0}}}, "observer.gains.alpha: 0 must be"),
    ("unscented-kalman", {"observer": {"gains": {"kappa": -2}}}, "observer.gains.kappa: -2 must"),
    ("kalman", {"smooth": "yes"}, "smooth: 'yes' must be one of true and false, not a word"),
    ("svsf", {"smooth": True}, "smooth: true is for the kinds kalman (with a varying gain), augm"),
    ("ilo-sampled", {"columns": {"measurements": AXES}}, "columns.measurements.0.model_unit:"),
]  # fmt: skip


@pytest.mark.parametrize(("name", "changed", "said"), REFUSED)
def test_invalid_specification_is_refused_naming_the_key(
    name: str, changed: dict[str, Any], said: str
) -> None:
    with pytest.raises(InputError) as error:
        Estimation(specification(name, **changed), list(simulated(name).record()), "the record")
    assert str(error.value).startswith(said)


S, D, OUT = "s.yaml", "r.csv", "--out"
OPTIONS: list[tuple[list[str], str]] = [
    ([], "SPEC: is missing; `reobserve estimate --example kalman` writes one"),
    ([S], "DATA: is missing: reobserve estimate SPEC.yaml DATA.csv --out RESULT.csv"),
    ([S, D], "--out: is missing: reobserve estimate SPEC.yaml DATA.csv --out RESULT.csv"),
    ([S, "--example", "kalman"], "--example: takes no specification and no data"),
    (["--example", "calman"], "example: there is no 'calman'"),
    (["--example", "kalman", OUT, "x.txt"], "x.txt: 'x.txt' must end with .yaml"),
    (["--example", "kalman", "--data", "x.txt"], "x.txt: must end with .csv"),
    (["--example", "kalman", OUT, S], f"{S}: is there already, and is not replaced"),
    (["--example", "kalman", OUT, "x.yaml", "--data", D], f"{D}: is there already, and is not"),
    ([S, D, OUT, "e.csv", "--data", "x.csv"], "--data: belongs to --example, which writes a"),
    ([S, "--stream", OUT, "e.csv"], "--out: is for whole records; a stream goes to standard"),
    ([S, "--stream", "--plot", "e.png"], "--plot: is for whole records; a stream goes to"),
    ([S, D, "--stream"], "--stream: reads standard input, and no file"),
    ([S, "--follow"], "--follow: needs a file to follow"),
    ([S, D, OUT, "e.csv", "--state", "k.json"], "--state: is for --stream and --follow"),
    ([S, D, OUT, D], "is read here, and would be overwritten; name another file"),
    ([S, D, OUT, "e.csv", "--report", "e.csv"], "is named twice; each file needs a name of its"),
    ([S, "none.csv", OUT, "e.txt"], "e.txt: must end with .csv"),
    ([S, D, OUT, "e.csv", "--plot", "e.doc"], "e.doc: must end with .png"),
    ([S, "r.xlsx", OUT, "e.csv"], "r.xlsx: must be text, such as .csv, or .parquet"),
    ([S, "none.csv", OUT, "e.csv"], "none.csv: there is no such file"),
    ([S, ".csv", OUT, "e.csv"], ".csv: is no regular file"),
    ([S, "none.csv", "--follow"], "none.csv: cannot be read (No such file or directory)"),
    ([S, "empty.csv", "--follow", "--idle", "0.1"], "empty.csv: its header is empty, must name"),
    ([S, "latin.csv", OUT, "e.csv"], "latin.csv: its header cannot be read (byte 3 is not UTF-8)"),
    ([S, "mac.csv", OUT, "e.csv"], "mac.csv: its header cannot be read: lines must end with line"),
    ([S, "blank.csv", OUT, "e.csv"], "blank.csv: its header is empty, must name the columns"),
]  # fmt: skip


@pytest.mark.parametrize(("options", "said"), OPTIONS)
def test_conflicting_options_are_refused_without_output(
    options: list[str],
    said: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(tmp_path)
    assert main(["estimate", "--example", "kalman", "--out", S, "--data", D]) == 0
    Path(".csv").mkdir()
    for name, content in (
        ("empty", b""),
        ("latin", b"t,\xe9,v\n0,1,2\n"),
        ("blank", b"\n,,\n0,1\n"),
        ("mac", b"t,v\r0,1\r"),
    ):
        Path(f"{name}.csv").write_bytes(content)
    before = {path: path.read_bytes() for path in Path().iterdir() if path.is_file()}
    capsys.readouterr()
    assert main(["estimate", *options]) != 0
    reported = capsys.readouterr().err
    assert re.search(rf"(^|[ :]){re.escape(said)}", reported), reported
    assert {path: path.read_bytes() for path in Path().iterdir() if path.is_file()} == before
