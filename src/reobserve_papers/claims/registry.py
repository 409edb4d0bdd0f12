"""The registry: what each paper claims, where, and what decides it."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from typing import Annotated, Literal

from pydantic import Discriminator, Field, StringConstraints, Tag, model_validator

from reobserve.core.documents import Tree, read_yaml
from reobserve.core.errors import InputError, located, nearest, shown
from reobserve.core.validation import Text, distinct, items
from reobserve_papers.claims.checks import THEORY, Check, Reference
from reobserve_papers.claims.choices import Choice, find_choice
from reobserve_papers.parameters.names import claims_path
from reobserve_papers.parameters.parameter_file import Interval, Model, parse_file
from reobserve_papers.parameters.parameters import Parameters
from reobserve_papers.steps.meanings import Meanings, meanings

Promise = Literal["abstract", "conclusions"]
Quantifier = Literal["can", "is", "always"]
References = Annotated[
    Annotated[str, Tag("one")] | Annotated[Annotated[list[str], items()], Tag("several")],
    Discriminator(lambda value: "several" if isinstance(value, list) else "one"),
]


class CheckEntry(Model):
    """A condition on metrics: exactly one relation, from `below` to `exists`."""

    value: References = Field(
        description="FIGURE OBSERVER METRIC or theory OBSERVER METRIC, or a list of these. The"
        " words are those of a row of FIGURE.metrics.csv or theory.metrics.csv in results/PAPER;"
        " the page Metrics explains them."
    )
    over: References | None = Field(None, description="Metrics by which the values are divided.")
    minus: References | None = Field(
        None, description="Metrics that are subtracted from the values."
    )
    below: float | None = Field(None, description="Relation: each value is less than this.")
    above: float | None = Field(None, description="Relation: each value is greater than this.")
    within: Interval | None = Field(
        None, description="Relation: each value is between these two, or equal to one of them."
    )
    falling: Literal[True] | None = Field(
        None, description="Relation: each value of the list is less than the one before."
    )
    rising: Literal[True] | None = Field(
        None, description="Relation: each value of the list is greater than the one before."
    )
    exists: bool | None = Field(
        None, description="Relation: true if each value must be finite, false if it must be nan."
    )
    share: Annotated[float, Field(gt=0, le=1)] | None = Field(
        None, description="The minimum share of the list that must satisfy the relation."
    )


class ClaimEntry(Model):
    """One claim of a paper: either checks with a reason, or why nothing can test it."""

    place: Text = Field(description="Where the paper makes the claim.")
    statement: Text = Field(
        description="The claim in our words. A check is true if the paper is right."
    )
    promised: Annotated[list[Promise], distinct] = Field(
        [],
        description="Where the paper promises it of its own method: abstract, conclusions. Such a"
        " claim is a main claim.",
    )
    quantifier: Quantifier = Field(
        "is",
        description="In how many settings it must hold: `can` in one, `is` in nine of ten, `always`"
        " in all.",
    )
    checks: Annotated[list[CheckEntry], items()] | None = Field(
        None, description="All of them must hold."
    )
    why: Text | None = Field(None, description="The reason for the bounds.")
    threshold: Literal["stated", "before", "after"] | None = Field(
        None,
        description="Who set the bounds: the paper (`stated`), or we, `before` or `after` their"
        " numbers were known.",
    )
    depends_on: Annotated[list[str], distinct] = Field(
        [],
        description="What samples vary: keys of parameters, patterns of keys, groups of `choices`.",
    )
    expensive: bool = Field(
        False,
        description="Whether the search for a reversal tries only the ends of ranges, for speed.",
    )
    not_testable: Text | None = Field(None, description="Why nothing can test it.")

    @model_validator(mode="after")
    def _either(self) -> ClaimEntry:
        if (self.checks is not None and self.why is not None) == (self.not_testable is not None):
            raise InputError("", "must have checks with a why, or not_testable")
        if self.checks is not None and self.threshold is None:
            problem = "is missing: say who set the bounds, stated, before or after"
            raise InputError("threshold", problem)
        return self


class ClaimsFile(Model):
    """The claims of a paper, ``config/claims/<paper>.yaml``."""

    limitations: Text = Field(description="What the paper leaves open, for the report.")
    choices: dict[str, Annotated[list[str], items()]] = Field(
        {}, description="Groups of parameters that `depends_on` can name."
    )
    claims: Annotated[
        dict[Annotated[str, StringConstraints(pattern=r"^[a-z0-9_]+$")], ClaimEntry],
        Field(min_length=1),
    ]


@dataclass(frozen=True)
class Claim:
    """A statement of a paper, in our words.

    ``why`` is the reason for the bounds, or why nothing can test it; ``threshold``
    says who set them: the paper (`stated`), or we, `before` or `after` the numbers were known.
    ``promised`` says where the paper promises it of its own method, ``quantifier`` for how many
    settings it must be true.
    """

    paper: str
    name: str
    place: str = ""
    statement: str = ""
    promised: tuple[str, ...] = ()
    quantifier: Quantifier = "is"
    checks: tuple[Check, ...] = ()
    why: str = ""
    threshold: str = ""
    choices: tuple[Choice, ...] = ()
    expensive: bool = False
    testable: bool = True

    @property
    def is_main(self) -> bool:
        """True if the title of the replication depends on it."""
        return bool(self.promised)

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

    @property
    def knob_names(self) -> tuple[str, ...]:
        """The names of the values that a sample chooses."""
        return tuple(name for choice in self.choices for name in choice.names)


@dataclass(frozen=True)
class Registry:
    """The claims of a paper, and the limitations to replicating it."""

    limitations: str = ""
    claims: list[Claim] = field(default_factory=list)


def claims_file(project: Path, paper: str) -> Path:
    """The file with the claims of a paper."""
    return project / claims_path(paper)


def read_claims(project: Path, paper: str) -> ClaimsFile:
    """Read the claims of a paper as its file has them, or raise `InputError` for what is wrong."""
    return parse_file(ClaimsFile, read_yaml(claims_file(project, paper)), "claims", paper)


def read_registry(project: Path, parameters: Parameters) -> Registry:
    """The claims of a paper.

    Raises
    ------
    InputError
        If the file is missing or no YAML, or with the key of the first claim that is wrong: in
        itself, or since there is no figure, metric or parameter that it names.
    """
    stated = read_claims(project, parameters.paper)
    known = meanings(parameters.package)
    claims = []
    for name, entry in stated.claims.items():
        with located(f"claims.{parameters.paper}.{name}"):
            claims.append(_claim(parameters, name, entry, stated.choices, known))
    return Registry(stated.limitations, claims)


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
        tree = read_yaml(claims_file(project, paper))
    except InputError as error:
        return {"problem": str(error)}
    return tree if isinstance(tree.get("claims"), dict) else {"problem": tree}


def decisive(tree: Tree) -> Tree:
    """The part of a registry that decides whether claims hold, over which samples: no wording."""
    cached = ("checks", "quantifier", "depends_on", "expensive")
    claims = {
        name: {key: body[key] for key in cached if key in body} if isinstance(body, dict) else body
        for name, body in tree.get("claims", {}).items()
    }
    return {"choices": tree.get("choices", {}), "claims": claims}


def _claim(
    parameters: Parameters,
    name: str,
    entry: ClaimEntry,
    groups: Mapping[str, list[str]],
    known: Meanings,
) -> Claim:
    checks = []
    for index, one in enumerate(entry.checks or ()):
        with located(f"checks.{index}"):
            checks.append(Check.parse(one.model_dump(exclude_none=True)))
            _check_names(parameters, checks[-1], known)
    return Claim(
        parameters.paper,
        name,
        place=entry.place,
        statement=entry.statement,
        promised=tuple(entry.promised),
        quantifier=entry.quantifier,
        checks=tuple(checks),
        why=entry.why or entry.not_testable or "",
        threshold=entry.threshold or "",
        choices=_choices(parameters, entry.depends_on, groups),
        expensive=entry.expensive,
        testable=entry.not_testable is None,
    )


def _check_names(parameters: Parameters, check: Check, known: Meanings) -> None:
    """Refuse a figure that is not there, and a metric that the paper's code does not know."""
    figures = [*parameters.tree["figures"], *([THEORY] if THEORY in parameters.tree else [])]
    for reference in check.references:
        if reference.figure not in figures:
            problem = f"there is no {shown(reference.figure)}{nearest(reference.figure, figures)}"
            raise InputError("figure", problem)
        if known and not any(pattern.fullmatch(reference.metric) for pattern, _ in known):
            names = [pattern.pattern.replace("\\", "") for pattern, _ in known]
            problem = f"there is no {shown(reference.metric)}{nearest(reference.metric, names)}"
            raise InputError("metric", problem)


def _choices(
    parameters: Parameters, named: Iterable[str], groups: Mapping[str, list[str]]
) -> tuple[Choice, ...]:
    patterns = [pattern for name in named for pattern in groups.get(name, [name])]
    return tuple(find_choice(parameters, pattern) for pattern in dict.fromkeys(patterns))
