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


def plant(random: Any, n: int, m: int, p: int) -> ro.LinearModel:
    """Stable, or with an angle that is measured."""
    A, C, root = (random.normal(size=size) for size in ((n, n), (m, n), (m, m)))
    A, periods = A * 0.9 / np.abs(np.linalg.eigvals(A)).max(), dict[str, Any]()
    if random.random() < 0.5:
        A[:, 0], C[:, 0] = np.eye(n)[0], np.eye(m)[0]
        periods = {"state_periods": [3.0] + [None] * (n - 1), "output_periods": [3.0] * m}
    B, D = random.normal(size=(n, p)), random.normal(size=(m, p)) * random.integers(2)
    return ro.LinearModel(A, B, C, D, Q=0.1, R=root @ root.T + np.eye(m), **periods)


def text(random: Any, names: list[str]) -> str:
    name, a, b = (str(random.choice(one)) for one in (list(FUNCTIONS), names, names))
    call = f"{name}({'a, '.replace('a', a) * (name == 'atan2')}0.1 + 0.5*abs(sin({a})))"
    return f"0.05*({b} - {a if name == 'acosh' else call}**{random.integers(1, 4)})"


def drawn(random: Any, kind: str) -> Made:
    n, m, p = (int(random.integers(*ends)) for ends in ((1, 7), (1, 5), (0, 4)))
    model, many, x = plant(random, n, m, p), int(random.integers(2, 6)), [f"x{i}" for i in range(n)]
    gate: Any = {"gate": random.choice([None, 1.0, 3.0])}
    rules: Any = (
        {**gate, "outliers": str(random.choice(["skip", "inflate"]))} if gate["gate"] else {}
    )
    push, chain = random.normal(size=(n, 1)), random.dirichlet([1.0] * many, size=many)
    if kind == "normal form":
        f = [*x[1:3], f"-x0 - sin(x0)*{x[:3][-1]} + x0^2"]
        form: Any = {"form": random.choice(["identity", "transformed"]).item(), "order": many - 2}
        poles = [-1.0, -1.3, -1.7][: len(f)]
        return ro.normal_form_observer(
            f, x[:1], x[:3], poles=poles, sampling_period=0.1, **form
        ), None
    if kind in ("ekf", "ukf"):
        u, steps = [f"u{i}" for i in range(p)], int(random.integers(4))
        f, h = [f"-{one} + {text(random, x + u)}" for one in x], [text(random, x) for _ in range(m)]
        h = [f"{x[i % n]} + {one}" for i, one in enumerate(h)]
        shape: Any = {"state_names": x, "input_names": u, "Q": 1e-3, "R": model.R}
        shape |= {"substeps": steps} if steps else {}
        make: Any = ro.NonlinearModel.from_ode if steps else ro.NonlinearModel
        of: Any = ro.ExtendedKalmanFilter if kind == "ekf" else ro.UnscentedKalmanFilter
        filter_ = of(make(f, h, sampling_period=0.1, **shape), **rules)
        return filter_, filter_.init([0.2] * n, 0.01)
    models = [plant(random, n, m, p) for _ in range(many)]
    layer: Any = {"boundary_layer": [0.5] * m, "convergence_rate": 0.2}
    jumps: Any = {"drift": 0.1, "jump": 1.0, "jump_rate": 0.1, "jump_time": 3.0}
    made: Any = {
        "kalman": lambda: ro.KalmanFilter(model, **rules),
        "augmented": lambda: ro.AugmentedKalmanFilter(
            model, fault_matrix=push, random_walk=1.0, **rules
        ),
        "faults": lambda: ro.FaultBank(model, fault_matrix=push, **jumps, **gate),
        "imm": lambda: ro.IMM(
            [ro.KalmanFilter(one) for one in models], chain, mixing=bool(many % 2), **gate
        ),
        "svsf": lambda: ro.IMM(
            [ro.SmoothVariableStructureFilter(one, **layer) for one in models], chain, **gate
        ),
    }[kind]()  # fmt: skip
    return made, made.init(np.ones(n), 1.0)


@pytest.mark.nightly
@pytest.mark.skipif(shutil.which("cc") is None, reason="there is no compiler of C")
@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize(
    "kind", ["kalman", "augmented", "faults", "imm", "svsf", "ekf", "ukf", "normal form"]
)
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
    test = c_test.test_source(program, "d", y, u, {each: run[each] for each in program.estimates})
    (tmp_path / "d.h").write_text(c_code.header(program, "d", ("", ""), "", 1.0))
    (tmp_path / "d.c").write_text(c_code.source(program, "d"))
    (tmp_path / "d_test.c").write_text(test)
    for compiler in filter(shutil.which, ("gcc", "clang")):
        command = c_test.COMPILE.format(name="d").replace("cc", compiler, 1).split()
        for flags in (["-O2"], ["-O1", "-fsanitize=undefined,address"]):
            subprocess.run([*command, "-ffp-contract=off", *flags], check=True, cwd=tmp_path)
            done = subprocess.run("./a.out", check=False, cwd=tmp_path, capture_output=True)
            assert (done.returncode, done.stderr) == (0, b""), done.stdout.decode()
