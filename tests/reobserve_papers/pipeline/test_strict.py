"""Names chosen by users and failing steps must not run code, leave the project or pass
unnoticed."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest
import yaml

from reobserve_papers.steps.freshness import record_of

from .conftest import Project

pytestmark = pytest.mark.nightly


def with_config(project: Project, **paper: object) -> tuple[str, str]:
    """The option that passes these overrides as a file."""
    (project.folder / "mine.yaml").write_text(yaml.safe_dump(paper), encoding="utf-8")
    return "--configfile", "mine.yaml"


def files(folder: Path) -> set[Path]:
    kept = {".snakemake", "__pycache__"}
    return {path for path in folder.rglob("*") if kept.isdisjoint(path.parts)}


@pytest.mark.parametrize("name", ["`touch ran`", "$(touch ran)", "a; touch ran", "../../escaped"])
def test_names_from_a_file_cannot_run_code_or_leave_the_project(fresh: Project, name: str) -> None:
    option = with_config(
        fresh,
        ilo={
            "scenarios": {name: {"like": "constant"}},
            "figures": {"fig9": {"like": "fig1", "scenario": name}},
        },
    )
    around = files(fresh.folder), {path.name for path in fresh.folder.parent.iterdir()}
    done = fresh.snakemake("results/ilo/fig9.metrics.csv", *option, check=False)
    assert done.returncode == 1
    last = done.stderr.rstrip().splitlines()[-1]
    assert last.startswith("reobserve-papers: ilo.scenarios")
    assert "Traceback" not in done.stderr
    assert (files(fresh.folder), {path.name for path in fresh.folder.parent.iterdir()}) == around


@pytest.mark.parametrize(
    ("name", "text", "said"),
    [
        ("mine.yaml", "seed: 2\nilo: {}\nseed: 3\n", "line 3, column 1: the key 'seed' twice"),
        ("mine.json", '{"seed": 2, "seed": 3}', "has the key 'seed' twice"),
    ],
)
def test_duplicate_key_in_a_config_file_is_refused(
    fresh: Project, name: str, text: str, said: str
) -> None:
    """Snakemake silently uses the last of them."""
    (fresh.folder / name).write_text(text, encoding="utf-8")
    target = "results/ilo/constant/plant.parquet"
    done = fresh.snakemake(target, "--dry-run", "--configfile", name, check=False)
    assert done.returncode == 1
    last = done.stderr.rstrip().splitlines()[-1]
    assert last.startswith("reobserve-papers: ")
    assert name in last
    assert last.endswith(said)
    assert not (fresh.folder / "results/ilo").exists()


@pytest.mark.parametrize(
    ("added", "said"),
    [
        (b"seed: 7", "the key 'seed' twice"),
        (b"ilo: n\xe9e", "is not UTF-8)"),
        (b"ilo: " + b"[" * 2000, "nested deeper than 40 levels"),
        (b"ilo: " + b"9" * 5000, "a number of more than 30 characters"),
    ],
    ids=["a key twice", "latin-1", "deep lists", "5000 digits"],
)
def test_config_beyond_plain_yaml_is_refused(fresh: Project, added: bytes, said: str) -> None:
    path = fresh.folder / "config/config.yaml"
    path.write_bytes(path.read_bytes() + b"\n" + added + b"\n")
    done = fresh.snakemake("results/ilo/constant/plant.parquet", "--dry-run", check=False)
    assert done.returncode == 1
    last = done.stderr.rstrip().splitlines()[-1]
    assert last.startswith("reobserve-papers: config/config.yaml: ")
    assert last.endswith(said)
    assert "Traceback" not in done.stderr


def test_file_with_any_name_is_read_without_running_code(fresh: Project) -> None:
    record = fresh.folder / "it's `touch ran` & $HOME.csv"
    record.write_text("time,torque\n0,0.1\n10,0.2\n", encoding="utf-8")
    term = {"kind": "samples", "axis": 1, "file": record.name, "column": "torque"}
    option = with_config(fresh, ilo={"scenarios": {"mine": {"like": "constant", "fault": [term]}}})
    fresh.snakemake("results/ilo/mine/plant.parquet", *option)
    assert not (fresh.folder / "ran").exists()
    stored = json.loads((fresh.folder / "results/ilo/parameters.json").read_text())
    assert stored["parameters"]["scenarios"]["mine"]["fault"]["value"] == [term]


def test_file_named_like_a_pattern_is_read_literally(fresh: Project) -> None:
    term = {"kind": "samples", "axis": 1, "file": "{x}.csv", "column": "torque"}
    (fresh.folder / "{x}.csv").write_text("time,torque\n0,0.1\n10,0.2\n", encoding="utf-8")
    option = with_config(fresh, ilo={"scenarios": {"mine": {"like": "constant", "fault": [term]}}})
    done = fresh.snakemake("results/ilo/mine/plant.parquet", *option, check=False)
    assert done.stderr.rstrip().splitlines()[-1] == (
        "reobserve-papers: ilo.scenarios.mine.fault: '{x}.csv' has braces in its name, which stand "
        "for wildcards"
    )


def test_failure_before_a_pipe_fails_the_job(fresh: Project) -> None:
    """A search prints its progress through `tee`, which never fails."""
    option = with_config(
        fresh, imm={"searches": {"calibrated": {"observers": ["kalman_retuned", "svsf_tuned"]}}}
    )
    done = fresh.snakemake("results/imm/calibrated.search.json", *option, check=False)
    said = "reobserve-papers: imm.observers.svsf_tuned: must have the noise of the others tuned"
    assert done.returncode == 1
    assert said in done.stderr
    assert said in (fresh.folder / "logs/imm/calibrated.search.log").read_text(encoding="utf-8")
    assert "returned non-zero exit status" in done.stdout + done.stderr
    assert "latency" not in done.stdout + done.stderr


def test_jobs_find_programs_next_to_the_python_of_snakemake(fresh: Project) -> None:
    program = str(Path(sys.executable).with_name("snakemake"))
    target = "results/ilo/constant/plant.parquet"
    done = subprocess.run(
        [program, "--cores", "1", target],
        cwd=fresh.folder, env={**fresh.environment, "PATH": os.defpath},
        capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    assert (fresh.folder / target).is_file()


def test_construction_checks_run_once(fresh: Project) -> None:
    """The first build checks all parameters, later ones only changed parameters."""
    target = "results/ilo/constant/plant.parquet"
    fresh.snakemake(target)
    written = fresh.folder / "results/ilo/parameters.json"
    before = written.stat().st_mtime_ns
    fresh.snakemake("--forcerun", "plant", "--", target)
    assert written.stat().st_mtime_ns == before
    option = with_config(fresh, ilo={"observers": {"sampled": {"K2": 90_000}}})
    done = fresh.snakemake(target, "--forcerun", "plant", *option, check=False)
    last = done.stderr.rstrip().splitlines()[-1]
    assert last.startswith("reobserve-papers: ilo.observers.sampled.K1, K2: must give stable")
    assert written.stat().st_mtime_ns == before


@pytest.mark.parametrize("content", [b"\xff\xfe", b'{"a', b"[1]"])
def test_result_with_a_damaged_record_is_made_again(fresh: Project, content: bytes) -> None:
    target = "results/ilo/constant/plant.parquet"
    for path in (fresh.folder / target, record_of(fresh.folder, target)):
        path.parent.mkdir(parents=True)
        path.write_bytes(content)
    assert fresh.stale(target) == {"plant": 1}


def test_unwritable_results_folder_is_reported_in_one_sentence(fresh: Project) -> None:
    """A file in place of a folder, which also stops root."""
    (fresh.folder / "results/ilo").write_text("")
    done = fresh.snakemake("results/lie/figure/plant.parquet", check=False)
    assert done.returncode == 1
    last = done.stderr.rstrip().splitlines()[-1]
    assert last.startswith("reobserve-papers: results/ilo/parameters.json: cannot be written (")
    assert "Traceback" not in done.stderr


@pytest.mark.parametrize("key", ["bench", "papers", "samples", "ilo"])
def test_key_left_empty_is_refused_in_one_sentence(fresh: Project, key: str) -> None:
    (fresh.folder / "mine.yaml").write_text(f"{key}:\n")
    target = "results/ilo/constant/plant.parquet"
    done = fresh.snakemake(target, "--dry-run", "--configfile", "mine.yaml", check=False)
    assert done.returncode == 1
    last = done.stderr.rstrip().splitlines()[-1]
    assert last.startswith(f"reobserve-papers: config.{key}: is left empty")
    assert "Traceback" not in done.stderr


def test_build_needs_no_home_that_can_be_written(fresh: Project) -> None:
    (fresh.folder / "home").write_text("")  # which also stops root
    home = {"HOME": str(fresh.folder / "home"), "XDG_CACHE_HOME": ""}
    environment = fresh.environment | home
    fresh.snakemake("results/ilo/constant/plant.parquet", environment=environment)
    assert (fresh.folder / "results/ilo/constant/plant.parquet").is_file()


def test_folder_with_braces_is_refused_in_one_sentence(fresh: Project) -> None:
    folder = fresh.folder / "with{braces}"
    folder.mkdir()
    for part in ("Snakefile", "workflow", "config", "profiles"):
        (folder / part).symlink_to(fresh.folder / part)
    done = fresh.run(
        "snakemake", "--cores", "1", "--dry-run", "--directory", str(folder), check=False
    )
    assert done.returncode == 1
    last = done.stderr.rstrip().splitlines()[-1]
    assert last.startswith("reobserve-papers: ")
    assert "with{braces}: has braces, which Snakemake takes for wildcards; rename it" in last


@pytest.mark.parametrize(
    ("target", "said"),
    [
        ("results/lie/constant/plant.parquet", "lie.scenarios: there is no 'constant'; there are"),
        ("results/lie/figure/sampled.parquet", "lie.observers: there is no 'sampled'; did you"),
        ("results/delay/fig4.pdf", "delay.figures: there is no 'fig4'; did you mean 'fig3'?"),
    ],
)
def test_target_of_another_paper_is_reported_in_one_sentence(
    fresh: Project, target: str, said: str
) -> None:
    done = fresh.snakemake("--dry-run", target, check=False)
    assert done.returncode == 1
    assert done.stderr.rstrip().splitlines()[-1].startswith(f"reobserve-papers: {said}")
    assert "Traceback" not in done.stderr


@pytest.mark.parametrize(
    ("claims", "said"),
    [
        (
            "limitations: x\nclaims: [a, b]",
            "claims.ilo.claims: ['a', 'b'] must be a mapping of keys to values",
        ),
        ("claims: {a: words}", "claims.ilo.limitations: is missing; the claims file needs it"),
        ("words", "must be a mapping of keys to values"),
        (
            "a: b",
            "claims.ilo.a: unknown key; there are: limitations, result, choices, excluded, claims, "
            "figures, history",
        ),
    ],
)
def test_invalid_claims_stop_the_first_job(fresh: Project, claims: str, said: str) -> None:
    (fresh.folder / "config/claims/ilo.yaml").write_text(claims)
    done = fresh.snakemake("--dry-run", "figures", check=False)
    assert done.returncode == 1
    assert done.stderr.rstrip().endswith(said)
    assert "Traceback" not in done.stderr


def test_editor_swap_files_are_ignored(fresh: Project) -> None:
    for name in ("config/papers/.ilo.yaml.swp", "workflow/.Snakefile.swp"):
        (fresh.folder / name).write_bytes(b"\xff\xfe\x00")
    assert fresh.stale() != {}
