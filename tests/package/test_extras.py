"""Without extras, the library needs numpy, scipy and numba, and names a missing extra."""

from __future__ import annotations

import subprocess
import sys
import tomllib
from pathlib import Path

from packaging.requirements import Requirement

from reobserve.core.extras import EXTRAS
from tests import ROOT

DECLARED = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]

# Import names that differ from the package name.
IMPORTED = {"python-flint": "flint", "pyyaml": "yaml", "pillow": "PIL"}

CORE = """
import contextlib, io, sys

class Lacking:  # as if these packages were not installed
    def find_spec(name, path=None, target=None):
        top = name.partition(".")[0]
        if top in sys.argv[1].split():
            raise ModuleNotFoundError(f"No module named {top!r}", name=top)

sys.meta_path.insert(0, Lacking)

import numpy as np
import reobserve
from reobserve.cli.main import main

for name in reobserve.__all__:
    getattr(reobserve, name)
walk = reobserve.LinearModel([[1.0]], [[0.0]], C=[[1.0]], Q=1.0, R=1.0, sampling_period=1.0)
observer = reobserve.steady_kalman(walk)
golden = (np.sqrt(5) - 1) / 2  # the gain is golden
run = observer.run(np.ones((9, 1)), np.zeros((9, 1)), state=observer.init([0.0]))
assert np.allclose(1 - run["state"][:, 0], (1 - golden) ** np.arange(1, 10))

def lacks(extra, call):
    err = io.StringIO()
    with contextlib.redirect_stderr(err):
        try:
            assert call() == 1
            message = err.getvalue().strip()
        except reobserve.InputError as error:
            message = str(error)
    assert message.endswith(f'`pip install "reobserve[{extra}]"` brings it'), message
    assert "\\n" not in message

lacks("plot", run.plot)
lacks("data", run.to_pandas)
lacks("symbolic", lambda: reobserve.normal_form_observer(
    ["w", "-sin(a)"], ["a"], ["a", "w"], poles=[-1.5, -2], order=2, sampling_period=0.01))
lacks("data", lambda: main(["estimate", "s.yaml", "r.csv", "--out", "estimates.csv"]))
lacks("design", lambda: main(["design", "eso", "motor.yaml", "--out", "motor.json"]))
lacks("design", lambda: reobserve.load_design("motor.json"))
lacks("pipeline", lambda: reobserve_papers.replicate("ilo", "fig1"))
lacks("pipeline", lambda: main(["check", "--project", sys.argv[2]]))
"""


def test_core_needs_three_packages_and_names_the_missing_extra(tmp_path: Path) -> None:
    words = [sys.executable, "-c", CORE, " ".join(EXTRAS), str(ROOT)]
    done = subprocess.run(words, cwd=tmp_path, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    assert list(tmp_path.iterdir()) == []


def test_named_extra_provides_the_missing_package() -> None:
    brings = {
        extra: {IMPORTED.get(name, name) for name in (Requirement(line).name for line in lines)}
        for extra, lines in DECLARED["optional-dependencies"].items()
    }
    for package, extra in EXTRAS.items():
        assert package in brings[extra], package
    # Snakemake and the syntax highlighter of its report are never imported by the package.
    assert set().union(*brings.values()) == {*EXTRAS, "reobserve", "snakemake", "pygments"}
    core = {Requirement(line).name for line in DECLARED["dependencies"]}
    assert core == {"numpy", "scipy", "numba"}
