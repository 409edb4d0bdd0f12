"""Exported C agrees with `step` to 1e-12 of the estimates."""

from __future__ import annotations

import re
import shutil
import subprocess
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from reobserve.codegen import c_code, c_test
from reobserve.codegen.record import test_run as run_record
from reobserve.core.errors import InputError
from reobserve.estimation.families.program import program_of
from reobserve.observers.high_gain import HighGainObserver
from tests.reobserve.codegen.cases import NAMES, columns_of, observer_of
from tests.reobserve.observers.small_plants import pendulum

SIGNALS = ("as measured", "as applied")

OTHERS = ("c++", "clang", "clang++")
WARNED = ["-Wall", "-Wextra", "-Wpedantic", "-Werror"]

# Flags common in embedded software, in addition to the printed ones.
STRICT = [
    "-Wconversion",
    "-Wdouble-promotion",
    "-Wshadow",
    "-Wcast-qual",
    "-Wundef",
    "-Wmissing-prototypes",  # which C++ does not know
]


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("code")


def ran(folder: Path, *command: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(command, check=False, cwd=folder, capture_output=True, text=True)


def write(name: str, folder: Path) -> tuple[Any, Any, Any, Any]:
    """Write the C code of an observer; returns its record and the results of `step`."""
    observer, state = observer_of(name)
    columns = columns_of(name, observer)
    program = program_of(observer, state, columns)
    y, u, run = run_record(observer, state, columns)
    assert np.all(y[0]), "where some observers start"
    assert np.all(u[0])
    stepped, expected = state, {each: run[each] for each in program.estimates}
    if stepped is None:
        stepped = observer.run(y[:1], u[:1] if observer.inputs else None).end
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
    return observer, y, u, expected


def test_each_observer_is_tested_with_each_start_that_it_takes() -> None:
    """With a state, and without one where the observer starts from its first measurement."""
    observers: dict[type, Any] = {}
    starts: set[tuple[type, bool]] = set()
    for observer, state in map(observer_of, NAMES):
        observers[type(observer)] = observer
        starts.add((type(observer), state is None))
    for kind, observer in observers.items():
        assert (kind, False) in starts, kind
        if (kind, True) not in starts:
            p, m = observer.measurements, observer.inputs
            with pytest.raises(InputError, match=r"^start: must be given"):
                observer.run(np.ones((2, p)), np.ones((2, m)) if m else None)


@pytest.mark.nightly_after(3)
@pytest.mark.skipif(shutil.which("cc") is None, reason="there is no compiler of C")
@pytest.mark.parametrize("name", NAMES)
def test_c_code_compiles_without_warning_and_is_bitwise_equal_to_the_library(
    name: str, folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(c_test, "_TOLERANCE", 0.0)
    write(name, folder)
    c = name.replace("-", "_")
    command = c_test.COMPILE.format(name=c).split()
    done = ran(folder, *command, *STRICT, "-O2", "-ffp-contract=off", "-o", c)
    assert (done.returncode, done.stderr) == (0, "")
    for compiler in filter(shutil.which, OTHERS):
        kind = ["-x", "c++", "-std=c++11"] if compiler.endswith("++") else ["-std=c99"]
        files = f"{c}.c", f"{c}_test.c"
        read = ran(folder, compiler, *kind, *WARNED, *STRICT[:-1], "-fsyntax-only", *files)
        assert (read.returncode, read.stderr) == (0, ""), compiler
    source = (folder / f"{c}.c").read_text()
    assert not {"malloc", "free(", "while", "goto"} & set(re.sub(r"/\*.*?\*/", "", source).split())
    assert source.count("#include") == 2  # its own header, and that of mathematics
    tested = ran(folder, f"./{c}")
    assert tested.returncode == 0, tested.stdout


@pytest.mark.skipif(shutil.which("cc") is None, reason="there is no compiler of C")
def test_c_imm_probabilities_survive_underflowing_likelihoods(folder: Path) -> None:
    """All likelihoods are below the smallest float, so only their ratios are usable."""
    observer, *_ = write("imm", folder)
    rows = [[1.0, 2.0], [0.9, 1.6], [0.8, 1.3], [3000.0, -2000.0], [1.1, 1.9]]
    (folder / "rows.c").write_text(
        '#include "imm.h"\n#include <stdio.h>\n'
        "int main(void) {\n"
        "    imm_memory memory;\n    imm_estimate estimate;\n"
        f"    const double y[5][2] = {c_code.initialiser(np.array(rows))}, u[1] = {{0.5}};\n"
        "    imm_start(&memory);\n"
        "    for (int32_t k = 0; k < 5; ++k) {\n"
        "        (void)imm_step(&memory, y[k], u, &estimate);\n"
        '        printf("%.17g", estimate.log_likelihood);\n'
        '        for (int32_t j = 0; j < 3; ++j) printf(" %.17g", estimate.probability[j]);\n'
        '        printf("\\n");\n    }\n'
        "    return 0;\n}\n"
    )
    command = c_test.COMPILE.format(name="imm").replace("imm_test.c", "rows.c").split()
    assert ran(folder, *command, "-o", "rows").returncode == 0
    (_, state), least = observer_of("imm"), 0.0
    for y, line in zip(rows, ran(folder, "./rows").stdout.splitlines(), strict=True):
        state, expected = observer.step(state, y, [0.5])
        least = min(least, float(expected["log_likelihood"]))
        log_likelihood, *probability = map(float, line.split())
        assert log_likelihood == pytest.approx(expected["log_likelihood"], abs=1e-9, rel=1e-9), y
        assert probability == pytest.approx(expected["probability"], abs=1e-9, rel=1e-9), y
    assert least < -1000.0


@pytest.mark.skipif(shutil.which("cc") is None, reason="there is no compiler of C")
def test_generated_c_test_detects_a_changed_digit(folder: Path) -> None:
    """A compared number is changed in its tenth digit, a gain in its eleventh."""
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
@pytest.mark.parametrize("flag", ["-ffast-math", "-Ofast", "-ffinite-math-only"])
def test_flags_that_take_nan_for_a_number_are_refused(flag: str, folder: Path) -> None:
    write("kalman", folder)
    for file in ("kalman.c", "kalman_test.c"):
        done = ran(folder, "cc", "-std=c99", flag, "-c", file)
        assert done.returncode != 0
        assert "this code needs nan and infinity" in done.stderr


@pytest.mark.skipif(shutil.which("cc") is None, reason="there is no compiler of C")
@pytest.mark.parametrize("flags", [["-O2"], ["-Ofast", "-fno-finite-math-only"]])
def test_generated_c_test_fails_on_nan_under_any_flags(flags: list[str], folder: Path) -> None:
    write("luenberger", folder)
    source = (folder / "luenberger.c").read_text()
    broken = source.replace("return good ? 0 : 1;", "estimate->state[0] = NAN; return 0;")
    assert broken != source
    test = (folder / "luenberger_test.c").read_text()
    for file, text in (("luenberger.c", broken), ("luenberger_test.c", test)):
        (folder / file).write_text(text.replace("#error", "/* no error */ //"))
    command = [*c_test.COMPILE.format(name="luenberger").split(), *flags, "-std=gnu99", "-Wno-all"]
    done = ran(folder, *command, "-o", "nan")
    assert done.returncode == 0, done.stderr
    assert ran(folder, "./nan").returncode == 1


@pytest.mark.skipif(shutil.which("c++") is None, reason="there is no compiler of C++")
def test_a_program_in_cpp_links_with_the_c_code(folder: Path) -> None:
    write("kalman", folder)
    (folder / "main.cpp").write_text(
        '#include "kalman.h"\n'
        "int main() {\n    kalman_memory memory;\n    kalman_start(&memory);\n    return 0;\n}\n"
    )
    assert ran(folder, "cc", "-std=c99", "-c", "kalman.c").returncode == 0
    done = ran(folder, "c++", "-Wall", "-Werror", "main.cpp", "kalman.o", "-lm", "-o", "linked")
    assert (done.returncode, done.stderr) == (0, "")
    assert ran(folder, "./linked").returncode == 0


@pytest.mark.skipif(shutil.which("cc") is None, reason="there is no compiler of C")
def test_c_code_reports_overflow(folder: Path) -> None:
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


def test_observer_without_fixed_steps_is_refused_with_the_reason() -> None:
    high_gain = HighGainObserver(pendulum(), rho=10.0, sampling_period=0.01)
    with pytest.raises(InputError, match=r"a model with input_gain as a function cannot be"):
        program_of(high_gain, high_gain.init([0.0, 0.0]))
    with pytest.raises(InputError, match="start: must be given"):
        program_of(observer_of("kalman")[0])
