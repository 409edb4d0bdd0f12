"""Drawn observers of many sizes and options: C gives the bits of `run` on drawn records."""

from __future__ import annotations

import shutil
import subprocess
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import reobserve as ro
from reobserve.codegen import c_code, c_test
from reobserve.codegen.record import test_run as run_record
from reobserve.estimation.families.program import program_of
from reobserve.polynomials.grammar import FUNCTIONS
from tests.reobserve.codegen.cases import Made

Random = np.random.Generator
INSIDE = {"acosh": "1.5 + ", "acos": "-0.9 + 0.1*", "asin": "0.1*", "atanh": "0.1*"}


def plant(random: Random, n: int, m: int, p: int) -> ro.LinearModel:
    """Stable, in half of the cases with correlated noise, or an angle."""
    A, C, root = (random.normal(size=size) for size in ((n, n), (m, n), (m, m)))
    A *= 0.9 / np.abs(np.linalg.eigvals(A)).max()
    R, periods = random.choice([[np.eye(m)], [root @ root.T + np.eye(m)]])[0], dict[str, Any]()
    if random.random() < 0.5:
        A[:, 0], C[:, 0] = np.eye(n)[0], np.eye(m)[0]
        periods = {"state_periods": [3.0] + [None] * (n - 1), "output_periods": [3.0] * m}
    B, D = random.normal(size=(n, p)), random.normal(size=(m, p)) * random.integers(2)
    return ro.LinearModel(A, B, C, D, Q=0.1, R=R, **periods)


def text(random: Random, names: list[str], depth: int = 2) -> str:
    """A small text of functions that are defined where they are taken."""
    if not depth:
        return str(random.choice([*names, "0.3"]))
    a, b = (text(random, names, depth - 1) for _ in range(2))
    name = str(random.choice([*FUNCTIONS]))
    call = f"atan2({a}, 1 + {b})" if name == "atan2" else (
        f"{name}({INSIDE.get(name, '0.5 + ')}abs(sin({a})))"
    )  # fmt: skip
    forms = ["{}", "{}*({b})", "{} + {b}", "{}/(2 + ({b})^2)", "({b})^3 - {}", "(2 + {b})**-2.5*{}"]
    return f"0.05*({random.choice(forms).format(call, b=b)})"


def drawn(random: Random, kind: str) -> Made:
    n, m, p = (int(random.integers(*ends)) for ends in ((1, 7), (1, 5), (0, 4)))
    model, many, x = plant(random, n, m, p), int(random.integers(2, 6)), [f"x{i}" for i in range(n)]
    gate: Any = {"gate": random.choice([None, 1.0, 3.0])}
    rules = {"outliers": str(random.choice(["skip", "inflate"]))} if gate["gate"] else {}
    layer: Any = {"boundary_layer": [0.5] * m, "convergence_rate": 0.2}
    jumps: Any = {"drift": 0.1, "jump": 1.0, "jump_rate": 0.1, "jump_time": 3.0}
    push, made = random.normal(size=(n, 1)), Any
    if kind == "kalman":
        made = ro.KalmanFilter(model, **gate, **rules)
    elif kind == "augmented":
        made = ro.AugmentedKalmanFilter(model, fault_matrix=push, random_walk=0.1, **gate, **rules)
    elif kind == "fault bank":
        made = ro.FaultBank(model, fault_matrix=push, **jumps, **gate)
    elif "imm" in kind:
        models = [plant(random, n, m, p) for _ in range(many)]
        svsf = ro.SmoothVariableStructureFilter
        bank = [svsf(o, **layer) if "svsf" in kind else ro.KalmanFilter(o) for o in models]
        chain = random.dirichlet([1.0] * many, size=many)
        made = ro.IMM(bank, chain, mixing=bool(random.integers(2)), **gate)
    elif kind == "normal form":
        f = [*x[1:3], f"-x0 - sin(x0)*{x[min(n, 3) - 1]} + x0^2"]
        form = {"form": str(random.choice(["identity", "transformed"])), "order": int(many - 2)}
        poles = [-1.0, -1.3, -1.7][: len(f)]
        return ro.normal_form_observer(
            f, ["x0"], x[:3], poles=poles, sampling_period=0.02, **form
        ), None
    else:
        names = {"state_names": x, "input_names": [f"u{i}" for i in range(p)]}
        f = [f"0.5*{one} + {text(random, [*x, *names['input_names']])}" for one in x]
        h = [f"{x[i % n]} + {text(random, x, 1)}" for i in range(m)]
        time: Any = random.choice([{}, {"substeps": 1}, {"substeps": 3}])
        make = ro.NonlinearModel.from_ode if time else ro.NonlinearModel
        texts = make(f, h, Q=1e-3, R=model.R, sampling_period=0.1, **names, **time)
        filters = {"ekf": ro.ExtendedKalmanFilter, "ukf": ro.UnscentedKalmanFilter}
        return (made := filters[kind](texts, **gate, **rules)), made.init([0.2] * n, 0.01)
    return made, made.init(np.ones(n), 1.0)


KINDS = ["kalman", "augmented", "fault bank", "imm", "imm of svsf", "normal form", "ekf", "ukf"]


@pytest.mark.nightly
@pytest.mark.skipif(shutil.which("cc") is None, reason="there is no compiler of C")
@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("kind", KINDS)
def test_drawn_observer_gives_in_c_the_bits_of_its_run(
    kind: str, seed: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(c_test, "_TOLERANCE", 0.0)
    random, made = np.random.default_rng(seed), None
    while made is None:
        try:
            made, state = drawn(random, kind)
        except ro.InputError:  # as a fault that is unobservable
            continue
    program = program_of(made, state)
    y, u, _ = run_record(made, state, (made.measurements, made.inputs))
    if made.reads_missing:
        y = np.where(random.random(y.shape) < 0.1, np.nan, y + 0.1 * random.normal(size=y.shape))
    run = made.run(y, u if made.inputs else None, start=state)
    expected = {each: run[each] for each in program.estimates}
    (tmp_path / "d.h").write_text(c_code.header(program, "d", ("", ""), "", 1.0))
    (tmp_path / "d.c").write_text(c_code.source(program, "d"))
    (tmp_path / "d_test.c").write_text(c_test.test_source(program, "d", y, u, expected))
    for compiler in filter(shutil.which, ("cc", "clang")):
        command = c_test.COMPILE.format(name="d").replace("cc", compiler, 1).split()
        for flags in (
            ("-O2", "-ffp-contract=off"),
            ("-O1", "-ffp-contract=off", "-fsanitize=undefined,address"),
        ):
            subprocess.run([*command, *flags], check=True, cwd=tmp_path)
            done = subprocess.run("./a.out", check=False, cwd=tmp_path, capture_output=True)
            assert (done.returncode, done.stderr) == (0, b""), done.stdout.decode()
