"""The command `new`: a repository for a new paper, which begins as the worked example."""

from __future__ import annotations

import json
import keyword
import shutil
import tempfile
from importlib import metadata
from importlib.util import find_spec
from pathlib import Path

from reobserve.core.errors import InputError, shown
from reobserve.core.files import reason
from reobserve.core.validation import parse
from reobserve_papers.parameters.names import own_project
from reobserve_papers.parameters.parameter_file import Configuration, Name

EXAMPLE = "two_mass"

# What a build of the example leaves behind.
_BUILT = shutil.ignore_patterns("results", "logs", "figdiff", "build", ".snakemake", "*cache*")


def new_command(name: str) -> None:
    """Write the repository into a new folder of the paper's name, and print what to do there."""
    parse(Name, name, "NAME")
    if name in (*Configuration.model_fields, "bench"):
        raise InputError("NAME", f"{shown(name)} is a key of config/config.yaml")
    if keyword.iskeyword(name):
        raise InputError("NAME", f"{shown(name)} is a word of Python's own")
    if Path(name).exists():
        raise InputError("NAME", f"there is a {shown(name)} in this folder already")
    if find_spec(name) is not None:
        raise InputError("NAME", f"{shown(name)} is the name of a Python module that is installed")
    try:
        with tempfile.TemporaryDirectory(prefix=f".{name}-", dir=".") as folder:
            _write(Path(folder) / name, name)
            (Path(folder) / name).rename(name)
    except OSError as error:
        raise InputError("NAME", f"{shown(name)} cannot be written ({reason(error)})") from None
    print(
        f"{name}: a paper to begin with, with one figure and one claim\n"
        f"  cd {name}\n"
        "  pip install -r requirements.txt  # reobserve and pytest\n"
        "  make              # every figure and claim, results/report.html\n"
        "  make test         # the parameter files, the tests, and the accepted numbers\n"
        "  git init          # before `make accept`, which takes a commit\n"
        f"then replace the example by your paper: config/papers/{name}.yaml, src/{name}.py"
    )


def _write(folder: Path, name: str) -> None:
    shutil.copytree(own_project() / "examples" / EXAMPLE, folder, ignore=_BUILT)
    for path in sorted(folder.rglob("*"), reverse=True):  # what is in a folder before the folder
        if path.is_file() and path.suffix != ".png":
            text = path.read_text(encoding="utf-8")
            path.write_text(text.replace(EXAMPLE, name), encoding="utf-8")
        path.rename(path.with_name(path.name.replace(EXAMPLE, name)))
    (folder / "requirements.txt").write_text(f"{_requirement()}\npytest\n", encoding="utf-8")


def _requirement() -> str:
    """The installed version of reobserve for pip: from where it was installed, if that is known."""
    source = metadata.distribution("reobserve").read_text("direct_url.json")
    origin = json.loads(source) if source else {}
    if "vcs_info" in origin:
        version = origin["vcs_info"]
        return f"reobserve[papers] @ {version['vcs']}+{origin['url']}@{version['commit_id']}"
    hint = "# On other machines: reobserve[papers] @ git+ADDRESS, that of its repository.\n"
    if "url" in origin:
        return f"{hint}reobserve[papers] @ {origin['url']}"
    return f"{hint}reobserve[papers]=={metadata.version('reobserve')}"
