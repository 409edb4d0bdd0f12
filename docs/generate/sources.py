"""All sources of the site: what is written by hand, what is generated, and the way through both.

A page by hand may hold `<!-- generated: NAME -->`, where the part of that name goes.
"""

from __future__ import annotations

import os
import re
import shutil
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path

import yaml

from docs.generate import api, commands, configuration, evidence, findings, gallery, parameters
from docs.generate.equations import equations
from docs.generate.markdown import Page
from docs.generate.modules import packages_and_modules
from docs.generate.navigation import FOLDERS, hand_written, navigation
from reobserve.core.errors import InputError, nearest
from reobserve.replication.meanings import list_metrics

_PART = re.compile(r"<!-- generated: ([\w ]+) -->")

_TEACHING = ("tutorials", "how-to", "explanation")

# In this folder the page of a paper goes on with what is generated.
_INTRODUCTIONS = "findings"


def write(root: Path, build: Path) -> None:
    """Write the sources of the site of the project at ``root`` into ``build``, emptied before.

    Raises
    ------
    InputError
        If a page has no title, asks for a part that there is not or has no place in the
        navigation; or if something that the evidence needs is missing or damaged.
    """
    papers = evidence.papers(root)
    by_hand = root / "docs/pages"
    parts = {**_parts(root, papers), "lessons": lambda: _lessons(by_hand)}
    texts = dict(_filled(by_hand, parts))
    introductions = {
        paper.name: texts.pop(name)
        for paper in papers
        if (name := f"{_INTRODUCTIONS}/{paper.name}.md") in texts
    }
    placed = sorted((hand_written(*one) for one in texts.items()), key=lambda pair: pair[1])
    pages = [*(page for page, _ in placed), *_generated(root, papers, introductions)]
    shutil.rmtree(build, ignore_errors=True)
    shutil.copytree(by_hand, build / "docs", ignore=shutil.ignore_patterns("*.md"))
    pictures = root / evidence.REFERENCES
    shutil.copytree(pictures, build / "docs/figures", ignore=shutil.ignore_patterns("*.json"))
    for page in pages:
        path = build / "docs" / page.path
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(page.text, encoding="utf-8")
    places = {
        "INHERIT": os.path.relpath(root / "mkdocs.yml", build),
        "docs_dir": "docs",
        "site_dir": "site",
        "nav": navigation(pages),
    }
    text = yaml.safe_dump(places, allow_unicode=True, sort_keys=False, width=1000)
    (build / "mkdocs.yml").write_text(text, encoding="utf-8")


def _generated(
    root: Path, papers: Sequence[evidence.Paper], introductions: Mapping[str, str]
) -> Iterator[Page]:
    """The pages that are made from code and from what git holds."""
    yield from findings.pages(papers, introductions)
    yield from gallery.pages(papers)
    yield from api.pages(root / "src/reobserve")
    yield from parameters.pages(papers)


def _parts(root: Path, papers: Sequence[evidence.Paper]) -> dict[str, Callable[[], str]]:
    """The parts that pages by hand may ask for."""
    source = root / "src/reobserve"
    return {
        "verdicts": lambda: findings.verdicts(papers),
        "titles": lambda: findings.titles(papers),
        "verdicts on the start page": lambda: findings.verdicts(papers, "findings/"),
        "papers": lambda: findings.what_it_is_about(papers),
        "papers on the start page": lambda: findings.what_it_is_about(papers, "findings/"),
        "figures": lambda: gallery.small(papers),
        "public names": lambda: api.public_names(source),
        "packages": api.packages,
        "commands": commands.commands,
        "make targets": lambda: commands.targets(root),
        "keys of a build": lambda: configuration.keys_of_a_build(root),
        "schemas": configuration.schemas,
        "specifications": configuration.specifications,
        "models": configuration.models,
        "parameters": lambda: parameters.counts(papers),
        "metrics": lambda: list_metrics(paper.name for paper in papers),
        "equations": lambda: equations(papers),
        "modules": lambda: packages_and_modules(source),
    }


def _lessons(folder: Path) -> str:
    """The tutorials, and the other pages that teach, as lists for the start page."""
    told = []
    for name in _TEACHING:
        found = [
            hand_written(f"{name}/{file.name}", file.read_text(encoding="utf-8"))
            for file in sorted((folder / name).glob("*.md"))
        ]
        pages = [page for page, _ in sorted(found, key=lambda pair: pair[1])]
        listed = "".join(f"- [{_heading(page)}]({page.path})\n" for page in pages)
        told += [f"**{FOLDERS[name]}**\n\n{listed}"] if pages else []
    return "\n".join(told)


def _heading(page: Page) -> str:
    """What stands over a page, in full: the navigation may call it something shorter."""
    found = re.search(r"^# (.+)$", page.text, re.MULTILINE)
    return found[1] if found else page.title


def _filled(folder: Path, parts: Mapping[str, Callable[[], str]]) -> Iterator[tuple[str, str]]:
    """The pages by hand, by their paths, with the parts that they ask for."""
    for file in sorted(folder.rglob("*.md")):
        path = file.relative_to(folder).as_posix()

        def part(found: re.Match[str], path: str = path) -> str:
            if found[1] not in parts:
                problem = f"asks for {found[1]!r}{nearest(found[1], parts)}, must be one of"
                raise InputError(path, f"{problem} {', '.join(parts)}")
            return parts[found[1]]()

        yield path, _PART.sub(part, file.read_text(encoding="utf-8"))
