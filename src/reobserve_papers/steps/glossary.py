"""Glossaries of metrics, as papers state them beside the code, and lists of them.

A paper's module ``metrics`` has ``MEANINGS``: what each metric is by its name, in which ``<word>``
stands for what differs, and ``<one,other>`` for one of these. What its docstring says after the
first sentence introduces them. It may also have ``SUBJECTS``: by layout of a figure, or for the
theory, what numbers are of beside observers, words in which ``<word>`` means the same.
"""

from __future__ import annotations

import re
import textwrap
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path

from reobserve.core.errors import InputError, nearest, shown
from reobserve_papers.metrics.metrics import Metric
from reobserve_papers.parameters.config import known_papers, named_papers
from reobserve_papers.parameters.names import paper_part
from reobserve_papers.parameters.parameters import Parameters
from reobserve_papers.steps.compute import paper_module

Glossary = list[tuple[re.Pattern[str], str]]


def glossary(package: str) -> Glossary:
    """Sentences on the metrics of a paper, by patterns of their names, empty if it states none."""
    try:
        stated: Mapping[str, str] = getattr(paper_module(package, "metrics"), "MEANINGS", {})
    except InputError:
        return []
    described = [(pattern(name), text.replace("`", "")) for name, text in stated.items()]
    # The exact name explains better than a pattern that happens to fit.
    return sorted(described, key=lambda pair: pair[0].pattern.count(r"\S+"))


def pattern(name: str) -> re.Pattern[str]:
    """The names that a name stands for, with any text for ``<word>`` and one of ``<one,other>``."""
    parts = re.split(r"<([\w,]+)>", name)
    texts = (f"({part.replace(',', '|')})" if "," in part else r"\S+" for part in parts[1::2])
    whole = zip(map(re.escape, parts[::2]), [*texts, ""], strict=True)
    return re.compile("".join(map("".join, whole)))


def check_explained(parameters: Parameters, figure: str, metrics: Iterable[Metric]) -> None:
    """Refuse metrics of a figure that ``MEANINGS`` and ``SUBJECTS`` of its paper do not explain."""
    known = glossary(parameters.package)
    for metric in metrics:
        if not any(fits.fullmatch(metric.metric) for fits, _ in known):
            problem = f"has no entry in MEANINGS of {paper_part(parameters.package, 'metrics')}"
            raise InputError(f"metric {metric.metric!r}", problem)
        check_subject(parameters, figure, metric.observer)


def check_subject(parameters: Parameters, figure: str, name: str) -> None:
    """Refuse what no number of a figure, or of the theory, is of, where a paper states these."""
    stated = getattr(paper_module(parameters.package, "metrics"), "SUBJECTS", None)
    if stated is None:
        return
    tree = parameters.tree
    body = tree["figures"].get(figure, {"observers": tree["observers"]})  # or the theory
    study = tree["studies"][body["study"]] if "study" in body else {}
    others = stated.get(body.get("layout", figure), "").split()
    known = [*body.get("observers", ()), *study.get("observers", ()), *others]
    if not any(pattern(one).fullmatch(name) for one in known):
        raise InputError("observer", f"{figure} has no {shown(name)}{nearest(name, known)}")


def list_metrics(packages: Mapping[str, str]) -> str:
    """The metrics of papers in Markdown, a list for each. ``packages`` are those of the papers."""
    modules = {paper: paper_module(package, "metrics") for paper, package in packages.items()}
    return "\n".join(
        _list(paper, module.__doc__ or "", module.MEANINGS)
        for paper, module in modules.items()
        if hasattr(module, "MEANINGS")
    )


def print_metrics(project: Path, paper: Sequence[str]) -> None:
    """Print what the metrics of papers are, of all if none is named."""
    chosen = named_papers(known_papers(project), paper)
    print(list_metrics({name: Parameters.load(project, name).package for name in chosen}))


def _list(paper: str, docstring: str, stated: Mapping[str, str]) -> str:
    _, *paragraphs = docstring.strip().split("\n\n")
    lines = [textwrap.fill(" ".join(paragraph.split()), 100) + "\n\n" for paragraph in paragraphs]
    rows = [f"| `{name}` | {text.replace('|', chr(92) + '|')} |" for name, text in stated.items()]
    table = "\n".join(["| metric | what it is |", "|---|---|", *rows])
    return f"## Metrics of `{paper}`\n\n{''.join(lines)}{table}\n"
