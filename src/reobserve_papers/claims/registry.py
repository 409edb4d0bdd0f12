"""The registry: what each paper claims, where, and what decides it."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cache
from pathlib import Path
from typing import Any

from reobserve.core.documents import Tree
from reobserve.core.errors import InputError, located, nearest, shown
from reobserve.core.validation import parse
from reobserve_papers.claims.checks import THEORY, Check, Reference
from reobserve_papers.claims.choices import Choice, cells, find_choice
from reobserve_papers.claims.conventions import (
    Conventions,
    changed,
    filled,
    names_in,
    read_conventions,
    without_reasons,
    words_in,
)
from reobserve_papers.claims.entries import (
    ClaimEntry,
    ClaimsFile,
    Earlier,
    PaperFigure,
    Quantifier,
)
from reobserve_papers.claims.labels import Label, labels
from reobserve_papers.parameters.config import refuse_unknown
from reobserve_papers.parameters.names import claims_path
from reobserve_papers.parameters.parameter_file import parse_file, read_part
from reobserve_papers.parameters.parameters import Parameters
from reobserve_papers.steps.glossary import Glossary, check_subject, glossary


@dataclass(frozen=True)
class Claim:
    """A statement of a paper, in our words.

    ``why`` is the reason for the bounds, or why nothing can test it; ``threshold``
    says who set them: the paper (`stated`), or we, `before` or `after` the numbers were known.
    ``promised`` says where the paper promises it of its own method, ``purpose`` where it states
    it as a purpose, ``quantifier`` for how many settings it must be true.
    """

    paper: str
    name: str
    place: str = ""
    statement: str = ""
    promised: tuple[str, ...] = ()
    purpose: tuple[str, ...] = ()
    quantifier: Quantifier = "is"
    printed: bool = False
    checks: tuple[Check, ...] = ()
    why: str = ""
    threshold: str = ""
    choices: tuple[Choice, ...] = ()
    testable: bool = True
    null: Mapping[str, str] = field(default_factory=dict)
    maximum: int | None = None
    setting: str = ""
    wanted: tuple[Reference, ...] = ()
    labels: Mapping[str, Label] = field(default_factory=dict)

    @property
    def is_main(self) -> bool:
        """True if the title of the replication depends on it."""
        return bool(self.promised)

    @property
    def cells(self) -> list[tuple[Any, ...]] | None:
        """All that its choices can be together, if these are few words and counts."""
        return cells(self.choices)

    @property
    def with_null(self) -> Claim:
        """The same claim of its baseline (see `ClaimEntry.null`)."""
        checks = tuple(check.of_others(self.null) for check in self.checks)
        return replace(self, checks=checks, null={})

    @property
    def references_of_all(self) -> list[Reference]:
        """The numbers that its checks name, and those of its null."""
        claims = (self, self.with_null) if self.null else (self,)
        return [one for claim in claims for check in claim.checks for one in check.references]

    @property
    def figures(self) -> list[str]:
        """The figures (or `THEORY`) whose numbers decide it, in order."""
        return list(dict.fromkeys(ref.figure for check in self.checks for ref in check.references))

    def references(self, figure: str) -> list[Reference]:
        """The numbers of one figure (or `THEORY`) that decide it."""
        found = [ref for check in self.checks for ref in check.references]
        return [ref for ref in found if ref.figure == figure]

    @property
    def keys(self) -> list[str]:
        """The keys of the parameters that it depends on."""
        return [key for choice in self.choices for key in choice.keys]

    def label(self, name: str) -> Label:
        """The label of a choice, by its name."""
        return self.labels.get(name, Label(name))

    @property
    def knob_names(self) -> tuple[str, ...]:
        """The names of the values that a sample chooses."""
        return tuple(name for choice in self.choices for name in choice.names)


@dataclass(frozen=True)
class Registry:
    """The claims of a paper, its figures, and the limitations to replicating it.

    ``conventions`` are those by which the claims are read; `variant` reads one by others.
    ``corrections`` are the errata that claims link.
    """

    limitations: str = ""
    claims: list[Claim] = field(default_factory=list)
    history: list[Earlier] = field(default_factory=list)
    figures: Mapping[str, PaperFigure] = field(default_factory=dict)
    corrections: Mapping[str, Sequence[str]] = field(default_factory=dict)
    conventions: Conventions = field(default_factory=Conventions)
    bodies: Mapping[str, Any] = field(default_factory=dict, repr=False)
    _read: Callable[[str, Any, Conventions], Claim] | None = field(default=None, repr=False)

    def variant(
        self, name: str, conventions: Conventions, changes: Mapping[str, Any] | None = None
    ) -> Claim:
        """A claim by other conventions, or with other values of some of its keys."""
        assert self._read is not None
        refuse_unknown("claims", [name], self.bodies)
        return self._read(name, changed(self.bodies[name], changes or {}), conventions)

    def naming(self, convention: str) -> list[str]:
        """The claims that name a convention."""
        return [name for name, body in self.bodies.items() if convention in names_in(body)]


def claims_file(project: Path, paper: str) -> Path:
    """The file with the claims of a paper."""
    return project / claims_path(paper)


def read_claims(project: Path, paper: str) -> ClaimsFile:
    """Read the claims of a paper as its file has them, or raise `InputError` for what is wrong."""
    return _parsed(_read_file(project, paper), read_conventions(project), paper)


def has_claims(project: Path, paper: str) -> bool:
    """True if a paper has a file of claims that states any, or that cannot be read."""
    return bool(claims_text(project, paper).get("claims", "a problem"))


def _read_file(project: Path, paper: str) -> Tree:
    tree = read_part(claims_file(project, paper), "claims")
    return tree if tree["claims"] else {"limitations": "No claims are stated.", **tree}


def _parsed(tree: Any, conventions: Conventions, paper: str) -> ClaimsFile:
    claims = tree.get("claims") if isinstance(tree, dict) else None
    if isinstance(claims, dict):
        bodies = {}
        for name, body in claims.items():
            with located(f"claims.{paper}.{name}"):
                bodies[name] = filled(body, conventions.values)
        tree = {**tree, "claims": bodies}
    return parse_file(ClaimsFile, tree, "claims", paper)


def read_registry(project: Path, parameters: Parameters) -> Registry:
    """The claims of a paper."""
    paper = parameters.paper
    tree, conventions = _read_file(project, paper), read_conventions(project)
    stated = _parsed(tree, conventions, paper)
    known = glossary(parameters.package)
    asked: dict[str, tuple[Choice, ...]] = {}
    for group, patterns in stated.choices.items():
        with located(f"claims.{paper}.choices.{group}"):
            _choices(parameters, patterns, {})
    claims = []
    for name, entry in stated.claims.items():
        with located(f"claims.{paper}.{name}"):
            refuse_unknown("departs", entry.departs, conventions.values)
            if (
                entry.promised
                and entry.quantifier == "can"
                and not (entry.null or entry.not_testable)
            ):
                needed = "a main claim of what can be needs a baseline, or the reason for none"
                raise InputError("null", f"is missing: {needed}")
            asked[name] = _choices(parameters, entry.depends_on, stated.choices)
            claims.append(_claim(parameters, name, entry, asked[name], known))

    def read(name: str, body: Any, others: Conventions) -> Claim:
        if body.get("depends_on", []) != tree["claims"][name].get("depends_on", []):
            raise InputError("depends_on", "must stay: samples vary what the claim states")
        entry = parse(ClaimEntry, filled(body, others.values), f"{paper}.{name}")
        return _claim(parameters, name, entry, asked[name], known)

    registry = Registry(
        stated.limitations,
        claims,
        stated.history,
        stated.figures,
        {name: entry.errata for name, entry in stated.claims.items() if entry.errata},
        conventions,
        tree["claims"],
        read,
    )
    wanted = _wanted(registry, paper)
    with located(f"claims.{paper}"):
        words = labels(
            parameters, [one for each in asked.values() for one in each], stated.excluded
        )
    claims[:] = [replace(claim, wanted=wanted[claim.name], labels=words) for claim in claims]
    return registry


def _wanted(registry: Registry, paper: str) -> dict[str, tuple[Reference, ...]]:
    """The numbers that checks name by these conventions or by any alternative, by claim."""
    found = {claim.name: [*claim.references_of_all] for claim in registry.claims}
    conventions = registry.conventions
    for name, convention in conventions.stated.items():
        concerned = registry.naming(name)
        for label, value in convention.alternatives.items():
            with located(f"conventions.{name}.alternatives.{label}"):
                for claim in concerned:
                    other = registry.variant(claim, conventions.with_value(name, value))
                    found[claim] += other.references_of_all
    for name, one in conventions.single.items():
        if one.paper != paper:
            continue
        with located(f"alternatives.{name}"):
            for claim, changes in one.claims.items():
                other = registry.variant(claim, conventions, changes)
                found[claim] += other.references_of_all
    return {name: tuple(dict.fromkeys(listed)) for name, listed in found.items()}


def amiss(claims: Sequence[Claim]) -> Iterator[str]:
    """Errors in claims taken together, a sentence each."""
    if claims and not any(claim.is_main and claim.testable for claim in claims):
        yield f"claims.{claims[0].paper}: none that can be tested is promised, must be one or more"
    said: dict[str, str] = {}
    for claim in claims:
        first = said.setdefault(claim.statement, claim.name)
        if first != claim.name:
            place = f"claims.{claim.paper}.{claim.name}.statement"
            yield f"{place}: is that of {first}, must be another claim"


@cache
def claims_text(project: Path, paper: str) -> Tree:
    """The file of a paper's claims as it stands, to see whether it has changed.

    Where it is not what it must be there is its problem instead; those who decide claims report it.
    """
    try:
        tree = _read_file(project, paper)
    except InputError as error:
        return {"problem": str(error)}
    return tree if isinstance(tree["claims"], dict) else {"problem": tree}


def decisive(tree: Tree, conventions: Tree) -> Tree:
    """The part of a registry that decides which numbers are sampled: no wording, and no bounds."""
    claims = {
        name: [sorted(set(words_in(body))), body.get("depends_on", [])]
        if isinstance(body, dict)
        else body
        for name, body in tree.get("claims", {}).items()
    }
    return {
        "choices": tree.get("choices", {}),
        "claims": claims,
        "words": sorted(set(words_in(conventions))),
    }


def deciding(tree: Tree, conventions: Tree) -> Tree:
    """The part of a registry that decides how many samples are enough: bounds, no wording."""
    stated = conventions.get("conventions", {})
    values = (
        {name: one.get("value") if isinstance(one, dict) else one for name, one in stated.items()}
        if isinstance(stated, dict)
        else {"problem": stated}
    )
    return {"claims": without_reasons(tree.get("claims", {})), "conventions": values}


def _claim(
    parameters: Parameters,
    name: str,
    entry: ClaimEntry,
    choices: tuple[Choice, ...],
    known: Glossary,
) -> Claim:
    checks = []
    for index, one in enumerate(entry.checks or ()):
        with located(f"checks.{index}"):
            checks.append(check := Check.parse(one.model_dump(exclude_none=True)))
            for key, references in (("value", check.value), (check.how, check.other)):
                with located(key):
                    check_names(parameters, references, known)
    null = entry.null if isinstance(entry.null, dict) else {}
    no_null = f"Baseline: {entry.null}" if entry.null and not null else ""
    if null:
        observers = {one.observer for check in checks for one in check.references}
        refuse_unknown("null", null, observers)
        for check in checks:
            with located("null"):
                check_names(parameters, check.of_others(null).references, known)
    return Claim(
        parameters.paper,
        name,
        place=entry.place,
        statement=entry.statement,
        promised=tuple(entry.promised),
        purpose=tuple(entry.purpose),
        quantifier=entry.quantifier,
        printed=entry.printed,
        checks=tuple(checks),
        why=" ".join(filter(None, [entry.why or entry.not_testable, no_null])),
        threshold=entry.threshold or "",
        choices=choices,
        testable=entry.not_testable is None,
        null=null,
        maximum=entry.samples,
        setting=entry.setting or "",
    )


def check_names(parameters: Parameters, references: Iterable[Reference], known: Glossary) -> None:
    """Refuse a figure that is not there, and what the paper's code does not compute of it."""
    figures = [*parameters.tree["figures"], *([THEORY] if THEORY in parameters.tree else [])]
    for reference in references:
        refuse_unknown("figure", [reference.figure], figures)
        if known and not any(fits.fullmatch(reference.metric) for fits, _ in known):
            names = [fits.pattern.replace(r"\S+", "*").replace("\\", "") for fits, _ in known]
            problem = f"there is no {shown(reference.metric)}{nearest(reference.metric, names)}"
            raise InputError("metric", problem)
        if known:
            check_subject(parameters, reference.figure, reference.observer)


def _choices(
    parameters: Parameters, named: Iterable[str], groups: Mapping[str, list[str]]
) -> tuple[Choice, ...]:
    patterns = [pattern for name in named for pattern in groups.get(name, [name])]
    return tuple(find_choice(parameters, pattern, groups) for pattern in dict.fromkeys(patterns))
