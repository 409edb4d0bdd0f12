"""`reobserve_papers.replicate`: one figure of a paper in one call."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from reobserve.core.errors import InputError, nearest, shown
from reobserve.core.extras import package
from reobserve_papers.parameters.names import own_project
from reobserve_papers.signals.inputs import sample_files

if TYPE_CHECKING:
    from reobserve_papers.parameters.parameters import Parameters
    from reobserve_papers.steps.evaluation import Replication


def replicate(
    paper: str,
    figure: str,
    overrides: Mapping[str, Any] | None = None,
    *,
    project: str | Path | None = None,
) -> Replication:
    """Recompute a figure of a paper in this process: plant, observers, metrics and plot.

    It gives the numbers that the workflow writes to ``results``, bitwise identical on one machine
    if the BLAS runs the same kernel, and writes no files.

    Parameters
    ----------
    paper
        A paper, such as ``"ilo"``; `reobserve-papers list` shows all.
    figure
        A figure of it, such as ``"fig1"``.
    overrides
        Values that replace those of the parameter file, in the same tree, such as
        ``{"observers": {"sampled": {"K2": 500.0}}}``.
    project
        A checkout, or a folder with the same ``config``; by default the parameter files that
        belong to this installation.

    Returns
    -------
    Replication
        ``plant`` and ``estimates`` as `Series`, ``metrics`` and ``study`` as data frames, and
        ``plot()``.

    Raises
    ------
    InputError
        If there is no such paper or figure, or a value cannot be used.
    DivergenceError
        If a simulation diverges; the message says when.

    Examples
    --------
    >>> result = replicate("ilo", "fig1", {"observers": {"sampled": {"K2": 500.0}}})
    >>> sampled = result.estimates["sampled"]["fault"]  # shape (samples, 3), in N m
    """
    for name, word in (("paper", paper), ("figure", figure)):
        if not isinstance(word, str):
            raise InputError(name, f"{shown(word)} must be a name")
    if not isinstance(project, str | Path | None):
        raise InputError("project", f"{shown(project)} must be a folder")
    folder = own_project() if project is None else Path(project)
    if overrides is not None and not isinstance(overrides, Mapping):
        raise InputError("overrides", f"{shown(overrides)} must be a mapping")
    package("pydantic", "read parameters", extra="papers")
    from reobserve_papers.parameters.parameters import Parameters, default_seed
    from reobserve_papers.steps.evaluation import evaluate

    parameters = Parameters.load(folder, paper, dict(overrides or {}), default_seed(folder))
    if figure not in (figures := parameters.tree["figures"]):
        raise InputError("figure", f"{paper} has no {shown(figure)}{nearest(str(figure), figures)}")
    _name_files_from_here(parameters, folder)
    return evaluate(parameters, figure)


def _name_files_from_here(parameters: Parameters, folder: Path) -> None:
    """Make paths whole that parameter files state relative to the project."""
    from reobserve_papers.parameters.parameters import OVERRIDDEN

    for _, entry in parameters.entries():
        if entry["source"] == OVERRIDDEN:
            continue
        if entry["unit"] == "file":
            entry["value"] = str(folder / entry["value"])
        elif sample_files(entry["value"]):
            for term in entry["value"]:
                if "file" in term:
                    term["file"] = str(folder / term["file"])
