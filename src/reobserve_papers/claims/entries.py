"""Entries of a claims file: what each claim, check and earlier verdict must have."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Discriminator, Field, StringConstraints, Tag, model_validator

from reobserve.core.errors import InputError
from reobserve.core.validation import Text, distinct, items
from reobserve_papers.parameters.parameter_file import Interval, Model

Promise = Literal["abstract", "conclusions"]
Quantifier = Literal["can", "shown", "is", "always"]
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
    over: References | None = Field(None, description="What they are divided by; nan: no case.")
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
    purpose: Annotated[list[Promise], distinct] = Field(
        [],
        description="Where the paper states it as a purpose only. It is a main claim if the"
        " convention `purpose` counts them.",
    )
    quantifier: Quantifier = Field(
        "is",
        description="What it says of the settings that the paper leaves open: it `can` be so, it is"
        " `shown` by one setting, it `is` so, it is `always` so, which one counterexample"
        " contradicts.",
    )
    printed: bool = Field(
        False,
        description="Whether it is about numbers that the paper prints, to which settings"
        " can be fitted.",
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
    null: Annotated[dict[str, str], Field(min_length=1)] | Text | None = Field(
        None,
        description="The baseline. By observer: a constant guess, random gains or the like,"
        " with which the checks should fail. Or why there is none, which a main claim of what"
        " `can` be must say.",
    )
    samples: Annotated[int, Field(ge=36)] | None = Field(
        None, description="The maximum number of samples, where a formula makes them cheap."
    )
    departs: dict[str, Text] = Field(
        {}, description="By convention: why the claim departs from it."
    )
    setting: Text | None = Field(
        None,
        description="A setting at which it is known to hold from a search, with the ranges, the"
        " method, the seed and the budget of that.",
    )
    errata: Annotated[list[str], distinct] = Field(
        [], description="The errata of the paper that correct the statement."
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


class Earlier(Model):
    """A verdict that was another before a bound, range, quantifier, window or promise changed."""

    claim: Text = Field(description="The claim, as it was called.")
    verdict: Text = Field(description="The verdict before.")
    was: Text = Field(description="What was asked then.")
    now: Text = Field(description="What is asked now, or where it went.")
    why: Text = Field(description="The reason for the change.")


class PrintedNumber(Model):
    """A number that a paper prints of a figure, and ours."""

    what: Text = Field(description="What it is of, and of which method.")
    text: Text = Field(
        description="What the paper prints, in its unit. Before a % at the end ours is multiplied"
        " by 100."
    )
    value: str = Field(description="Ours, FIGURE OBSERVER METRIC as in checks.")
    scale: float = Field(1.0, description="What ours is multiplied by.")
    unit: Text | None = Field(None, description="The unit of ours then, if it is another.")


class PaperFigure(Model):
    """A figure of a paper: which of ours show it, or why none does."""

    shows: Text = Field(description="What it shows.")
    ours: Annotated[list[str], distinct] = Field(
        [], description="The figures of the parameter file that show it, the nearest first."
    )
    not_reproduced: Text | None = Field(None, description="Why none of ours shows it.")
    printed: list[PrintedNumber] = Field(
        [], description="The numbers that the paper prints of it, in text, caption or drawing."
    )
    differs: Text | None = Field(None, description="What differs from the paper's figure.")

    @model_validator(mode="after")
    def _shown_or_not(self) -> PaperFigure:
        if bool(self.ours) == (self.not_reproduced is not None):
            raise InputError("", "must have ours or not_reproduced, and not both")
        if self.ours and self.differs is None:
            raise InputError("differs", "is missing: say what differs from the paper's figure")
        return self


class Result(Model):
    """The result of a replication in one sentence, for the README."""

    written_for: Text = Field(
        description="The title and counts that it is true of: `[Re], 2 of 3 main claims reproduced,"
        " 0 contradicted`. With others it is left out."
    )
    sentence: Text = Field(description="The result, in 25 words at most.")

    @model_validator(mode="after")
    def _short(self) -> Result:
        if (words := len(self.sentence.split())) > 25:
            raise InputError("sentence", f"has {words} words, must have 25 at most")
        if "|" in self.sentence:
            raise InputError("sentence", "has a '|', which would end a cell of the table")
        return self


class ClaimsFile(Model):
    """The claims of a paper, ``config/claims/<paper>.yaml``."""

    limitations: Text = Field(description="What the paper leaves open, for the report.")
    result: Result | None = Field(None, description="What was found, for the README.")
    choices: dict[str, Annotated[list[str], items()]] = Field(
        {}, description="Groups of parameters that `depends_on` can name."
    )
    excluded: dict[str, dict[str, Text]] = Field(
        {}, description="By parameter, by reading of its word: where the paper excludes it."
    )
    claims: dict[Annotated[str, StringConstraints(pattern=r"^[a-z0-9_]+$")], ClaimEntry]
    figures: dict[str, PaperFigure] = Field(
        {}, description="All figures of the paper, in its order, by what it calls them."
    )
    history: list[Earlier] = Field(
        [], description="Verdicts that changed with what was asked, while the verdict was known."
    )
