"""The packages and what they import, as a figure."""

from __future__ import annotations

import ast
from functools import cache
from pathlib import Path

from matplotlib.figure import Figure

from docs.pictures import panels


def imports(source: Path) -> dict[str, set[str]]:
    """By package below ``source``: the packages that its modules import, in functions as well."""
    packages = sorted(path.parent.name for path in source.glob("*/__init__.py"))
    found: dict[str, set[str]] = {name: set() for name in packages}
    for name in packages:
        for path in (source / name).rglob("*.py"):
            for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
                if isinstance(node, ast.ImportFrom):
                    root, _, rest = (node.module or "").partition(".")
                    if root == "reobserve":
                        found[name] |= {rest.partition(".")[0]} & set(packages) - {name}
    return found


def diagram(source: Path) -> Figure:
    """Packages as boxes, each above what it imports, without arrows that follow from others."""
    graph = imports(source)

    @cache
    def below(name: str) -> frozenset[str]:
        return frozenset(graph[name]).union(*(below(one) for one in graph[name]))

    @cache
    def height(name: str) -> int:
        return 1 + max((height(one) for one in graph[name]), default=-1)

    rows: dict[int, list[str]] = {}
    for name in sorted(graph):
        rows.setdefault(height(name), []).append(name)
    figure, (axes,) = panels(height=0.55 * len(rows))
    axes.set(xlim=(-0.5, 0.5), ylim=(-0.5, len(rows) - 0.5))
    axes.axis("off")
    place = {
        name: ((k + 0.5) / len(row) - 0.5, level)
        for level, row in rows.items()
        for k, name in enumerate(row)
    }
    box = {"boxstyle": "round,pad=0.35", "facecolor": "#eaf1f8", "edgecolor": "0.3"}
    boxes = {
        name: axes.text(x, y, name, ha="center", va="center", bbox=box).get_bbox_patch()
        for name, (x, y) in place.items()
    }
    for name, imported in graph.items():
        for one in sorted(imported):
            if any(one in below(other) for other in imported):
                continue
            crosses = place[name][0] * place[one][0] < 0  # the middle, where boxes stand
            bend = 0.45 if crosses else 0.0
            arrow = {"arrowstyle": "->", "color": "0.45", "connectionstyle": f"arc3,rad={bend}"}
            ends = {"patchA": boxes[name], "patchB": boxes[one], "shrinkA": 0, "shrinkB": 1}
            axes.annotate("", place[one], place[name], zorder=0, arrowprops={**arrow, **ends})
    return figure
