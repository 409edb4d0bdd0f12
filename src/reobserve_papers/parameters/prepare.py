"""The parameters of a build: read and checked for the Snakefile, and written for its jobs."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections.abc import Iterable, Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any

from reobserve.core.errors import InputError, ReobserveError, shown
from reobserve.core.files import write_text
from reobserve_papers.parameters.config import check_config, known_papers, known_tasks, take_truths
from reobserve_papers.parameters.names import DEFAULT_STYLE, stored_parameters, style_sheet
from reobserve_papers.parameters.parameters import Parameters
from reobserve_papers.signals.inputs import sample_files

# Of the workflow; the README and pages say the same.
PLATFORMS = (
    "needs bash and a POSIX system and is tested on Linux; the library runs wherever numba has "
    "wheels"
)

_PATIENCE = 5.0  # [s] for interpreted loops, after which compiling them is faster
_DEFAULTS = {"style": DEFAULT_STYLE, "notes": True, "latex": False}


def check_folders(project: Path) -> None:
    """Refuse folders that Snakemake cannot use."""
    for folder in (str(project.absolute()), str(Path(sys.executable).parent)):
        if "{" in folder or "}" in folder:
            raise InputError(folder, "has braces, which Snakemake takes for wildcards; rename it")


def load_parameters(project: Path, config: dict[str, Any]) -> dict[str, Parameters]:
    """The parameters of all papers with the overrides of ``config``, to which defaults are added.

    Their form is checked, the keys and values of each paper by
    `reobserve_papers.claims.configuration_checks.checked_papers`; `write_parameters` also
    constructs plants and observers.
    """
    if os.name != "posix":
        raise InputError("the workflow", PLATFORMS)
    papers = known_papers(project)
    take_truths(config)
    check_config(project, config, papers)
    tasks = [] if "papers" in config else known_tasks(project)
    for key, default in {**_DEFAULTS, "papers": papers, "bench": tasks}.items():
        config.setdefault(key, default)
    if config["style"] != DEFAULT_STYLE:  # else this would import matplotlib in vain
        from reobserve_papers.plotting.style_sheet import read_sheet

        read_sheet(project / style_sheet(project, config["style"]))
    found = {}
    for paper in papers:
        found[paper] = Parameters.load(project, paper, config.get(paper), config["seed"])
    return found


def write_parameters(
    project: Path, parameters: Mapping[str, Parameters], config: Mapping[str, Any]
) -> None:
    """Write the parameters that have changed, once plants and observers could be constructed."""
    try:
        changed = [
            paper
            for paper, parameters in parameters.items()
            if _stored(project, paper) != parameters.text()
        ]
        if changed:
            _check({paper: config.get(paper, {}) for paper in changed})
        for paper in changed:
            write_text(project / stored_parameters(paper), parameters[paper].text())
    except ReobserveError as error:
        sys.exit(f"reobserve-papers: {error}")


def refuse_beside_another_build(project: Path, parameters: Mapping[str, Parameters]) -> None:
    """Refuse to change parameters that the jobs of another build may still have to read.

    Snakemake lets two builds run in one folder if they write different files.
    """
    if any((project / ".snakemake" / "locks").glob("*.lock")):
        changed = [one for one in parameters if _stored(project, one) != parameters[one].text()]
        if changed:
            raise ReobserveError(
                f"another build runs in this folder, with other parameters of "
                f"{', '.join(changed)}; wait for it to end, or type `snakemake --unlock` if it "
                "was killed"
            )


def _stored(project: Path, paper: str) -> str:
    try:
        return (project / stored_parameters(paper)).read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError):
        return ""


def _check(overrides: Mapping[str, Any]) -> None:
    """Run `reobserve-papers check` in a process of its own, which loads kernels.

    Its loops take a few steps, so that interpreting them is faster than compiling. Compiled code
    decides where that fails: it divides by zero without an error.
    """
    command = [
        sys.executable,
        "-m",
        "reobserve_papers",
        "check",
        "--overrides",
        "-",
        "--",
        *overrides,
    ]
    for variables, seconds in (({"NUMBA_DISABLE_JIT": "1"}, _PATIENCE), ({}, None)):
        with suppress(subprocess.TimeoutExpired):
            done = subprocess.run(
                command, input=json.dumps(overrides), env={**os.environ, **variables},
                capture_output=True, text=True, check=False, timeout=seconds,
            )  # fmt: skip
            if done.returncode == 0:
                return
    sys.exit(
        (done.stderr.strip().splitlines() or ["reobserve-papers: the check of parameters failed"])[
            -1
        ]
    )


def check_files(parameters: Parameters) -> None:
    """Refuse names of files that Snakemake would take for patterns."""
    for key, entry in parameters.entries():
        files: Iterable[str] = sample_files(entry["value"])
        if entry["unit"] == "file":
            files = [*files, str(entry["value"])]
        for file in files:
            if set(file) & set("{}"):
                problem = f"{shown(file)} has braces in its name, which stand for wildcards"
                raise InputError(f"{parameters.paper}.{key}", problem)
