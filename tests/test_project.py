"""The house rules: who may import whom, what the locks hold, that the README is true."""

from __future__ import annotations

import ast
import csv
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import yaml

from reobserve.provenance import import_closure

ROOT = Path(__file__).parents[1]
SOURCE = ROOT / "src" / "reobserve"
PAPERS = yaml.safe_load((ROOT / "config/config.yaml").read_text())["papers"]
README = (ROOT / "README.md").read_text()


def imports(path: Path) -> set[str]:
    """All modules that a file names in imports, those inside functions included."""
    found = set()
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            found |= {node.module or "", *(f"{node.module}.{a.name}" for a in node.names)}
    return found


def files(*folders: str) -> list[Path]:
    return [path for folder in folders for path in sorted((SOURCE / folder).rglob("*.py"))]


def inside(modules: set[str], *packages: str) -> set[str]:
    return {m for m in modules for p in packages if m == p or m.startswith(f"{p}.")}


def test_imports_run_downhill() -> None:
    evidence = ("evaluation", "golden", "golden_tables", "golden_commands", "golden_guard")
    above = [f"reobserve.{name}" for name in ("papers", "stages", "cli", *evidence)]
    for path in files("plants", "observers", "synthesis"):
        assert not inside(imports(path), *above), path
    for path in files("observers"):
        closure = set(import_closure([".".join(("reobserve.observers", path.stem))]))
        assert not inside(closure, "reobserve.plants", "reobserve.files", "reobserve.series")
    for path in files("synthesis"):
        assert not inside(imports(path), "reobserve.observers", "reobserve.plants"), path
    for path in SOURCE.glob("*.py"):
        if path.stem not in (*evidence, "cli", "__main__"):
            rooms = [f"reobserve.{room}" for room in ("plants", "observers", "papers", "stages")]
            assert not inside(imports(path), *rooms), path


def test_heavy_packages_stay_where_they_belong() -> None:
    for path in files("."):
        names = imports(path)
        assert not inside(names, "snakemake"), path
        drawing = path.parent.parent.name == "papers" and path.stem.partition("_")[0] == "plot"
        if not drawing and path != SOURCE / "figures.py":
            assert not inside(names, "matplotlib"), path
        if "synthesis" not in path.parts:
            assert not inside(names, "cvxpy", "clarabel"), path


def test_a_short_job_imports_little() -> None:
    """Looking around needs neither numpy's friends nor a plot."""
    command = (
        "import sys; from reobserve.cli import main; main(['list']); "
        "print([m for m in ('numba', 'scipy', 'matplotlib', 'pandas', 'cvxpy', 'pyarrow') "
        "if m in sys.modules])"
    )
    done = subprocess.run(
        [sys.executable, "-c", command], cwd=ROOT, capture_output=True, text=True, check=True
    )
    assert done.stdout.splitlines()[-1] == "[]"


def test_files_can_be_held_in_the_head() -> None:
    long = {p.name: n for p in files(".") if (n := len(p.read_text().splitlines())) > 400}
    assert long == {}


@pytest.mark.parametrize("name", ["requirements.lock", "requirements-build.lock"])
def test_the_locks_pin_by_hash_and_name_no_host(name: str) -> None:
    text = (ROOT / name).read_text()
    assert "://" not in text
    assert "--index" not in text
    pinned = re.findall(r"^([a-z0-9.-]+)==", text, re.MULTILINE)
    assert len(pinned) == len(set(re.findall(r"^([a-z0-9.-]+==[^ ]+)", text, re.MULTILINE)))
    blocks = re.split(r"^(?=[a-z])", text, flags=re.MULTILINE)[1:]
    assert all("--hash=sha256:" in block for block in blocks)


def test_nothing_tracked_names_a_place_of_one_machine() -> None:
    listed = subprocess.run(
        ["git", "ls-files"], cwd=ROOT, capture_output=True, text=True, check=True
    ).stdout.split()
    absolute = re.compile(r"(?<![\w.$}/:-])/(?:home|root|work|tmp|Users)/\w")
    for name in listed:
        path = ROOT / name
        if (
            path.is_file()
            and path.suffix not in (".lock", ".csv", ".png")
            and path != Path(__file__)
        ):
            assert not absolute.search(path.read_text(encoding="utf-8")), name


def test_metadata_agrees() -> None:
    citation = yaml.safe_load((ROOT / "CITATION.cff").read_text())
    project = (ROOT / "pyproject.toml").read_text()
    assert f'version = "{citation["version"]}"' in project
    assert f'license = "{citation["license"]}"' in project
    references = {ref["title"]: ref for ref in citation["references"]}
    for paper in PAPERS:
        about = yaml.safe_load((ROOT / f"config/papers/{paper}.yaml").read_text())["about"]
        reference = references[about["title"]]
        for key in ("doi", "year"):
            assert reference.get(key) == about.get(key), (paper, key)
        families = [author["family-names"] for author in reference["authors"]]
        for author, family in zip(about["authors"], families, strict=True):
            assert author.endswith(family)
    workflow = yaml.safe_load((ROOT / ".github/workflows/ci.yml").read_text())
    steps = [step.get("run", "") for step in workflow["jobs"]["test"]["steps"]]
    assert any("make test" in step for step in steps)
    assert "make test" in (ROOT / ".ci/run").read_text()


def test_the_python_of_the_readme_runs(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    names: dict[str, object] = {}
    blocks = re.findall(r"```python\n(.*?)```", README, re.DOTALL)
    assert len(blocks) >= 2
    for block in blocks[:2]:
        exec(compile(block, "README.md", "exec"), names)
    # J w' of the record is all "fault" here: the first axis moves, and 1.5 of it couples over.
    time, fault = names["time"], names["run"].fault  # type: ignore[attr-defined]
    expected = 0.01 * np.cos(time[::2])[:, None] * [36, 1.5, 0]  # type: ignore[index]
    assert np.max(np.abs(fault[1000:] - expected[1000:])) < 0.02
    for block in blocks[2:]:
        exec(compile(block, "README.md", "exec"), names)
    # The record is no exact motion of the pendulum, but near one.
    rate = names["motion"].estimate[1000:, 1]  # type: ignore[attr-defined]
    assert np.max(np.abs(rate - np.gradient(names["angle"], time)[::2][1000:])) < 0.01  # type: ignore[index, arg-type]
    # A motor at rest under half a volt has lost half a volt.
    assert abs(names["found"].actuator_fault[-1, 0] + 0.5) < 1e-6  # type: ignore[attr-defined]
    # It swings as the sound model does.
    assert names["diagnosis"].probability[1000:, 0].mean() > 0.9  # type: ignore[attr-defined]


def test_the_example_of_the_readme_is_accepted(tmp_path: Path) -> None:
    from reobserve.ledger import Ledger

    block = re.search(r"```yaml\n(.*?)```", README, re.DOTALL)
    assert block
    overrides = yaml.safe_load(block[1])["ilo"]
    ledger = Ledger.load(ROOT, "ilo", overrides)
    assert ledger.section("observers", "eager")["K2"] == 4000
    assert ledger.section("observers", "eager")["damping"] == 1000
    assert ledger.section("observers", "sampled")["K2"] == 1500
    assert ledger.section("figures", "fig9")["observers"] == ["sampled", "eager"]


def golden(figure: str, paper: str = "ilo") -> dict[tuple[str, str], float]:
    with (ROOT / f"tests/golden/{paper}/{figure}.metrics.csv").open() as stream:
        return {
            (row["observer"], row["metric"]): float(row["value"]) for row in csv.DictReader(stream)
        }


def percent(number: float, digits: int = 2) -> str:
    return f"{float(f'{100 * number:.{digits}g}'):g} %"


def test_the_numbers_of_the_readme_are_those_of_the_build() -> None:
    figures = [golden(name) for name in ("fig1", "fig2", "fig3", "fig5")]
    for observer in ("sampled", "continuous", "forgetting"):
        scores = [percent(figure[observer, "relative_rms_error"]) for figure in figures]
        assert f"| `{observer}` | {' | '.join(scores)} |" in README
    fig4 = golden("fig4")
    assert f"errs by {percent(fig4['adaptive', 'relative_rms_error'], 3)}, but" in README
    assert f"matched gains by {percent(fig4['matched', 'relative_rms_error'])}:" in README


def test_the_numbers_of_the_readme_on_normal_forms_are_those_of_the_build() -> None:
    fig1 = golden("fig1", "lie")
    for observer in ("constant", "order4", "injection"):
        numbers = [
            f"{fig1[observer, name]:.3g}" for name in ("ise", "settling_time", "floquet_exponent")
        ]
        assert f"| `{observer}` | {' | '.join(numbers)} |" in README
    share = golden("fig1_ensemble", "lie")["series", "share_better_4"]
    assert f"Order 4 is better from {percent(share)} of the initial states" in README
    with (ROOT / "tests/golden/lie/table_coefficients.csv").open() as stream:
        assert [row["agrees"] for row in csv.DictReader(stream) if row["printed"]] == ["yes"] * 10


def test_the_numbers_of_the_readme_on_delays_are_those_of_the_build() -> None:
    names = ("rms_delay_error", "rms_error_1", "rms_error_2")
    for figure, observers in (
        ("1", ("order2", "standard")),
        ("2", ("order2_noise", "standard_noise")),
    ):
        found = golden(f"fig{figure}", "delay")
        for observer in observers:
            numbers = [
                f" {found[observer, name]:.2g} " if (observer, name) in found else " "
                for name in names
            ]
            assert f"| `{observer}`, Fig. {figure} |{'|'.join(numbers)}|" in README


def test_the_numbers_of_the_readme_on_banks_are_those_of_the_build() -> None:
    plain = {**golden("fig5_plain", "imm"), **golden("fig7_plain", "imm")}
    tuned = {**golden("fig5", "imm"), **golden("fig7", "imm")}
    for name in ("kalman", "svsf", "svsf_thin"):
        columns = []
        for found, observer in ((plain, name), (tuned, f"{name}_tuned")):
            normal, leakage = (
                percent(round(found[observer, f"{mode}_after"], 8))
                for mode in ("normal", "leakage")
            )
            columns.append(f"{normal} / {leakage}")
        assert f" | {' | '.join(columns)} |" in README
    near = golden("fig5_neighbourhood", "imm")
    assert f"({near['search', 'trials']:g} trials," in README
    low, high = (near["leave", f"{end}_factor"] - 1 for end in ("least", "greatest"))
    assert f"by {low * 100:.1g} % and +{high * 100:.2g} %" in README.replace("\n", " ")
    assert tuned["svsf_thin_tuned", "outside_share"] == tuned["svsf_tuned", "outside_share"] == 0
    gaps = golden("fig8_closeness", "imm")
    needed = [gaps[name, "least_gap_at_noise_0.1"] for name in ("kalman", "svsf")]
    assert "the KF-IMM needs a ν-gap of {:.2g}, the SVSF-IMM {:.2g}".format(*needed) in README


def test_the_numbers_of_the_readme_on_extended_observers_are_those_of_the_build() -> None:
    actuator, sensor = golden("fig2", "eso"), golden("fig3", "eso")
    for name in ("pi", "pd_pi"):
        numbers = [
            f"{actuator[name, 'actuator_lag']:.2g} s",
            f"{sensor[name, 'sensor_lag']:.2g} s",
            f"{actuator[name, 'rms_actuator_error_varying']:.2g} V",
            f"{sensor[name, 'rms_sensor_error_varying']:.2g} rad/s",
        ]
        assert f"| `{name}` | {' | '.join(numbers)} |" in README


@pytest.mark.parametrize("paper", PAPERS)
def test_the_metrics_of_the_table_are_those_that_are_explained(paper: str) -> None:
    """All of them, and no others; in the table ``<word>`` stands for what differs."""
    (told,) = re.findall(
        rf"^## Metrics of `{paper}`\n(.*?)(?=^## |\Z)",
        (ROOT / "results/README.md").read_text(), re.DOTALL | re.MULTILINE,
    )  # fmt: skip
    rows = re.findall(r"^\| `(.+?)` \|", told, re.MULTILINE)
    patterns = {row: re.sub(r"<\w+>", ".+", row) for row in rows}
    kept = (ROOT / "tests/golden" / paper).glob("*.metrics.csv")
    figures = [path.name.removesuffix(".metrics.csv") for path in kept]
    metrics = {metric for figure in figures for _, metric in golden(figure, paper)}
    assert {m for m in metrics if not any(re.fullmatch(p, m) for p in patterns.values())} == set()
    assert {r for r, p in patterns.items() if not any(re.fullmatch(p, m) for m in metrics)} == set()
