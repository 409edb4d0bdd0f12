"""User errors: one sentence that names the error, a non-zero exit, no half-written files."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from reobserve.core.seals import sealed
from reobserve_papers.cli.main import main
from tests.reobserve_papers.papers import fixed

from .conftest import PARAMETER_FILES, ROOT, Project

Capture = pytest.CaptureFixture[str]


def refused(capsys: Capture, *arguments: str | Path) -> str:
    """Run a sub-command that must fail; returns its one-line message."""
    assert main([str(argument) for argument in arguments]) == 1
    captured = capsys.readouterr()
    assert captured.out == ""
    assert captured.err.startswith("reobserve-papers: ")
    assert captured.err.count("\n") == 1, captured.err
    return captured.err.removeprefix("reobserve-papers: ").rstrip()


def nothing_in(folder: Path) -> bool:
    return not any(path.is_file() for path in folder.rglob("*"))


def fault_at(time: float) -> dict[str, object]:
    term = {"kind": "constant", "axis": 1, "from": time, "size": 1}
    return {"scenarios": {"constant": {"fault": [term]}}}


# Overrides as a user would write them, and the required message: where, and what is allowed.
BAD_CONFIG: dict[str, tuple[dict[str, object], str, str]] = {
    "misspelt section": ({"observrs": {}}, "ilo.observrs:", "did you mean 'observers'"),
    "misspelt observer": (
        {"observers": {"smpled": {"K2": 1}}},
        "ilo.observers.smpled.algorithm: is missing",
        "algorithm: is missing; the observer needs it",
    ),
    "misspelt gain": (
        {"observers": {"sampled": {"K22": 1}}},
        "ilo.observers.sampled.K22:",
        "did you mean 'K2'",
    ),
    "misspelt part of an entry": (
        {"plant": {"horizon": {"valeu": 10}}},
        "ilo.plant.horizon.valeu:",
        "unknown key",
    ),
    "shape of a gain": (
        {"observers": {"sampled": {"K2": [[1, 0], [0, 1]]}}},
        "ilo.observers.sampled.K2:",
        "has shape (2, 2), must be one number",
    ),
    "shape of a rate": (
        {"plant": {"initial_rate": [0, 0]}},
        "ilo.plant.initial_rate:",
        "must be a list of 3 numbers",
    ),
    "a word for a number": (
        {"plant": {"input_matrix": "one"}},
        "ilo.plant.input_matrix:",
        "'one' is not a number",
    ),
    "inertia not positive definite": (
        {"plant": {"inertia": [[1, 2, 0], [2, 1, 0], [0, 0, 1]]}},
        "ilo.plant.inertia:",
        "must be positive definite, its eigenvalues are -1, 1, 3",
    ),
    "inertia not symmetric": (
        {"plant": {"inertia": [[3, 1, 0], [0, 3, 0], [0, 0, 1]]}},
        "ilo.plant.inertia:",
        "must be symmetric",
    ),
    "interval not positive": (
        {"observers": {"continuous": {"update_interval": 0}}},
        "ilo.observers.continuous.update_interval:",
        "0 must be greater than zero",
    ),
    "interval no multiple of the step": (
        {"observers": {"continuous": {"update_interval": 0.0101}}},
        "ilo.observers.continuous.update_interval:",
        "0.0101 s must be a whole multiple of the sampling period of 0.00025 s",
    ),
    "K1 outside the stable region": (
        {"observers": {"continuous": {"K1": 1.05}}},
        "ilo.observers.continuous.K1",
        "grows as exp(4.879 t)",
    ),
    "K2 beyond the sampled limit": (
        {"observers": {"sampled": {"K2": 90000}}},
        "ilo.observers.sampled.K1, K2:",
        "the limit is 0.836092 times this K2",
    ),
    "fault after the end": (
        fault_at(12),
        "ilo.scenarios.constant.fault:",
        "starts at 12 s, must start before the end at 10 s",
    ),
    "fault between two steps": (
        fault_at(5.0001),
        "ilo.scenarios.constant.fault:",
        "jumps at 5.0001 s, must jump at a multiple of 0.00025 s",
    ),
    "control between two steps": (
        {"plant": {"control": [{"kind": "constant", "axis": 1, "from": 1.0001, "size": 1}]}},
        "ilo.plant.control:",
        "jumps at 1.0001 s, must jump at a multiple of 0.00025 s",
    ),
    "unknown kind of fault": (
        {"scenarios": {"constant": {"fault": [{"kind": "stepp", "axis": 1}]}}},
        "ilo.scenarios.constant.fault[0].kind:",
        "must be one of constant, sine, growing_sine, ramp, square, prbs, sweep, samples",
    ),
    "unknown scenario of a figure": (
        {"figures": {"fig1": {"scenario": "constnat"}}},
        "ilo.figures.fig1:",
        "did you mean 'constant'",
    ),
    "unknown algorithm": (
        {"observers": {"mine": {"like": "sampled", "algorithm": "ilo"}}},
        "ilo.observers.mine.algorithm:",
        "must be one of sampled_ilo, continuous_ilo, adaptive",
    ),
    "a horizon that no memory holds": (
        {"plant": {"horizon": 1e9}},
        "ilo.plant.horizon:",
        "must be 2e+07 at most",
    ),
    "negative noise": ({"plant": {"noise": -1}}, "ilo.plant.noise:", "must not be negative"),
}  # fmt: skip


@pytest.mark.parametrize("case", BAD_CONFIG)
def test_invalid_config_is_refused(case: str, tmp_path: Path, capsys: Capture) -> None:
    overrides, where, what = BAD_CONFIG[case]
    said = refused(
        capsys,
        *("stage", "parameters", "ilo", "--project", ROOT),
        *("--overrides", json.dumps(fixed("ilo", overrides))),
        *("--output", tmp_path / "parameters.json"),
    )
    assert where in said
    assert what in said
    assert nothing_in(tmp_path)


def test_non_numeric_samples_are_refused(tmp_path: Path, capsys: Capture) -> None:
    record = tmp_path / "torque.csv"
    record.write_text("time,torque\n0,0.1\n1,nan\n2,0.2\n")
    term = {"kind": "samples", "axis": 1, "file": str(record), "column": "torque"}
    overrides = {"scenarios": {"constant": {"fault": [term]}}}
    said = refused(
        capsys,
        *("stage", "parameters", "ilo", "--project", ROOT, "--overrides", json.dumps(overrides)),
        *("--output", tmp_path / "parameters.json"),
    )
    assert str(record) in said
    assert "'torque', row 2 is nan" in said


@pytest.fixture
def parameter_file(tmp_path: Path) -> Path:
    path = tmp_path / "results/ilo/parameters.json"
    assert main(["stage", "parameters", "ilo", "--project", str(ROOT), "--output", str(path)]) == 0
    return path


@pytest.fixture
def record(parameter_file: Path) -> Path:
    assert main(["stage", "plant", str(parameter_file), "constant"]) == 0
    return parameter_file.with_name("constant") / "plant.parquet"


OBSERVE = ("constant", "sampled")


def test_truncated_record_is_refused(parameter_file: Path, record: Path, capsys: Capture) -> None:
    record.write_bytes(record.read_bytes()[:-1000])
    said = refused(capsys, "stage", "observe", parameter_file, *OBSERVE)
    assert said.startswith(f"{record}: is damaged or no Parquet file")
    assert not record.with_name("sampled.parquet").exists()


def test_record_of_another_plant_is_refused(
    parameter_file: Path, record: Path, capsys: Capture
) -> None:
    import pyarrow as pa
    import pyarrow.parquet as parquet

    parquet.write_table(pa.table({"time": [0.0, 1.0]}), record)
    said = refused(capsys, "stage", "observe", parameter_file, *OBSERVE)
    assert "has no reobserve metadata" in said


def test_missing_record_and_estimate_are_refused(
    parameter_file: Path, record: Path, capsys: Capture
) -> None:
    missing = record.with_name("sampled.parquet")
    said = refused(capsys, "stage", "metrics", parameter_file, "fig1")
    assert said == f"{missing}: cannot be read (No such file or directory)"
    assert not parameter_file.with_name("fig1.metrics.csv").exists()
    record.unlink()
    said = refused(capsys, "stage", "observe", parameter_file, *OBSERVE)
    assert said == f"{record}: cannot be read (No such file or directory)"


def test_parameters_that_are_not_in_results_are_refused(
    parameter_file: Path, tmp_path: Path, capsys: Capture
) -> None:
    moved = parameter_file.rename(tmp_path / "parameters.json")
    said = refused(capsys, "stage", "plant", moved, "constant")
    assert said.startswith(f"{moved}: must be results/ilo/parameters.json in a project")


def test_unknown_name_lists_the_known_ones(
    parameter_file: Path, record: Path, capsys: Capture
) -> None:
    said = refused(capsys, "stage", "observe", parameter_file, "constant", "sampeld")
    assert "there is no 'sampeld'; did you mean 'sampled'?" in said
    said = refused(capsys, "stage", "observe", parameter_file, "constnat", "sampled")
    assert "there is no 'constnat'; did you mean 'constant'?" in said
    said = refused(capsys, "stage", "plant", parameter_file, "nothing")
    assert "constant, periodic, aperiodic, combined" in said
    said = refused(capsys, "params", "ill", "--project", ROOT)
    assert "did you mean 'ilo'" in said
    assert [path.name for path in record.parent.iterdir()] == ["plant.parquet"]


def test_unwritable_output_folder_is_refused(parameter_file: Path, capsys: Capture) -> None:
    """A file in place of a folder: refused for every user, including root."""
    blocked = parameter_file.with_name("constant")
    blocked.touch()
    said = refused(capsys, "stage", "plant", parameter_file, "constant")
    assert said.startswith(f"{blocked / 'plant.parquet'}: cannot be written")
    assert blocked.is_file()


def closed_folder(tmp_path: Path) -> Path:
    """A folder that this user may not write to: for root, who may write anywhere else, sysfs."""
    mine = tmp_path / "closed"
    mine.mkdir(mode=0o555)
    for folder in (mine, Path("/sys")):
        try:
            (folder / "probe").touch()
        except PermissionError:
            return folder
    pytest.skip("this user may write everywhere")


def test_output_folder_without_permission_is_refused(tmp_path: Path, capsys: Capture) -> None:
    output = closed_folder(tmp_path) / "p.json"
    said = refused(capsys, "stage", "parameters", "ilo", "--project", ROOT, "--output", output)
    assert said == f"{output}: cannot be written (Permission denied)"
    assert not output.exists()


def test_divergent_observer_reports_the_time(
    parameter_file: Path, record: Path, capsys: Capture
) -> None:
    """A step beyond the reach of the integrator, which violates no stability condition."""
    parameters = json.loads(parameter_file.read_text(encoding="utf-8"))
    del parameters["sha256"]
    parameters["parameters"]["observers"]["adaptive"]["observer_gain"]["value"] = 1e6
    parameter_file.write_text(json.dumps(sealed(parameters)), encoding="utf-8")
    output = record.with_name("adaptive.parquet")
    said = refused(capsys, "stage", "observe", parameter_file, "constant", "adaptive")
    place, _, found = said.partition(" (AdaptiveObserver) diverged: its state is finite up to t = ")
    assert place == "ilo.observers.adaptive"
    assert found.endswith("; a step of 0.00025 s may be too long for it")
    assert not output.exists()


BAD_CALLS = {
    "papers=[ill]": "config.papers: there is no 'ill'; did you mean 'ilo'?",
}
MORE_BAD_CALLS = {
    "bench=[torqe]": "config.bench: there is no 'torqe'; did you mean 'torque'?",
    "ilo={observers: {continuous: {K1: 1.05, update_interval: 0.01}}}": (
        "ilo.observers.continuous.K1, K2: must give stable error dynamics, but K1 has spectral "
        "radius 1.05 > 1, the estimate grows as exp(4.879 t)"
    ),
    "formats=[gif]": "config.formats.0: 'gif' must be one of pdf, svg, png, eps, pgf",
    "style=ieee-colum": ("config.style: there is no 'ieee-colum'; did you mean 'ieee-column'?"),
    "sede=1": "config.sede: unknown key; did you mean 'seed'?",
    "ilo={observers: {sampled: {K22: 1}}}": (
        "ilo.observers.sampled.K22: unknown key; did you mean 'K2'?"
    ),
}


@pytest.mark.parametrize(
    ("config", "said"),
    [
        *BAD_CALLS.items(),
        *(pytest.param(*call, marks=pytest.mark.nightly) for call in MORE_BAD_CALLS.items()),
    ],
)
def test_snakemake_reports_errors_in_one_sentence(built: Project, config: str, said: str) -> None:
    before = built.results()
    done = built.snakemake("--config", config, check=False)
    assert done.returncode == 1
    assert done.stderr.rstrip().splitlines()[-1] == f"reobserve-papers: {said}"
    assert "Traceback" not in done.stderr
    assert 'File "' not in done.stderr
    assert built.results() == before


def test_error_in_a_parameter_file_is_reported_before_the_first_job(fresh: Project) -> None:
    """Also without overrides. A dry run reads the papers that it is asked for."""
    parameters = fresh.folder / "config/papers/eso.yaml"
    text = parameters.read_text(encoding="utf-8")
    parameters.write_text(text.replace("longest_lag:", "longest_leg:"), encoding="utf-8")
    other = "results/ilo/constant/plant.parquet"
    fresh.snakemake(other, "--dry-run")
    for asked in ([other], ["results/eso/disturbed/plant.parquet", "--dry-run"]):
        done = fresh.snakemake(*asked, check=False)
        assert done.returncode == 1
        assert done.stderr.rstrip().splitlines()[-1] == (
            "reobserve-papers: eso.metrics.longest_leg: unknown key; did you mean 'longest_lag'?"
        )
        assert "Traceback" not in done.stderr
        assert not (fresh.folder / "results/ilo").exists()


@pytest.mark.nightly
def test_error_found_on_construction_stops_the_first_job(fresh: Project) -> None:
    """Also without overrides."""
    parameters = fresh.folder / "config/papers/ilo.yaml"
    text = parameters.read_text(encoding="utf-8")
    stuck = "{kind: constant, axis: 1, from: 5.0, size: 0.5}"
    assert stuck in text
    parameters.write_text(text.replace(stuck, stuck.replace("5.0", "99.0")), encoding="utf-8")
    done = fresh.snakemake("results/ilo/constant/plant.parquet", check=False)
    assert done.returncode == 1
    assert done.stderr.rstrip().splitlines()[-1] == (
        "reobserve-papers: ilo.scenarios.constant.fault: starts at 99 s, must start before the end "
        f"at {PARAMETER_FILES['ilo'].section('plant')['horizon']:g} s"
    )
    assert not (fresh.folder / "results/ilo").exists()


def test_target_that_no_rule_makes_is_refused_with_the_near_one(fresh: Project) -> None:
    """Files of a rule that follows ours are built as before."""
    with (fresh.folder / "Snakefile").open("a", encoding="utf-8") as snakefile:
        snakefile.write(
            'rule mine:\n    output: "results/ilo/{mine}.txt"\n    shell: "touch {output}"'
        )
    fresh.snakemake("results/ilo/mine.txt", "results/ilo/fig1.metrics.tex", "--dry-run")
    for wrong, said in {
        "results/lie/fig1.pgf": "the format pgf is not built; ask for it by --config "
        "'formats=[pgf]'",
        "results/bench/torqe/levels.svg": "there is no 'torqe'; did you mean 'torque'?",
    }.items():
        done = fresh.snakemake(wrong, "--dry-run", check=False)
        assert done.returncode == 1
        assert done.stderr.rstrip().splitlines()[-1] == f"reobserve-papers: {wrong}: {said}"
        assert "Traceback" not in done.stderr
