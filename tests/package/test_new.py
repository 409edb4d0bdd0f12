"""A repository that `reobserve-papers new` writes works as written, from the wheel alone."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections.abc import Mapping
from importlib import metadata
from pathlib import Path
from types import SimpleNamespace

import pytest

from reobserve_papers.cli.main import main
from tests import ROOT

Done = subprocess.CompletedProcess[str]
COMMIT = "git -c user.name=t -c user.email=t@example.org commit --quiet"
LINES = 150  # of Python, for a figure and a claim


def run(folder: Path, *words: str, variables: Mapping[str, str] | None = None) -> Done:
    path = os.pathsep.join([str(Path(sys.executable).parent), os.environ["PATH"]])
    environment = {**os.environ, "PATH": path, "CI": "", **(variables or {})}
    return subprocess.run(
        words, cwd=folder, env=environment, capture_output=True, text=True, check=False
    )


@pytest.fixture
def mine(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A new repository, written by this checkout."""
    monkeypatch.chdir(tmp_path)
    assert main(["new", "mine"]) == 0
    return tmp_path / "mine"


def test_new_repository_is_small_sound_and_renamed(mine: Path) -> None:
    files = [path for path in mine.rglob("*") if path.is_file()]
    assert len((mine / "src/mine.py").read_text(encoding="utf-8").splitlines()) <= LINES
    assert not any("two_mass" in str(path.relative_to(mine)) for path in files)
    texts = (path.read_text("utf-8") for path in files if path.suffix not in (".png", ".txt"))
    assert not any("two_mass" in text or str(ROOT) in text for text in texts)
    assert "mine: parameters, claims, conventions and errata are sound" in checked(mine).stderr


@pytest.mark.parametrize(
    ("origin", "requirement"),
    [
        (
            {"url": "https://example.org/r.git", "vcs_info": {"vcs": "git", "commit_id": "abc"}},
            " @ git+https://example.org/r.git@abc",
        ),
        (
            {"url": "file:///home/checkout", "dir_info": {"editable": True}},
            " @ file:///home/checkout",
        ),
        ({"url": "file:///home/r.whl", "archive_info": {}}, " @ file:///home/r.whl"),
        (None, "==9.9"),
    ],
)
def test_requirements_name_what_is_installed(
    origin: object, requirement: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:  # fmt: skip
    """The steps that are printed install them before `make test` needs them."""
    found = SimpleNamespace(
        version="9.9", read_text=lambda name: json.dumps(origin) if origin else None
    )
    monkeypatch.setattr(metadata, "distribution", lambda name: found)
    monkeypatch.chdir(tmp_path)
    assert main(["new", "mine"]) == 0
    lines = (tmp_path / "mine/requirements.txt").read_text().splitlines()
    assert [line for line in lines if not line.startswith("#")] == [
        f"reobserve[papers]{requirement}", "pytest",
    ]  # fmt: skip
    said = capsys.readouterr().out
    assert said.index("pip install -r requirements.txt") < said.index("make test")


def test_name_may_have_digits_and_capitals(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    assert main(["new", "Gain2"]) == 0
    assert "errata are sound" in checked(tmp_path / "Gain2").stderr


def test_workflows_of_a_new_repository_meet_their_schema(mine: Path) -> None:
    workflows = sorted(map(str, mine.glob(".github/workflows/*.yml")))
    assert len(workflows) == 2
    schema = ("check-jsonschema", "--builtin-schema", "vendor.github-workflows")
    assert run(mine, *schema, *workflows).returncode == 0


@pytest.mark.parametrize(
    ("name", "problem"),
    [
        ("numpy", "is the name of a Python module that is installed"),
        ("lambda", "is a word of Python's own"),
        ("my-paper", "is no name: a letter, then up to 59 letters, digits and _"),
        ("there", "there is a 'there' in this folder already"),
    ],
)
def test_name_of_a_new_repository_is_refused(
    name: str, problem: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:  # fmt: skip
    monkeypatch.chdir(tmp_path)
    (tmp_path / "there").mkdir()
    assert main(["new", name]) == 1
    assert problem in capsys.readouterr().err
    assert [path.name for path in tmp_path.iterdir()] == ["there"]


def checked(mine: Path, *words: str) -> Done:
    return run(mine, "reobserve-papers", "check", *words)


def edit(path: Path, old: str, new: str) -> None:
    text = path.read_text(encoding="utf-8")
    assert old in text
    path.write_text(text.replace(old, new), encoding="utf-8")


MODULE, PARAMETERS = Path("src/mine.py"), Path("config/papers/mine.yaml")


@pytest.mark.nightly_cases("library", "name", "import")
@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ('"errors": errors}', '"errors": errors', "line 150: SyntaxError: '{' was never closed"),
        ("import numpy as", "import nump as", "line 14: ModuleNotFoundError: No module named "),
        ('Channel(force, "N")', 'Chanel(force, "N")', "line 98: NameError: name 'Chanel' is not "),
        ("0.0, 0.0]]", "0.0]]", "C: has shape (1, 3), must be (m, 4), as A is (4, 4) (src/mine.py"),
    ],
    ids=["syntax", "import", "name", "library"],
)  # fmt: skip
def test_error_in_a_module_names_file_and_line(mine: Path, old: str, new: str, said: str) -> None:
    edit(mine / MODULE, old, new)
    built = run(mine, "snakemake", "--cores", "1", "results/mine/fig1.png")
    found = f"{built.stdout}\n{built.stderr}"
    assert built.returncode == 1
    assert said in found
    assert "src/mine.py, line " in found
    assert "Traceback" not in found


def test_traceback_is_shown_when_it_is_asked_for(mine: Path) -> None:
    edit(mine / MODULE, '"errors": errors}', '"errors": errors')
    assert "Traceback (most recent call last)" in checked(mine, "--traceback").stderr
    assert "Traceback" not in checked(mine).stderr


def test_undefined_layout_is_reported_before_anything_runs(mine: Path) -> None:
    edit(mine / PARAMETERS, "layout: errors", "layout: error")
    assert "figures.fig1.layout: 'error' must be one of errors" in checked(mine).stderr


@pytest.mark.nightly
def test_paper_without_claims_and_errata_has_a_whole_report(mine: Path) -> None:
    (mine / "config/claims/mine.yaml").write_text("claims: {}\n", encoding="utf-8")
    (mine / "config/errata/mine.yaml").unlink()
    done = run(mine, "make", "test")
    assert done.returncode == 0, f"{done.stdout}{done.stderr}"
    page = (mine / "results/report.html").read_text(encoding="utf-8")
    assert "No gaps: " in page
    assert 'class="gap"' not in page
    assert "None stated." in page
    assert "None found." in page


@pytest.mark.nightly
def test_new_repository_builds_from_the_wheel_alone(
    wheel: dict[str, bytes], tmp_path: Path
) -> None:
    site, folder = tmp_path / "site", tmp_path / "empty"
    folder.mkdir()
    for name, content in wheel.items():
        (site / name).parent.mkdir(parents=True, exist_ok=True)
        (site / name).write_bytes(content)
    variables = {"PYTHONPATH": str(site), "PYTHONDONTWRITEBYTECODE": ""}

    def typed(line: str, place: Path) -> str:
        done = run(place, *line.split(), variables=variables)
        assert done.returncode == 0, f"{line}:\n{done.stdout}{done.stderr}"
        return done.stdout + done.stderr

    typed("reobserve-papers new mine", folder)
    mine = folder / "mine"
    for line in ("git init --quiet", "git add --all"):
        typed(line, mine)
    typed(f"{COMMIT} --message all", mine)
    show = "import reobserve_papers; print(reobserve_papers.workflow_path())"
    rules = run(mine, sys.executable, "-c", show, variables=variables)
    assert rules.stdout.startswith(str(site)), rules.stderr
    typed("make", mine)
    assert "2 passed" in typed("make test", mine)
    assert "2 agree" in typed("make figdiff", mine)
    assert "Nothing to be done" in typed("snakemake --cores 1", mine)
    call = f"replicate('mine', 'fig1', project={str(mine)!r})"
    show = f"from reobserve_papers import replicate; print({call}.metrics)"
    done = run(folder, sys.executable, "-c", show, variables=variables)
    assert "rms_error" in done.stdout, done.stderr

    edit(mine / PARAMETERS, "value: 12.0", "value: 12.5")
    done = run(mine, "make", "figdiff", variables=variables)
    assert done.returncode != 0
    assert "- mine fig1: moved" in done.stdout
    assert "observers.placed.pole 12.0 -> 12.5" in done.stdout
    typed(
        "git -c user.name=t -c user.email=t@example.org commit --quiet --all --message pole", mine
    )
    words = ("make", "accept", "REASON=the pole moved on purpose")
    assert run(mine, *words, variables=variables).returncode == 0
    assert "2 agree" in typed("make figdiff", mine)
