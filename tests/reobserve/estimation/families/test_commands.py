"""`reobserve design` and `reobserve export`, run in an empty folder."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from reobserve.cli.main import main


@pytest.fixture(autouse=True)
def empty(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    return tmp_path


def test_model_is_designed_and_exported_to_code(
    empty: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["design", "luenberger", "--example", "motor.yaml"]) == 0
    assert "next: reobserve design luenberger motor.yaml" in capsys.readouterr().out
    assert (
        main(
            ["design", "luenberger", "motor.yaml", "--set", "poles=[-5, -6]", "--out", "motor.json"]
        )
        == 0
    )
    reported = capsys.readouterr().out
    assert "poles: 0.951229, 0.941765, of the error from sample to sample" in reported
    assert "37 % in 0.2 s" in reported  # of the pole at -5
    assert main(["export", "motor.json", "--to", "c", "--out", "code"]) == 0
    assert "cc -std=c99" in capsys.readouterr().out
    written = sorted(path.name for path in (empty / "code").iterdir())
    assert written == ["motor.c", "motor.h", "motor_test.c"]
    header, source = ((empty / f"code/motor.{end}").read_text() for end in "hc")
    assert "y: speed [rad/s], current [A]" in header
    gain = json.loads((empty / "motor.json").read_text())["gains"]["gain"]
    for a, b in np.ndindex(2, 2):
        assert f"gain[{a}][{b}] = {gain[a][b]!r};" in source


@pytest.mark.parametrize(
    ("typed", "said"),
    [
        (["design", "kalman"], "MODEL.yaml and --out: must be given, or --example"),
        (["design", "kalman", "no.yaml", "--out", "d.json"], "no.yaml: cannot be read"),
        (["design", "kalman", "--example", "here.yaml"], "here.yaml: is there already"),
        (
            ["design", "luenberger", "m.yaml", "--set", "poles=[x]", "--out", "d.json"],
            "poles.0: 'x'",
        ),
        (
            ["design", "luenberger", "m.yaml", "--set", "poles=[1, 2]", "--out", "d.json"],
            "poles.0: 1 is not stable: its",
        ),
        (["export", "here.txt", "--to", "c"], "here.txt: is not JSON"),
        (["export", "here.yaml", "--to", "c"], "here.yaml: must be a mapping of keys to values"),
        (["design", "here.yaml", "--out", "d.json"], "here.yaml: must be a mapping of keys"),
        (["design", "no.yaml", "--out", "d.json"], "no.yaml: cannot be read"),
        (["design", "m.yaml"], "MODEL.yaml and --out: must be given, or --example"),
        (["design", "kalman", "m.yaml", "--out", "d.json"], "kind: 'luenberger' must be kalman"),
    ],
)
def test_failing_command_reports_why_and_writes_nothing(
    typed: list[str], said: str, empty: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    for name in ("here.yaml", "here.txt"):
        (empty / name).write_text("mine")
    main(["design", "luenberger", "--example", "m.yaml"])
    before = sorted(path.name for path in empty.iterdir())
    capsys.readouterr()
    assert main(typed) == 1
    reported = capsys.readouterr().err
    assert said in reported
    assert reported.count("\n") == 1
    assert sorted(path.name for path in empty.iterdir()) == before
