"""The size and cost of the project, as `tests/budget.toml` states them and as they are.

`python -m tests.budget` prints the sizes as they are, to be put into the table.
`python -m tests.budget COMMAND...` runs a command of the table and compares what it costs.
"""

from __future__ import annotations

import csv
import resource
import subprocess
import sys
import tomllib
from pathlib import Path

from . import ROOT

TABLE = "tests/budget.toml"
BELOW = 0.03  # share by which a size may be below the table

Sizes = dict[str, dict[str, int]]


def stated(root: Path = ROOT) -> Sizes:
    """The sizes of the table, by section and part."""
    sections: Sizes = tomllib.loads((root / TABLE).read_text(encoding="utf-8"))
    return {
        name: parts for name, parts in sections.items() if name.startswith(("lines of", "words of"))
    }


def counted(root: Path = ROOT) -> Sizes:
    """The sizes as they are: lines of Python, of all files in `workflow`, and words of pages."""
    pages = root / "docs/pages"
    of_parts = {f"lines of {folder}": _parts(root / folder) for folder in _FOLDERS}
    return {
        **of_parts,
        "lines of": {
            "docs": sum(_parts(root / "docs").values()),
            "benchmarks": sum(_parts(root / "benchmarks").values()),
            "workflow": sum(map(_lines, (root / "workflow").rglob("*.*"))),
        },
        "words of": {
            **{name: _words(root / name) for name in _TEXTS},
            **{
                f"docs/pages/{part.name}": sum(map(_words, part.rglob("*.md")))
                for part in sorted(pages.iterdir())
                if any(part.rglob("*.md"))
            },
            "docs/pages": sum(map(_words, pages.glob("*.md"))),
        },
    }


_FOLDERS = ("src/reobserve", "src/reobserve_papers", "tests/reobserve", "tests/reobserve_papers",
            "tests")  # fmt: skip
_TEXTS = ("README.md", "CHANGELOG.md", "CONTRIBUTING.md")


def _parts(folder: Path) -> dict[str, int]:
    """Lines of Python in each folder that has no section of its own, and beside the folders."""
    found = {
        part.name: sum(map(_lines, part.rglob("*.py")))
        for part in sorted(folder.iterdir())
        if any(part.rglob("*.py")) and not str(part).endswith(_FOLDERS[2:4])
    }
    return {**found, "files beside": sum(map(_lines, folder.glob("*.py")))}


def _lines(path: Path) -> int:
    return path.read_bytes().count(b"\n") if path.is_file() else 0


def _words(page: Path) -> int:
    return len(page.read_text(encoding="utf-8").split())


def differences(table: Sizes, sizes: Sizes) -> list[str]:
    """A sentence for each part that is above its size in the table, or far below it."""
    found = []
    for section in dict.fromkeys([*table, *sizes]):
        before, now = table.get(section, {}), sizes.get(section, {})
        for part in dict.fromkeys([*before, *now]):
            old, new = before.get(part, 0), now.get(part, 0)
            if not (1 - BELOW) * old <= new <= old or part not in before or part not in now:
                what = f"{part} = {new}" if part in now else f"no {part}"
                found.append(
                    f"{section} {part}: {new}, where {TABLE} has {old}: put '{what}' under "
                    f"[{section}] there, with the reason in the message of the commit"
                )
    return found


def job_seconds(logs: Path) -> float:
    """The sum of what the jobs of the last build took, by Snakemake's measurements."""
    found = 0.0
    for path in logs.rglob("*.tsv"):
        with path.open(encoding="utf-8", newline="") as stream:
            found += sum(float(row["s"]) for row in csv.DictReader(stream, delimiter="\t"))
    return found


def run(words: list[str]) -> int:
    """Run a command of the table, and fail where it fails or costs 1.3 times what is stated."""
    limits = tomllib.loads((ROOT / TABLE).read_text(encoding="utf-8"))["seconds"]
    command = " ".join(words)
    if command not in limits:
        sys.exit(f"{TABLE}: [seconds] has no {command!r}, only {', '.join(limits)}")
    code = subprocess.run(words, cwd=ROOT, check=False).returncode
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    costs = {command: used.ru_utime + used.ru_stime, "jobs of a build": job_seconds(ROOT / "logs")}
    for what, cost in costs.items():
        print(f"{what}: {cost:.0f} s, {TABLE} has {limits[what]}", flush=True)
    return code or int(any(cost > 1.3 * limits[what] for what, cost in costs.items()))


if __name__ == "__main__":
    if sys.argv[1:]:
        sys.exit(run(sys.argv[1:]))
    for section, parts in counted().items():
        print(
            f'["{section}"]', *(f'"{part}" = {size}' for part, size in parts.items()), "", sep="\n"
        )
