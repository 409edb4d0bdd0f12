"""The limit cycle in the plane beside the domain in which the series of S converges."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.figure import Figure

from reobserve.papers.lie.styles import EDGE
from reobserve.papers.lie.words import vector
from reobserve.plotting.figures import STYLES, TRUTH, add_note, decades, mosaic
from reobserve.plotting.look import points, thick
from reobserve.replication.metrics.study_table import StudyTable
from reobserve.replication.parameters.figure_data import FigureData


def draw(data: FigureData) -> Figure:
    """Phase plane, errors of the truncated series on the cycle, and radii by degree."""
    plant, study = data.plant, data.study
    figure, axes = mosaic(
        [["plane", "errors"], ["plane", "radii"]], 4.7, width_ratios=(1.1, 1.0),
        stacked={"plane": 3.8, "errors": 2.0, "radii": 2.0},
    )  # fmt: skip
    plane, errors, radii = axes["plane"], axes["errors"], axes["radii"]
    cycle, edge = _points(study, "point"), _points(study, "boundary")
    plane.plot(*_closed(cycle), **TRUTH.line(), label="limit cycle")
    plane.plot(
        plant["state"][:, 0], plant["state"][:, 1], **STYLES[0].line(), label="the run of Fig. 1"
    )
    plane.fill(*_closed(edge), color="0.9", zorder=0)
    plane.plot(*_closed(edge), **EDGE.line(), label="S converges inside, by the estimate")
    plane.plot(0, 0, color="0.3", marker="+")
    plane.set_aspect("equal")
    plane.set_xlabel("x₁")
    plane.set_ylabel("x₂")
    plane.set_title("(a) plane of states")
    plane.legend(loc="upper center", bbox_to_anchor=(0.5, -0.13))

    for style, name, label in ((STYLES[0], "S", "S(x), cut off"), (EDGE, "T", "T(z), cut off")):
        errors.semilogy(*_by_degree(study, name, "largest_error"), **style.points(), label=label)
    decades(errors.yaxis)
    errors.set_xlabel("degree")
    errors.set_ylabel("largest error")
    errors.set_title("(b) error of the series on the cycle")
    errors.legend(loc="upper right")
    radii.plot(*_by_degree(study, "S", "radius"), **STYLES[0].points())
    distance = data.metrics["cycle", "distance"]
    radii.axhline(distance, color="0.4", linewidth=thick(0.8), linestyle=":")
    radii.annotate(
        "distance of the cycle from the origin", (0.98, distance), (0, 3), ha="right",
        xycoords=("axes fraction", "data"), textcoords="offset points", fontsize=points(7),
        color="0.3",
    )  # fmt: skip
    radii.set_xlabel("degree")
    radii.set_ylabel("radius")
    radii.set_title("(c) estimated radius of convergence of S")
    add_note(
        figure,
        f"Series of S up to degree {data.job.study.degree}; radius and boundary from its parts in "
        "the upper half of the degrees.\nThe true S on the cycle is the periodic solution of "
        f"ż = A z − ℓ(x₁(t)), ℓ(y) = {vector(data.job.designs[data.job.study.design].injection)}.",
    )
    return figure


def _by_degree(study: StudyTable, series: str, quantity: str) -> tuple[Any, Any]:
    """The degrees, and a quantity at each."""
    found = study.where(form=series, quantity=quantity).by_level("order")
    return list(found), [value for (value,) in found.values()]


def _points(study: StudyTable, quantity: str) -> Any:
    rows = study.where(quantity=quantity)
    return np.stack([rows["x1"], rows["x2"]], axis=1)


def _closed(points: Any) -> Any:
    """The columns of a closed curve through the points."""
    return np.append(points, points[:1], axis=0).T
