"""The parts of a package and what they import, as a figure."""

from __future__ import annotations

import ast
from functools import cache
from pathlib import Path

from matplotlib.figure import Figure

from docs.pictures import panels

# Boxes that stand left (-1) or right (1) of the others, so that no arrow crosses a box.
_SIDES = {
    "reobserve.cli": -1,
    "reobserve.detection": 1,
    "reobserve.tuning": 1,
    "reobserve_papers.bench": 1,
    "reobserve_papers.cli": 1,
    "reobserve_papers.figure_diff": -1,
    "reobserve_papers.golden": -1,
    "reobserve_papers.papers": 1,
    "reobserve_papers.plants": 1,
}


def imports(source: Path) -> dict[str, set[str]]:
    """By part of the package at ``source``: what its modules import, in functions as well.

    That is other parts; of the packages beside it, which have parts of their own, the names alone.
    """
    others = {path.parent.name for path in source.parent.glob("*/__init__.py")} - {source.name}
    parts = sorted(path.parent.name for path in source.glob("*/__init__.py"))
    found: dict[str, set[str]] = {name: set() for name in parts}
    for name in parts:
        for path in (source / name).rglob("*.py"):
            for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
                if isinstance(node, ast.ImportFrom):
                    root, _, rest = (node.module or "").partition(".")
                    if root == source.name:
                        found[name] |= {rest.partition(".")[0]} & set(parts) - {name}
                    found[name] |= {root} & others
    imported = set().union(*found.values()) - set(parts)
    return {**found, **{name: set() for name in imported}}


def diagram(source: Path) -> Figure:
    """Parts as boxes, each above what it imports, without arrows that follow from others."""
    graph = imports(source)

    @cache
    def below(name: str) -> frozenset[str]:
        return frozenset(graph[name]).union(*(below(one) for one in graph[name]))

    @cache
    def height(name: str) -> int:
        return 1 + max((height(one) for one in graph[name]), default=-1)

    place = {name: (_SIDES.get(f"{source.name}.{name}", 0), height(name)) for name in graph}
    assert len({*place.values()}) == len(place), "two boxes in one place: move one to a side"
    rows = 1 + max(level for _, level in place.values())
    figure, (axes,) = panels(height=0.5 * rows)
    axes.set(xlim=(-1.5, 1.5), ylim=(-0.5, rows - 0.5))
    axes.axis("off")
    box = {"boxstyle": "round,pad=0.35", "facecolor": "#eaf1f8", "edgecolor": "0.3"}
    boxes = {
        name: axes.text(x, y, name, ha="center", va="center", bbox=box).get_bbox_patch()
        for name, (x, y) in place.items()
    }
    for name, imported in graph.items():
        for one in sorted(imported):
            if any(one in below(other) for other in imported):
                continue
            arrow = {"arrowstyle": "->", "color": "0.45", "shrinkA": 0, "shrinkB": 1}
            ends = {"patchA": boxes[name], "patchB": boxes[one]}
            axes.annotate("", place[one], place[name], zorder=0, arrowprops={**arrow, **ends})
    return figure
