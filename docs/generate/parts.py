"""The parts of pages that are made from code, configuration and evidence."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from functools import cache
from pathlib import Path

from docs.generate import api, commands, configuration, evidence, findings
from docs.generate.abilities import abilities
from docs.generate.equations import equations
from docs.generate.markdown import Page
from docs.generate.navigation import FOLDERS, hand_written
from reobserve.core.errors import InputError, nearest
from reobserve_papers.steps.glossary import list_metrics

_TEACHING = ("tutorials", "how-to", "explanation")


def part(root: Path, name: str) -> str:
    """The part of that name, of the project at ``root``.

    Raises
    ------
    InputError
        If there is none; or if something that the evidence needs is missing or damaged.
    """
    known = _parts(root)
    if name not in known:
        problem = f"is no part of a page{nearest(name, known)}, must be one of"
        raise InputError(repr(name), f"{problem} {', '.join(known)}")
    return known[name]()


@cache
def _parts(root: Path) -> Mapping[str, Callable[[], str]]:
    papers = evidence.papers(root)
    library = root / "src/reobserve"
    of_papers = {
        f"{name} of {paper.name}": lambda make=make, paper=paper: make(paper)
        for paper in papers
        for name, make in {
            "summary": findings.summary,
            "findings": findings.findings,
        }.items()
    }
    return {
        "verdicts": lambda: findings.verdicts(papers),
        "papers": lambda: findings.what_it_is_about(papers),
        "citations": lambda: findings.citations(root, papers),
        "abilities": abilities,
        "public names": lambda: api.public_names(library),
        "packages of the library": lambda: api.parts("reobserve"),
        "packages of the papers": lambda: api.parts("reobserve_papers"),
        "commands": commands.commands,
        "make targets": lambda: commands.targets(root),
        "keys of a build": lambda: configuration.keys_of_a_build(root),
        "schemas": configuration.schemas,
        "specifications": configuration.specifications,
        "models": configuration.models,
        "metrics": lambda: list_metrics({paper.name: paper.parameters.package for paper in papers}),
        "equations": lambda: equations(papers),
        "lessons": lambda: _lessons(root / "docs/pages"),
        **of_papers,
    }


def _lessons(folder: Path) -> str:
    """The tutorials, and the other pages that teach, as lists for the start page."""
    parts = []
    for name in _TEACHING:
        found = [
            hand_written(f"{name}/{file.name}", file.read_text(encoding="utf-8"))
            for file in sorted((folder / name).glob("*.md"))
        ]
        pages = [page for page, _ in sorted(found, key=lambda pair: pair[1])]
        listed = "".join(f"- [{_heading(page)}]({page.path})\n" for page in pages)
        parts += [f"**{FOLDERS[name]}**\n\n{listed}"] if pages else []
    return "\n".join(parts)


def _heading(page: Page) -> str:
    """What stands over a page, in full: the navigation may call it something shorter."""
    found = re.search(r"^# (.+)$", page.text, re.MULTILINE)
    return found[1] if found else page.title
