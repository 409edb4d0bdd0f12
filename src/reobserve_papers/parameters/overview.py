"""Lists of papers, figures, scenarios and observers, and parameters as a table."""

from __future__ import annotations

import shutil
import textwrap
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from reobserve.core.documents import Tree, read_yaml
from reobserve.core.errors import InputError, nearest, shown
from reobserve_papers.parameters.config import known_papers, named_papers
from reobserve_papers.parameters.names import stored_parameters
from reobserve_papers.parameters.parameters import Parameters
from reobserve_papers.parameters.step_kinds import KINDS


def show_list(project: Path, paper: Sequence[str]) -> None:
    """Print papers with their figures, tables, scenarios, observers and what is built."""
    formats = read_yaml(project / "config" / "config.yaml")["formats"]
    for name in named_papers(known_papers(project), paper):
        tree = Parameters.load(project, name).tree
        about = tree["about"]
        names = [author.split()[-1] for author in about["authors"]]
        year = f" ({about['year']})" if "year" in about else ""
        print(f"{name}  {' & '.join(names)}{year}, {about['title']}")
        folder = project / "results" / name
        rows = []
        for figure, body in tree["figures"].items():
            built = [kind for kind in formats if (folder / f"{figure}.{kind}").exists()]
            state = f"built: {', '.join(built)}" if built else "not built"
            rows.append((figure, body["title"], state))
        _print_rows("figures", rows, f"make one: snakemake --cores 2 results/{name}/FIGURE.pdf")
        rows = [
            (table, body["title"], _state(folder / f"{table}.csv"))
            for table, body in tree.get("tables", {}).items()
        ]
        _print_rows("tables", rows)
        rows = [
            (scenario, body["title"], _state(folder / scenario / "plant.parquet"))
            for scenario, body in tree["scenarios"].items()
        ]
        _print_rows("scenarios", rows)
        _print_rows("designs", _made(folder, tree, "design"))
        rows = []
        for observer, body in tree["observers"].items():
            runs = sorted(path.parent.name for path in folder.glob(f"*/{observer}.parquet"))
            rows.append((observer, body["label"], f"run on: {', '.join(runs)}" if runs else ""))
        _print_rows("observers", rows)
        for step, kind in KINDS.items():
            if step == kind.about and step not in ("design", "table"):  # which are above
                _print_rows(kind.section, _made(folder, tree, step))
    print("\nreobserve-papers params PAPER shows the numbers behind a paper, with their sources.")


def show_params(project: Path, paper: str, match: str, why: bool, built: bool) -> None:
    """Print the parameters of a paper: key, value, unit, source, and the range of an assumption."""
    if built:
        parameters = Parameters.read(project / stored_parameters(paper))
    else:
        parameters = Parameters.load(project, paper)
    width = shutil.get_terminal_size((120, 40)).columns
    rows = [
        (path, _value(entry["value"]), entry["unit"], entry["source"], _range(entry), entry)
        for path, entry in parameters.entries()
        if match in path
    ]
    if not rows:
        parts = [path.split(".") for path, _ in parameters.entries()]
        known = {".".join(one[i:k]) for one in parts for k in range(len(one) + 1) for i in range(k)}
        raise InputError("match", f"no key contains {shown(match)}{nearest(match, sorted(known))}")
    header = ("key", "value", "unit", "source", "range")
    limits = [44, 26, 12, 40, 24]
    if width < sum(limits) + 8:
        limits = [36, 20, 9, 26, 18]
    _print_cells(header, limits)
    _print_cells(["-" * limit for limit in limits], limits)
    for *cells, entry in rows:
        _print_cells(cells, limits)
        if why and "why" in entry:
            print(textwrap.indent(textwrap.fill(" ".join(entry["why"].split()), 100), "    "))
    assumed = sum(row[3] == "assumed" for row in rows)
    print(f"\n{len(rows)} entries, {assumed} of them assumed: the paper does not give them.")
    if not why and assumed:
        print("--why shows the reason for each assumption.")


def _state(path: Path) -> str:
    return "built" if path.exists() else "not built"


def _made(folder: Path, tree: Tree, step: str) -> list[tuple[str, str, str]]:
    """The branches of the section that a step is about, and whether their results are there."""
    return [
        (name, body["title"], "built" if any(folder.glob(f"{name}.{step}.*")) else "not built")
        for name, body in tree.get(KINDS[step].section, {}).items()
    ]


def _print_rows(title: str, rows: Sequence[Sequence[str]], hint: str = "") -> None:
    if not rows:
        return
    print(f"  {title}" + (f"   ({hint})" if hint else ""))
    width = max(len(row[0]) for row in rows)
    second = max(len(row[1]) for row in rows)
    for name, text, state in rows:
        print(f"    {name:<{width}}  {text:<{second}}  {state}".rstrip())


def _print_cells(cells: Sequence[str], limits: Sequence[int]) -> None:
    wrapped = [
        textwrap.wrap(" ".join(cell.split()), limit) or [""]
        for cell, limit in zip(cells, limits, strict=True)
    ]
    for line in range(max(map(len, wrapped))):
        parts = [
            f"{column[line] if line < len(column) else '':<{limit}}"
            for column, limit in zip(wrapped, limits, strict=True)
        ]
        print("  ".join(parts).rstrip())


def _value(value: Any) -> str:
    if isinstance(value, list) and value and isinstance(value[0], dict):
        return "; ".join(
            f"{term.get('kind', '')} "
            + " ".join(f"{k}={v}" for k, v in term.items() if k != "kind")
            for term in value
        )
    return f"{value:g}" if isinstance(value, float) else str(value)


def _range(entry: dict[str, Any]) -> str:
    allowed = entry.get("range")
    if allowed is None:
        return ""
    if isinstance(allowed, list):
        return f"{allowed[0]:g} to {allowed[1]:g}"
    if "choices" in allowed:
        return "one of " + ", ".join(map(str, allowed["choices"]))
    return "; ".join(f"{key}: {low:g} to {high:g}" for key, (low, high) in allowed.items())
