"""The public names of the package, and the optional packages that parts of it need."""

from __future__ import annotations

import ast
import os
import subprocess
import sys
from collections.abc import Callable
from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest

import reobserve
from reobserve.cli.main import main
from reobserve.core.errors import InputError
from reobserve.polynomials.maps import PolynomialMap
from reobserve.polynomials.monomials import monomials
from reobserve.synthesis.definiteness import ball_matrix, prove_negative_definite
from reobserve.synthesis.extended_state import pd_pi, pi
from reobserve.synthesis.extended_state.certificate import certify
from reobserve.synthesis.extended_state.system import AugmentedSystem, Gains
from reobserve.synthesis.h_infinity_norm import h_infinity_norm
from reobserve.synthesis.normal_form.homological_exact import RationalSolver
from reobserve.systems.nonlinear import NonlinearModel
from reobserve.systems.polynomial import PolynomialSystem

MOTOR = AugmentedSystem(
    A=np.array([[-10.0, 1.0], [-0.02, -2.0]]), B=np.array([[0.0], [2.0]]), C=np.eye(2),
    Dd=np.diag([1.0, 2.0]), Dw=np.array([[1.0], [0.0]]), Fa=np.array([[0.0], [2.0]]),
    Fs=np.array([[1.0], [0.0]]),
)  # fmt: skip
GAINS = Gains(np.ones((MOTOR.size, 2)), np.zeros((MOTOR.size, 2)))


def expand() -> object:
    """A system that no earlier test has expanded."""
    return PolynomialSystem.from_expressions(["sin(w)", "-a"], ["a"], ["a", "w"], 3)


def solve() -> object:
    """2 x b - 3 b = 1 for a linear b, in fractions."""
    one = np.array([[Fraction(1)]], dtype=object)
    return RationalSolver(2 * one, 3 * one)(monomials(1, 2), one, 1)


NEEDS: dict[str, list[Callable[[], object]]] = {
    "cvxpy": [
        lambda: pd_pi.design(MOTOR),
        lambda: pd_pi.design_minimum_gamma(MOTOR),
        lambda: pi.design(MOTOR),
        lambda: pi.design_feasible(MOTOR, 1.0),
    ],
    "flint": [
        lambda: pd_pi.design(MOTOR),
        lambda: pi.design_feasible(MOTOR, 1.0),
        lambda: certify(MOTOR, GAINS),
        lambda: h_infinity_norm([[-1.0]], [[1.0]], [[1.0]]),
        lambda: prove_negative_definite([[-1.0]]),
        lambda: ball_matrix([[-1.0]]),
    ],
    "sympy": [expand, solve, lambda: NonlinearModel("x/2", "x", 1.0, 1.0, state_names=["x"])],
    "mpmath": [expand],
}


@pytest.mark.parametrize(
    ("name", "call"), [(name, call) for name, calls in NEEDS.items() for call in calls]
)
def test_missing_package_is_named(
    name: str, call: Callable[[], object], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, name, None)
    extra = "design" if name in ("cvxpy", "flint") else "symbolic"
    reported = (
        rf'^{name}: is not installed, and is needed to .*: `pip install "reobserve\[{extra}\]"`'
    )
    with pytest.raises(InputError, match=reported):
        call()


def test_polynomial_map_needs_no_optional_package(monkeypatch: pytest.MonkeyPatch) -> None:
    for name in NEEDS:
        monkeypatch.setitem(sys.modules, name, None)
    field = PolynomialMap.linear(np.array([[0.0, 1.0], [-2.0, -3.0]]))
    assert field(np.array([1.0, 1.0])).tolist() == [1.0, -5.0]


# Imported with only the standard library and the packages numba needs; no kernel is compiled. Each
# name in a process of its own, which begins with these packages imported.
BARE = """
import importlib.abc, os, sys
allowed = {"numpy", "scipy", "numba", "llvmlite", "reobserve", *sys.stdlib_module_names}
class Blocker(importlib.abc.MetaPathFinder):
    def find_spec(self, name, path=None, target=None):
        top = name.partition(".")[0]
        if top not in allowed and not top.startswith("_sysconfigdata"):  # the interpreter's own
            raise ModuleNotFoundError(f"blocked: {name}", name=name)
sys.meta_path.insert(0, Blocker())
import reobserve
assert "numpy" not in sys.modules
import scipy.linalg
from numba.core.ccallback import CFunc
from numba.core.dispatcher import Dispatcher
for name in sys.argv[1:]:
    if os.fork():
        if os.wait()[1]:
            sys.exit(f"{name} needs more, or compiles")
        continue
    getattr(reobserve, name)
    compiled = [
        name for module in [*sys.modules.values()] if module.__name__.startswith("reobserve")
        for name, thing in vars(module).items()
        if isinstance(thing, CFunc) or (isinstance(thing, Dispatcher) and thing.signatures)
    ]
    assert not compiled, compiled
    os._exit(0)
"""


def test_listed_names_need_only_numpy_scipy_and_numba(tmp_path: Path) -> None:
    words, cold = [sys.executable, "-c", BARE], {"NUMBA_CACHE_DIR": str(tmp_path)}
    done = subprocess.run(
        [*words, *reobserve.__all__], capture_output=True, text=True, check=False,
        env={**os.environ, **cold},
    )  # fmt: skip
    assert done.returncode == 0, done.stderr


# Packages for some calls or for types only; each takes time to import.
LATE = ("cvxpy", "flint", "jinja2", "jsonschema", "pandas", "pyarrow", "sympy", "mpmath")
IMPORTED = """
import importlib, sys
late, modules = sys.argv[1].split(), sys.argv[2:]
for module in modules:
    importlib.import_module(module)
    found = [name for name in late if name in sys.modules]
    if found:
        sys.exit(f"{module} imports {', '.join(found)}")
"""


def imported_late(package: Path) -> list[str]:
    """The modules that name packages for types, which are checked to import none of them."""
    modules = []
    for path in sorted(package.rglob("*.py")):
        if "if TYPE_CHECKING:" in path.read_text(encoding="utf-8"):
            parts = path.relative_to(package.parent).with_suffix("").parts
            modules.append(".".join(parts).removesuffix(".__init__"))
    words = [sys.executable, "-c", IMPORTED, " ".join(LATE), *modules]
    done = subprocess.run(words, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return modules


def test_packages_used_for_types_are_imported_late() -> None:
    """In one process: names under ``TYPE_CHECKING`` are for readers and type checkers."""
    assert "reobserve.systems.linear" in imported_late(Path(str(reobserve.__file__)).parent)


def test_public_names_are_listed_for_dir_and_type_checkers() -> None:
    stub = Path(str(reobserve.__file__)).with_suffix(".pyi")
    nodes = [
        node
        for node in ast.parse(stub.read_text(encoding="utf-8")).body
        if isinstance(node, ast.ImportFrom)
    ]
    typed = [(node.module, one.name, one.asname) for node in nodes for one in node.names]
    homes = reobserve._HOME.items()
    assert sorted(typed) == sorted((f"reobserve.{home}", name, name) for name, home in homes)
    assert set(reobserve.__all__) <= set(dir(reobserve))


def test_unknown_name_suggests_the_nearest() -> None:
    with pytest.raises(AttributeError, match=r"'SampledIlo'; did you mean 'SampledILO'\?$"):
        reobserve.SampledIlo  # noqa: B018
    assert not hasattr(reobserve, "nothing")


BACKENDS = ("module://matplotlib_inline.backend_inline_of_a_notebook", "none")


@pytest.mark.parametrize("backend", BACKENDS)
def test_matplotlib_is_imported_whatever_backend_a_notebook_has_set(backend: str) -> None:
    program = (
        "from reobserve.core.extras import package\n"
        "package('matplotlib.figure', 'draw').Figure(layout='constrained').subplots()"
    )
    done = subprocess.run(
        [sys.executable, "-c", program],
        env={**os.environ, "MPLBACKEND": backend}, capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert (done.returncode, done.stderr) == (0, "")


def test_plot_of_a_command_is_the_same_whatever_a_matplotlibrc_says(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    assert main(["estimate", "--example", "levant", "--out", "s.yaml", "--data", "r.csv"]) == 0
    (tmp_path / "matplotlibrc").write_text("text.usetex: True\nfont.size: 40\nlines.color: red\n")
    (tmp_path / "none").touch()
    words = ["estimate", "s.yaml", "r.csv", "--out", "e.csv", "--plot"]
    for name, rc in (("one", "none"), ("other", "matplotlibrc")):
        done = subprocess.run(
            [sys.executable, "-m", "reobserve", *words, f"{name}.png"],
            env={**os.environ, "MATPLOTLIBRC": str(tmp_path / rc), "MPLBACKEND": "none"},
            capture_output=True, text=True, check=False,
        )  # fmt: skip
        assert done.returncode == 0, done.stderr
    assert (tmp_path / "one.png").read_bytes() == (tmp_path / "other.png").read_bytes()
