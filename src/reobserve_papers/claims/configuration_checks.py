"""Checks of a paper's configuration: parameters, claims, conventions, errata, samples."""

from __future__ import annotations

import re
import sys
from collections.abc import Callable, Container, Mapping
from functools import cache
from pathlib import Path

from reobserve.core.documents import read_json
from reobserve.core.errors import InputError, ReobserveError, located, nearest
from reobserve_papers.claims.checks import Reference
from reobserve_papers.claims.conventions import SPECIAL, Conventions, names_in, read_conventions
from reobserve_papers.claims.errata import read_errata
from reobserve_papers.claims.registry import (
    Registry,
    amiss,
    check_names,
    claims_text,
    read_registry,
)
from reobserve_papers.claims.restrictions import kept_by
from reobserve_papers.claims.sample_table import read_cached
from reobserve_papers.parameters.config import known_papers, refuse_unknown
from reobserve_papers.parameters.job import read_parameters
from reobserve_papers.parameters.parameters import Parameters
from reobserve_papers.parameters.prepare import check_files
from reobserve_papers.steps.glossary import glossary


def checked_papers(
    project: Path, parameters: Mapping[str, Parameters], at_once: Container[str]
) -> Callable[[str], Parameters]:
    """The parameters by paper, each with its files checked once, when it is first asked for.

    Those in ``at_once``, which have overrides, are checked here. The others are checked when a job
    of theirs is in Snakemake's graph and, unless the run is dry, before the first job; the error
    ends the run.
    """

    def check(paper: str) -> None:
        read_parameters(parameters[paper])
        check_files(parameters[paper])
        check_evidence(project, parameters[paper])

    @cache
    def checked(paper: str) -> Parameters:
        if paper not in at_once:
            try:
                check(paper)
            except ReobserveError as error:
                sys.exit(f"reobserve-papers: {error}")
        return parameters[paper]

    for paper in parameters:
        if paper in at_once:
            check(paper)
    return checked


def check_evidence(project: Path, parameters: Parameters) -> None:
    """Check the files of a paper, those that there are, and the conventions."""
    paper = parameters.paper
    _check_papers(project)
    registry, errata = read_registry(project, parameters), read_errata(project, paper)
    for problem in amiss(registry.claims):
        place, _, rest = problem.partition(": ")
        raise InputError(place, rest)
    _check_alternatives(registry, paper)
    _check_used(project, registry.conventions)
    _check_figures(registry, parameters)
    for one in registry.claims:
        with located(f"claims.{paper}.{one.name}.setting"):
            _check_setting(project, parameters, one.setting)
    for claim, names in registry.corrections.items():
        known = [erratum.name for erratum in errata]
        refuse_unknown(f"claims.{paper}.{claim}.errata", names, known)
    for erratum in errata:
        place = f"errata.{paper}.{erratum.name}.settles"
        refuse_unknown(place, filter(None, [erratum.settles]), parameters.by_key)
    for key, entry in parameters.entries():
        if entry["unit"] == "file" and str(entry["value"]).endswith(".json"):
            with located(f"{paper}.{key}"):
                read_json(project / entry["value"])
    read_cached(project, paper)


def _check_papers(project: Path) -> None:
    known = known_papers(project)
    for name, one in read_conventions(project).single.items():
        refuse_unknown(f"alternatives.{name}.paper", [one.paper], known)


def _check_used(project: Path, conventions: Conventions) -> None:
    """Refuse conventions that neither a claim names nor the code reads."""
    texts = [claims_text(project, paper) for paper in known_papers(project)]
    bodies = [body for text in texts for body in (text.get("claims") or {"": None}).values()]
    if not all(isinstance(body, Mapping) for body in bodies):  # `check` says what is wrong there
        return
    used = {*names_in([texts, [one.claims for one in conventions.single.values()]]), *SPECIAL}
    for name in conventions.stated:
        if name not in used:
            raise InputError(f"conventions.{name}", f"no claim names it{nearest(name, SPECIAL)}")


def _check_figures(registry: Registry, parameters: Parameters) -> None:
    """Refuse rows of the paper's figures that name a figure or number that is not there."""
    known, metrics = parameters.tree["figures"], glossary(parameters.package)
    for name, row in registry.figures.items():
        with located(f"claims.{parameters.paper}.figures.{name}"):
            refuse_unknown("ours", row.ours, known)
            for number, one in enumerate(row.printed):
                with located(f"printed.{number}.value"):
                    check_names(parameters, [Reference.parse(one.value)], metrics)


def _check_setting(project: Path, parameters: Parameters, text: str) -> None:
    """Refuse a setting that names a file or a branch of parameters that is not there."""
    for path in re.findall(r"config/[\w./-]+\w", text):
        if not (project / path).is_file():
            raise InputError("", f"there is no file {path}")
    for section, name in re.findall(r"`(\w+)\.(\w+)", text):
        if nearest(section, parameters.tree):  # other words with a dot are no keys
            refuse_unknown("", [section], parameters.tree)
        if isinstance(branches := parameters.tree.get(section), Mapping):
            refuse_unknown("", [name], branches)


def _check_alternatives(registry: Registry, paper: str) -> None:
    """Refuse alternatives that keep samples by what no claim depends on."""
    for name, one in registry.conventions.single.items():
        if one.paper == paper:
            with located(f"alternatives.{name}"):
                kept_by(registry, one, seed=0)
