"""Exported code does what `step` does, to 1e-12 of its estimates: in C, and in Python alone."""

from __future__ import annotations

import shutil
import subprocess
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from reobserve.codegen import c_code, c_test, python_code
from reobserve.codegen.program_of import program_of
from reobserve.codegen.record import test_run as run_record
from reobserve.core.errors import InputError
from reobserve.observers.high_gain import HighGainObserver
from reobserve.plants.pendulum import pendulum
from reobserve.systems.triangular_text import triangular_model
from tests.codegen import cases
from tests.codegen.cases import NAMES, columns_of, observer_of

SIGNALS = ("as measured", "as applied")

# What makers of embedded software ask for beyond the flags that are printed.
STRICT = [
    "-Wconversion",
    "-Wdouble-promotion",
    "-Wshadow",
    "-Wmissing-prototypes",
    "-Wcast-qual",
    "-Wundef",
]


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("code")


def ran(folder: Path, *command: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(command, check=False, cwd=folder, capture_output=True, text=True)


def write(name: str, folder: Path) -> tuple[Any, Any, Any, Any]:
    """The code of an observer; its record and what `step` makes of it."""
    observer, state = observer_of(name)
    columns = columns_of(name, observer)
    program = program_of(observer, state, columns)
    y, u, run = run_record(observer, state, columns)
    stepped, expected = state, {each: run[each] for each in program.estimates}
    if stepped is None:
        stepped = observer.run(y[:1], u[:1] if observer.inputs else None).state
        rows = range(1, len(y))
    else:
        rows = range(len(y))
    for k in rows:
        stepped, estimate = observer.step(stepped, y[k], u[k] if observer.inputs else None)
        for each, values in expected.items():
            assert np.array_equal(values[k], estimate[each], equal_nan=True)
    c = name.replace("-", "_")
    period = observer.sampling_period
    (folder / f"{c}.h").write_text(c_code.header(program, c, SIGNALS, "About it.", period))
    (folder / f"{c}.c").write_text(c_code.source(program, c))
    (folder / f"{c}_test.c").write_text(c_test.test_source(program, c, y, u, expected))
    (folder / f"{c}.py").write_text(python_code.module(program, SIGNALS, "About it.", period))
    return observer, y, u, expected


def python_of(name: str, folder: Path) -> dict[str, Any]:
    """What the Python that was written of an observer defines."""
    c = name.replace("-", "_")
    scope: dict[str, Any] = {"__name__": c}
    exec(compile((folder / f"{c}.py").read_text(), c, "exec"), scope)
    return scope


@pytest.mark.skipif(shutil.which("cc") is None, reason="there is no compiler of C")
@pytest.mark.parametrize("name", NAMES)
def test_c_compiles_without_a_warning_and_agrees(name: str, folder: Path) -> None:
    write(name, folder)
    c = name.replace("-", "_")
    command = c_test.COMPILE.format(name=c).split()
    done = ran(folder, *command, *STRICT, "-o", c)
    assert (done.returncode, done.stderr) == (0, "")
    tested = ran(folder, f"./{c}")
    assert tested.returncode == 0, tested.stdout
    source = (folder / f"{c}.c").read_text()
    assert not {"malloc", "free(", "while", "goto"} & set(source.split())
    assert source.count("#include") == 2  # its own header, and that of mathematics


@pytest.mark.parametrize("name", NAMES)
def test_python_agrees_and_imports_nothing(name: str, folder: Path) -> None:
    observer, y, u, expected = write(name, folder)
    c = name.replace("-", "_")
    text = (folder / f"{c}.py").read_text()
    imports = [line for line in text.splitlines() if "import" in line]
    assert all(line == "import math" or line.startswith("from math import ") for line in imports)
    exported = python_of(name, folder)["Observer"]()
    for k in range(len(y)):
        row = (y[k].tolist(), u[k].tolist()) if observer.inputs else (y[k].tolist(),)
        found = exported.step(*row)
        for each, values in expected.items():
            size = 1.0 if each == "switched_off" else np.nanmax(np.abs(values))
            assert found[each] == pytest.approx(values[k], abs=1e-12 * size, rel=0, nan_ok=True)


@pytest.mark.parametrize("name", ["relay", "squares_alone"])
def test_an_input_of_a_time_that_is_no_number_is_none(name: str, folder: Path) -> None:
    write(name, folder)
    scope = python_of(name, folder)
    u = [0.0, 0.0]
    scope["past"](scope["Observer"]().cells, 0, 0.0, 1.0, u)
    assert np.isfinite(u).all()
    for lag in (np.nan, np.inf):
        u = [0.0, 0.0]
        scope["past"](scope["Observer"]().cells, 0, 0.0, lag, u)
        assert np.isnan(u).all()


def test_a_row_that_every_mode_finds_hardly_possible_still_tells_them_apart(folder: Path) -> None:
    """All likelihoods are below the least number there is: only their ratios can be had."""
    observer, *_ = write("imm", folder)
    exported, (_, state), least = python_of("imm", folder)["Observer"](), observer_of("imm"), 0.0
    for y in ([1.0, 2.0], [0.9, 1.6], [0.8, 1.3], [3000.0, -2000.0], [1.1, 1.9]):
        found = exported.step(y, [0.5])
        state, expected = observer.step(state, y, [0.5])
        least = min(least, float(expected["log_likelihood"]))
        for each in ("probability", "log_likelihood"):
            assert found[each] == pytest.approx(expected[each], abs=1e-9, rel=1e-9), (y, each)
    assert least < -1000.0


def test_a_table_of_gains_lists_what_was_designed_and_no_more() -> None:
    designed = {
        "gain": ["L"], "kalman": [], "svsf": ["memory_rate", "layer"], "imm": ["Chain"],
        "imm_svsf": ["memory_rate", "layer", "Chain"], "sampled": ["K1", "K2", "Damping"],
        "continuous": ["K1", "K2", "Injection"], "adaptive": ["Gamma", "Kp", "Injection"],
        "levant": ["factor"], "high_gain": ["K"], "extended": ["K"], "squares": [],
        "filtered": ["gain"], "relay": ["M"], "transformed": ["Phi"],
    }  # fmt: skip
    for name, gains in designed.items():
        observer, state = observer_of(name)
        constants = program_of(observer, state, columns_of(name, observer)).constants
        assert [each for each, one in constants.items() if one.gain] == gains, name


@pytest.mark.skipif(shutil.which("cc") is None, reason="there is no compiler of C")
def test_the_test_in_c_notices_a_digit(folder: Path) -> None:
    """A compared number changed in its tenth digit, a gain in its eleventh."""
    write("kalman", folder)
    source = (folder / "kalman.c").read_text()
    assert "0.9, 0.1, 0.0" in source
    (folder / "kalman.c").write_text(source.replace("0.9, 0.1, 0.0", "0.90000000001, 0.1, 0.0"))
    command = c_test.COMPILE.format(name="kalman").split()
    assert ran(folder, *command, "-o", "off").returncode == 0
    tested = ran(folder, "./off")
    assert tested.returncode == 1
    assert "state: off by" in tested.stdout


@pytest.mark.skipif(shutil.which("cc") is None, reason="there is no compiler of C")
def test_c_tells_that_it_left_the_range_of_numbers(folder: Path) -> None:
    write("identity", folder)
    (folder / "far.c").write_text(
        '#include "identity.h"\n'
        "int main(void) {\n"
        "    identity_memory memory;\n    identity_estimate estimate;\n"
        "    const double far[1] = {1e300};\n    int32_t said = 0;\n"
        "    identity_start(&memory);\n"
        "    for (int32_t k = 0; k < 20; ++k) {\n"
        "        said |= identity_step(&memory, far, &estimate);\n    }\n"
        "    return said;\n}\n"
    )
    command = c_test.COMPILE.format(name="identity").replace("identity_test.c", "far.c").split()
    assert ran(folder, *command, "-o", "far").returncode == 0
    assert ran(folder, "./far").returncode == 1


def test_an_observer_whose_steps_are_not_fixed_is_refused_with_the_reason() -> None:
    high_gain = HighGainObserver(pendulum(9.81, 0.5, 0.2, 0.3), 10.0, sampling_period=0.01)
    with pytest.raises(InputError, match=r"a model of compiled functions cannot be exported"):
        program_of(high_gain, high_gain.init([0.0, 0.0]))
    cases_of_text = HighGainObserver(
        triangular_model(["a"], ["sinc(a)"], "1"), 10.0, sampling_period=0.01
    )
    with pytest.raises(InputError, match=r"a model with sinc cannot be exported: write sin"):
        program_of(cases_of_text, cases_of_text.init([0.0]))
    with pytest.raises(InputError, match="the gain composed cannot be exported, only series"):
        program_of(cases.pendulum(order=3, gain="composed"))
    with pytest.raises(InputError, match="state: must be given"):
        program_of(observer_of("kalman")[0])
