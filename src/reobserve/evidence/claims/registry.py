"""The registry: what each paper claims, where, and what decides it."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import cache
from pathlib import Path
from typing import Any

from reobserve.errors import InputError
from reobserve.evidence.claims.checks import THEORY, Check, Reference
from reobserve.evidence.claims.choices import Choice, find_choice
from reobserve.ledger.config import Tree, check_schema, read_yaml
from reobserve.ledger.ledger import Ledger
from reobserve.ledger.names import claims_path

HEADLINES = (2, 4)  # so many claims of a paper may be its headlines


@dataclass(frozen=True)
class Claim:
    """A statement of a paper, in our words.

    ``problem`` is the sentence that says what is wrong with its entry, if something is; it then
    has no checks. ``why`` is the reason for the bounds, or why nothing can test it; ``threshold``
    says who set them: the paper (`stated`), or we, `before` or `after` the numbers were known.
    """

    paper: str
    name: str
    place: str = ""
    says: str = ""
    headline: bool = False
    checks: tuple[Check, ...] = ()
    why: str = ""
    threshold: str = ""
    choices: tuple[Choice, ...] = ()
    expensive: bool = False
    testable: bool = True
    problem: str = ""

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
        """The ledger keys that it depends on."""
        return [key for choice in self.choices for key in choice.keys]

    @property
    def knob_names(self) -> tuple[str, ...]:
        """What each value is of that a draw chooses."""
        return tuple(name for choice in self.choices for name in choice.names)


@dataclass(frozen=True)
class Registry:
    """The claims of a paper, and the obstacles to replicating it."""

    obstacles: str = ""
    claims: list[Claim] = field(default_factory=list)


def claims_file(project: Path, paper: str) -> Path:
    """Where the claims of a paper are."""
    return project / claims_path(paper)


def read_registry(project: Path, ledger: Ledger) -> Registry:
    """The claims of a paper, each checked by itself: one that is wrong leaves the others.

    Raises
    ------
    InputError
        If the file is missing, no YAML, or its top is not what the schema says.
    """
    path = claims_file(project, ledger.paper)
    tree = read_yaml(path)
    check_schema(project, "claims", tree, f"claims.{ledger.paper}")
    groups = tree.get("choices", {})
    claims = [_read(project, ledger, name, body, groups) for name, body in tree["claims"].items()]
    return Registry(" ".join(tree["obstacles"].split()), claims)


def amiss(claims: Sequence[Claim]) -> Iterator[str]:
    """What is wrong with claims taken together, a sentence each."""
    headlines, (least, most) = sum(claim.headline for claim in claims), HEADLINES
    if claims and not least <= headlines <= most:
        yield (
            f"claims.{claims[0].paper}: {headlines} of them are headlines, must be {least} to "
            f"{most}: with these the replication stands or falls"
        )
    said: dict[str, str] = {}
    for claim in claims:
        first = said.setdefault(claim.says, claim.name)
        if first != claim.name:
            place = f"claims.{claim.paper}.{claim.name}.says"
            yield f"{place}: what {first} says, must be another claim"


@cache
def claims_text(project: Path, paper: str) -> Tree:
    """The file of a paper's claims as it stands, to see whether it has changed.

    Where it is not what it must be there is its problem instead; those who decide claims report it.
    """
    try:
        tree = read_yaml(claims_file(project, paper))
    except InputError as error:
        return {"problem": str(error)}
    return tree if isinstance(tree.get("claims"), dict) else {"problem": tree}


def decisive(tree: Tree) -> Tree:
    """What of a registry decides whether its claims hold, and over which draws: no wording."""
    kept = ("checks", "depends_on", "expensive")
    claims = {
        name: {key: body[key] for key in kept if key in body} if isinstance(body, dict) else body
        for name, body in tree.get("claims", {}).items()
    }
    return {"choices": tree.get("choices", {}), "claims": claims}


def _read(project: Path, ledger: Ledger, name: str, body: Tree, groups: Tree) -> Claim:
    place = f"claims.{ledger.paper}.{name}"
    claim = Claim(
        ledger.paper,
        name,
        place=_text(body, "place"),
        says=_text(body, "says"),
        headline=bool(body.get("headline", False)),
        why=_text(body, "why") or _text(body, "not_testable"),
        threshold=str(body.get("threshold", "")),
        testable="not_testable" not in body,
    )
    try:
        check_schema(project, "claim", body, place)
        if ("checks" in body and "why" in body) == ("not_testable" in body):
            raise InputError(place, "must have checks with a why, or not_testable")
        if "checks" in body and "threshold" not in body:
            problem = "is missing: say who set the bounds, stated, before or after"
            raise InputError(f"{place}.threshold", problem)
        checks = tuple(map(Check.parse, body.get("checks", ())))
        _check_figures(ledger, checks)
        choices = _choices(ledger, body.get("depends_on", ()), groups)
    except InputError as error:
        where = "" if error.parameter.startswith(place) else f"{place}: "
        return replace(claim, problem=f"{where}{error}")
    expensive = body.get("expensive", False)
    return replace(claim, checks=checks, choices=choices, expensive=expensive)


def _text(body: Tree, key: str) -> str:
    return " ".join(str(body.get(key, "")).split())


def _check_figures(ledger: Ledger, checks: Iterable[Check]) -> None:
    known: dict[str, Any] = {figure: {} for figure in ledger.tree["figures"]}
    if "theory" in ledger.tree:
        known[THEORY] = {}
    for check in checks:
        for reference in check.references:
            if reference.figure not in known:
                reference.look_up(known)


def _choices(ledger: Ledger, named: Iterable[str], groups: Tree) -> tuple[Choice, ...]:
    patterns = [pattern for name in named for pattern in groups.get(name, [name])]
    return tuple(find_choice(ledger, pattern) for pattern in dict.fromkeys(patterns))
