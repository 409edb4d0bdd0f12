"""Each line that the workflows, the Makefile's help and the container run, as far as it runs here.

What takes minutes elsewhere is run dry. A line that is of no kind is an error.
"""

from __future__ import annotations

import re
import subprocess
from collections.abc import Iterator
from pathlib import Path

import pytest
import yaml

from tests import ROOT

# What cannot run in a test, and why.
NOT_HERE = {
    r"(python -m )?pip install .*": "it would change the environment of the tests",
    r"docker .*": "it needs a container engine; hadolint reads the file in `make package`",
    r"sudo apt-get .*": "it needs rights",
    r"gh release create .*": "it publishes",
    r"\.ci/run": "it runs these tests",
    r"for one in .*extras.*": "tests/package/test_extras.py runs these programs",
}
# In place of what takes minutes.
DRY = {
    r"make .*": "{} --dry-run",
    r"\.venv/bin/snakemake .*": "{} --dry-run",
    r"(\.venv/bin/pytest [^|]*)( \| tee drawn\.txt)?": "{1} --collect-only --quiet",
    r"\.venv/bin/reobserve-papers (\w+) .*": ".venv/bin/reobserve-papers {1} --help",
    r"\.venv/bin/python -m benchmarks .*": ".venv/bin/python -m benchmarks --help",
    r"\.venv/bin/python -m tests\.budget .*": ".venv/bin/python -m tests.budget",
    r"find src (.*) -exec rm -r \{\} \+": "find src {1} -print",
    r"(?:test ! -f \S+ \|\| )?(?:cat|tail -n \d+) \S+ >> \"\$GITHUB_STEP_SUMMARY\"": "{}",
    r"if \[ -f figdiff/summary.md \]; then\n.*\nfi": "{}",
}


def lines() -> Iterator[tuple[str, str]]:
    """The lines by file; those of the matrix with its first value."""
    for path in sorted((ROOT / ".github/workflows").glob("*.yml")):
        for job in yaml.safe_load(path.read_text(encoding="utf-8"))["jobs"].values():
            matrix = job.get("strategy", {}).get("matrix", {})
            for step in job["steps"]:
                if "run" in step:
                    found = re.sub(
                        r"\$\{\{ matrix\.(\w+) \}\}",
                        lambda name, matrix=matrix: str(matrix[name[1]][0]),
                        step["run"].strip(),
                    )
                    yield path.name, found
    for target in re.findall(r"^(\w+):.*##", (ROOT / "Makefile").read_text(), re.MULTILINE):
        yield "Makefile", f"make {target}"
    for line in re.findall(r"^#   (.+)$", (ROOT / "Containerfile").read_text(), re.MULTILINE):
        yield "Containerfile", line


# To collect tests, or to find the jobs of a build, takes seconds.
SLOW = re.compile(r"\.venv/bin/(?:pytest|snakemake) ")
LINES = [
    pytest.param(*one, marks=pytest.mark.nightly if SLOW.match(one[1]) else ())
    for one in sorted(set(lines()))
]


@pytest.mark.parametrize(("file", "line"), LINES)
def test_every_line_runs_or_says_why_not(
    file: str, line: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    if any(re.fullmatch(one, line) for one in NOT_HERE):
        return
    kinds = ((re.fullmatch(one, line, re.DOTALL), form) for one, form in DRY.items())
    found, form = next(((found, form) for found, form in kinds if found), (None, ""))
    assert found, f"{file}: no way to run {line}"
    asked = form.format(line, *found.groups())
    folder = ROOT
    if "GITHUB_STEP_SUMMARY" in line:
        folder = tmp_path
        for name in re.findall(r"[\w/]+\.(?:md|txt)", line):
            (folder / name).parent.mkdir(parents=True, exist_ok=True)
            (folder / name).write_text("what moved\n", encoding="utf-8")
        monkeypatch.setenv("GITHUB_STEP_SUMMARY", str(tmp_path / "summary"))
    asked = asked.replace("--software-deployment-method conda", "")  # there is no conda here
    for name in ("MAKEFLAGS", "MAKELEVEL"):
        monkeypatch.delenv(name, raising=False)
    done = subprocess.run(
        ["bash", "-e", "-c", asked], cwd=folder, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, f"{file}: {line}, run as {asked}:\n{done.stdout}{done.stderr}"
    if folder == tmp_path:
        assert (tmp_path / "summary").read_text(encoding="utf-8") == "what moved\n"
