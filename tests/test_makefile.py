"""The set-up of the environment by make, with a stub in place of Python."""

from __future__ import annotations

import os
import shutil
import subprocess
from collections.abc import Callable
from pathlib import Path

import pytest

from tests import ROOT

# What make asks of Python on the way to an environment; it clears as `python -m venv` does.
STUB = """#!/bin/sh
case "$1 $2 $3" in
"-m venv --clear")
    rm -rf "$4"/*
    mkdir -p "$4/bin"
    ;;
*)
    exit 2
    ;;
esac
"""


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """What make needs to set up an environment, in a folder of its own."""
    project = tmp_path / "project"
    (project / "workflow/envs").mkdir(parents=True)
    shutil.copy(ROOT / "Makefile", project)
    for name in (
        "requirements.lock",
        "requirements-build.lock",
        "requirements-uv.lock",
        "pyproject.toml",
    ):
        (project / name).touch()
    (project / "workflow/envs/install.sh").write_text("env > installed_with\n")
    stub = tmp_path / "python"
    stub.write_text(STUB)
    stub.chmod(0o755)
    return project


def make(target: str, folder: Path, **variables: str) -> subprocess.CompletedProcess[str]:
    environment = {name: text for name, text in os.environ.items() if not name.startswith("MAKE")}
    environment |= variables
    command = ["make", target, f"PYTHON={folder.parent / 'python'}"]
    return subprocess.run(
        command, cwd=folder, env=environment, capture_output=True, text=True, check=False
    )


def make_env(folder: Path, **variables: str) -> subprocess.CompletedProcess[str]:
    return make("env", folder, **variables)


def test_environment_is_set_up_once(folder: Path) -> None:
    assert make_env(folder).returncode == 0
    assert (folder / ".venv/.installed").is_file()
    assert "Nothing to be done" in make_env(folder).stdout


@pytest.mark.parametrize("way", [shutil.copytree, shutil.move])
def test_environment_of_another_folder_is_set_up_again(
    folder: Path, way: Callable[[Path, Path], object]
) -> None:
    assert make_env(folder).returncode == 0
    other = folder.parent / "with a space"
    way(folder, other)
    assert "Nothing to be done" not in make_env(other).stdout
    assert "Nothing to be done" in make_env(other).stdout


def test_packages_go_into_the_environment_whatever_is_set_for_pip(folder: Path) -> None:
    assert not make_env(folder, PIP_USER="yes", PIP_TARGET="t", PIP_PREFIX="p").returncode
    seen = (folder / "installed_with").read_text().splitlines()
    assert {one for one in seen if one.startswith(("PIP_USER", "PIP_T", "PIP_P"))} == {"PIP_USER=0"}


@pytest.mark.parametrize("linked", [False, True])
def test_clean_removes_results_with_the_records_of_them(folder: Path, linked: bool) -> None:
    (folder / "src").mkdir()
    kept = folder.parent / "large disk" if linked else folder / "results"
    (kept / "ilo").mkdir(parents=True)
    for name in ("README.md", "ilo/fig1.png"):
        (kept / name).touch()
    if linked:
        (folder / "results").symlink_to(kept)
    (folder / ".snakemake").mkdir()
    assert make("clean", folder).returncode == 0
    assert [path.name for path in kept.rglob("*")] == ["README.md"]
    assert not (folder / ".snakemake").exists()


def test_text_has_the_same_ends_of_lines_in_any_checkout(tmp_path: Path) -> None:
    """As by git's setting autocrlf, with which a shell script would not run."""
    listed = subprocess.run(
        ["git", "-c", "core.autocrlf=true", "ls-files", "--eol"],
        cwd=ROOT, capture_output=True, text=True, check=True,
    ).stdout.splitlines()  # fmt: skip
    found = {tuple(line.split("\t")[0].split()) for line in listed}
    binary = ("i/-text", "w/-text", "attr/-text")
    lines = {(f"i/{kind}", f"w/{kind}", "attr/text=auto", "eol=lf") for kind in ("lf", "none")}
    assert found <= {binary, *lines}
    for name in (".gitattributes", "workflow/envs/install.sh"):
        shutil.copy(ROOT / name, tmp_path)
    git = ["git", "-C", str(tmp_path), "-c", "core.autocrlf=true"]
    for words in (["init", "--quiet"], ["add", "--all"]):
        subprocess.run([*git, *words], check=True)
    (tmp_path / "install.sh").unlink()
    subprocess.run([*git, "checkout-index", "--all"], check=True)
    assert b"\r" not in (tmp_path / "install.sh").read_bytes()


def test_environment_that_is_a_link_is_refused_and_not_cleared(folder: Path) -> None:
    other = folder.parent / "other"
    other.mkdir()
    (other / "kept").touch()
    (folder / ".venv").symlink_to(other)
    done = make_env(folder)
    assert done.returncode
    assert "make: .venv is a link, and what it links to would be cleared" in done.stderr
    assert [path.name for path in other.iterdir()] == ["kept"]


def test_link_to_an_environment_that_is_up_to_date_is_used(folder: Path) -> None:
    assert make_env(folder).returncode == 0
    (folder / ".venv").rename(folder.parent / "other")
    (folder / ".venv").symlink_to(folder.parent / "other")
    assert make_env(folder).returncode == 0


def test_other_processors_have_builds_of_their_own() -> None:
    """Results of this checkout are of this processor: compared with them, everything would pass."""
    for target, runs in (("elsewhere", 2), ("mixed", 1)):
        done = subprocess.run(
            ["make", "--dry-run", target], cwd=ROOT, check=True, capture_output=True, text=True
        )
        lines = [line for line in done.stdout.splitlines() if "test_golden.py" in line]
        assert len(lines) == runs
        for line in lines:
            assert line.startswith("OPENBLAS_CORETYPE=")
            assert "pytest --build-apart tests/" in line


# Python with pip and uv that note what they are called with; uv fails if there is a file UV_FAILS,
# and cannot be installed if there is a file NO_UV.
INSTALLERS = """#!/bin/sh
echo "$UV_DEFAULT_INDEX $*" >> "$NOTES/calls"
case "$*" in
*"config get"*) exit 1 ;;
*requirements-uv.lock) test ! -e "$NOTES/NO_UV" ;;
"-m uv "*) test ! -e "$NOTES/UV_FAILS" || { printf 'error: no\\n  route\\n' >&2; exit 2; } ;;
esac
"""


def install(
    folder: Path, *files: str, stub: str = INSTALLERS, **variables: str
) -> tuple[list[str], str]:
    """Run the script with these stubs: what it installs, with what, and what it reports."""
    python = folder / "python"
    python.write_text(stub)
    python.chmod(0o755)
    for name in files:
        (folder / name).touch()
    script = ["sh", "workflow/envs/install.sh"]
    known = {name: text for name, text in os.environ.items() if not name.startswith(("PIP", "UV"))}
    environment = known | {"PYTHON": str(python), "NOTES": str(folder)} | variables
    done = subprocess.run(
        script, cwd=ROOT, env=environment, capture_output=True, text=True, check=True
    )
    called = (folder / "calls").read_text().splitlines()
    return [one for one in called if "config get" not in one], done.stderr


LAST = {"requirements-build.lock", "requirements.lock", "."}


def test_uv_installs_the_locks_and_pip_only_uv(tmp_path: Path) -> None:
    (first, *others), reported = install(tmp_path)
    assert " -m pip install --require-hashes" in first
    assert first.endswith("-r requirements-uv.lock")
    assert {one.split()[-1] for one in others} == LAST
    assert all(one.startswith(" -m uv pip install") for one in others)
    assert not reported


def test_pip_does_not_install_for_the_user(tmp_path: Path) -> None:
    """Also where conda calls the script, without make."""
    stub = INSTALLERS.replace('echo "$UV', 'echo "$PIP_USER $UV')
    called, _ = install(tmp_path, "NO_UV", stub=stub, PIP_USER="yes")
    assert {one.split()[0] for one in called} == {"0"}


@pytest.mark.parametrize(
    ("file", "why"), [("UV_FAILS", "error: no route"), ("NO_UV", "it could not be installed")]
)
def test_pip_takes_over_where_uv_fails(tmp_path: Path, file: str, why: str) -> None:
    called, reported = install(tmp_path, file)
    assert reported.splitlines() == [f"pip installs in place of uv, which failed: {why}"]
    by_pip = [one.split() for one in called[-3:]]
    assert {one[-1] for one in by_pip} == LAST
    assert all(one[:3] == ["-m", "pip", "install"] for one in by_pip)
    assert all("--require-hashes" in one for one in by_pip[:2])


def test_index_of_pip_is_that_of_uv(tmp_path: Path) -> None:
    called, _ = install(tmp_path, PIP_INDEX_URL="file:///index")
    assert {one.split()[0] for one in called} == {"file:///index"}
