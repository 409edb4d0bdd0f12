"""Without extras: every observer runs, and what a call lacks is named by the extra to install."""

import contextlib
import importlib
import io
import pkgutil
from pathlib import Path

import numpy as np

import reobserve
import reobserve_papers
from reobserve.cli.main import main
from reobserve.core.extras import MissingPackageError
from reobserve.synthesis.extended_state import pd_pi
from reobserve.synthesis.extended_state.system import AugmentedSystem
from reobserve_papers.cli.main import main as papers_main

for name in reobserve.__all__:
    getattr(reobserve, name)
walk = reobserve.LinearModel([[1.0]], [[0.0]], C=[[1.0]], Q=1.0, R=1.0, sampling_period=1.0)
observer = reobserve.steady_kalman(walk)
golden = (np.sqrt(5) - 1) / 2  # the gain is golden
run = observer.run(np.ones((9, 1)), np.zeros((9, 1)), start=observer.init([0.0]))
assert np.allclose(1 - run["state"][:, 0], (1 - golden) ** np.arange(1, 10))
for words in (["--help"], ["estimate", "--help"], ["design", "--help"], ["tune", "--help"]):
    with contextlib.redirect_stdout(io.StringIO()), contextlib.suppress(SystemExit):
        main(words)
with contextlib.redirect_stdout(io.StringIO()), contextlib.suppress(SystemExit):
    papers_main(["--help"])


def lacks(extra, call):
    err = io.StringIO()
    with contextlib.redirect_stderr(err):
        try:
            assert call() == 1
            message = err.getvalue().strip()
        except MissingPackageError as error:
            message = str(error)
    assert message.endswith(f'`pip install "reobserve[{extra}]"` brings it'), message
    assert "\n" not in message


motor = AugmentedSystem(
    A=[[-10.0, 1.0], [-0.02, -2.0]], B=[[0], [2]], C=[[1, 0], [0, 1]], Dd=[[1, 0], [0, 2]],
    Dw=[[1], [0]], Fa=[[0], [2]], Fs=[[1], [0]],
)  # fmt: skip
lacks("plot", run.plot)
lacks("data", run.to_pandas)
text = {"poles": [-1.5, -2], "order": 2, "sampling_period": 0.01}
lacks("symbolic", lambda: reobserve.normal_form_observer(["w", "-a"], ["a"], ["a", "w"], **text))
lacks("data", lambda: main(["estimate", "s.yaml", "r.csv", "--out", "estimates.csv"]))
lacks("data", lambda: main(["estimate", "--example", "list"]))
lacks("data", lambda: reobserve.estimate("s.yaml", "r.csv"))
lacks("data", lambda: main(["tune", "tune.yaml", "--output", "tuned"]))
lacks("design", lambda: main(["design", "eso", "motor.yaml", "--out", "motor.json"]))
lacks("design", lambda: main(["export", "motor.json"]))
lacks("design", lambda: reobserve.load_design("motor.json"))
lacks("design", lambda: pd_pi.design(motor))
lacks("papers", lambda: reobserve_papers.replicate("ilo", "fig1"))
lacks("papers", lambda: papers_main(["check", "--project", str(Path(__file__).parents[3])]))
lacks("papers", lambda: papers_main(["schema", "config"]))

# What can be imported without extras; the rest names the one that it needs.
BARE = ("core", "polynomials", "systems", "synthesis", "observers", "detection", "codegen", "cli")


def belongs(name, places):
    return any(f"{name}.".startswith(f"reobserve.{place}.") for place in places)


imported, lacking = [], {}
for package in (reobserve, reobserve_papers):
    name = package.__name__
    for found in pkgutil.walk_packages(package.__path__, f"{name}.", onerror=lambda _: None):
        try:
            importlib.import_module(found.name)
            imported.append(found.name)
        except MissingPackageError as error:
            lacking[found.name] = str(error)
assert all(said.endswith('"` brings it') and "\n" not in said for said in lacking.values())
library = {name: said for name, said in lacking.items() if name.startswith("reobserve.")}
assert all(said.endswith('`pip install "reobserve[data]"` brings it') for said in library.values())
assert [name for name in library if belongs(name, BARE)] == ["reobserve.core.validation"]
assert {"reobserve.estimation", "reobserve.tuning.search"} <= {*imported}
print(f"{len(imported)} modules were imported, {len(lacking)} name an extra")
