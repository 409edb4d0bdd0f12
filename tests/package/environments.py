"""Environments that have the wheel, one of its extras and nothing else, made of links.

The packages are those of the environment that tests: what an extra brings is read from the metadata
of the wheel and of all that it requires. `python -m tests.package` installs the same in earnest.
"""

from __future__ import annotations

import os
import subprocess
import sys
import zipfile
from importlib import metadata
from pathlib import Path

from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

ROOT = Path(__file__).parents[2]
EXTRAS = ("core", "design", "symbolic", "plot", "data", "pipeline", "all")
EPOCH = "1700000000"  # the time that builds are told it is


def build(source: Path, folder: Path, *targets: str) -> list[Path]:
    """The wheel, the source archive or both of a checkout, in the order of their names."""
    words = [sys.executable, "-m", "hatchling", "build", "--directory", str(folder)]
    for target in targets:
        words += ["--target", target]
    environment = {**os.environ, "SOURCE_DATE_EPOCH": EPOCH}
    subprocess.run(words, cwd=source, env=environment, capture_output=True, check=True)
    return sorted(folder.iterdir())


def unpack(wheel: Path, folder: Path) -> Path:
    """The wheel as pip lays it out."""
    with zipfile.ZipFile(wheel) as archive:
        archive.extractall(folder)
    return folder


def closure(wheel: Path, extra: str) -> dict[str, metadata.Distribution]:
    """Every distribution that an extra of the unpacked wheel brings, by its name."""
    (root,) = metadata.distributions(path=[str(wheel)])
    found: dict[str, metadata.Distribution] = {}
    seen: set[tuple[str, str]] = set()
    waiting = [(root, part) for part in {"", "" if extra == "core" else extra}]
    while waiting:
        distribution, part = waiting.pop()
        for line in distribution.requires or ():
            needed = Requirement(line)
            if needed.marker is not None and not needed.marker.evaluate({"extra": part}):
                continue
            name = canonicalize_name(needed.name)
            found.setdefault(name, metadata.distribution(name))
            for deeper in ("", *needed.extras):
                if (name, deeper) not in seen:
                    seen.add((name, deeper))
                    waiting.append((found[name], deeper))
    return found


def link(distributions: dict[str, metadata.Distribution], folder: Path) -> Path:
    """A folder that holds these distributions and no others."""
    folder.mkdir()
    for distribution in distributions.values():
        for file in distribution.files or ():
            top = Path(file).parts[0]
            place = folder / top
            if top not in ("..", "__pycache__") and not os.path.lexists(place):
                place.symlink_to(Path(str(distribution.locate_file(top))))
    return folder


def python(*paths: Path) -> tuple[list[str], dict[str, str]]:
    """An interpreter that sees its own library and these folders: its words and its variables."""
    return [sys.executable, "-S"], {**variables(), "PYTHONPATH": os.pathsep.join(map(str, paths))}


def variables() -> dict[str, str]:
    """The variables of this process without those that lead an interpreter elsewhere."""
    leading = ("PYTHONPATH", "PYTHONHOME", "VIRTUAL_ENV")
    return {key: value for key, value in os.environ.items() if key not in leading}
