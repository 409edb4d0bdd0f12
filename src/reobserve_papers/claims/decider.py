"""Alternatives to conventions: each is changed once, alone, and what that changes is said.

Most are re-evaluated from samples that are stored with all numbers that any alternative names:
another bound, measure, quantifier, promise or rule, fewer of the samples. A narrower range keeps
the samples in it; other weights keep some of the samples by a seeded draw, since the interval of a
share does not hold for weighted ones.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

from reobserve.core.errors import InputError, located
from reobserve.core.files import NAME, Kind, read_table, write_table
from reobserve_papers.claims.checks import Numbers
from reobserve_papers.claims.conventions import Conventions, SingleAlternative
from reobserve_papers.claims.inquiry import Robustness, counted
from reobserve_papers.claims.outcomes import Outcome, Sample, outcome, taken
from reobserve_papers.claims.registry import Claim, Registry
from reobserve_papers.claims.restrictions import Keep, kept_by, narrower, spelt
from reobserve_papers.claims.verdict_rules import (
    BROKEN,
    CONTRADICTED,
    NOT_TESTABLE,
    OPEN,
    REPRODUCED,
    Counted,
    Judged,
    main_claims,
    open_verdicts,
    possible,
    title_of,
)

HEADER = (
    "alternative", "kind", "change", "claim", "verdict", "other", "title", "other_title", "note",
)  # fmt: skip
KINDS = {"alternative": Kind(bool, "a name"), "kind": NAME}
STATED = "as stated"
_BETWEEN = " | "  # reasons in one cell

LACKS = "lacks samples"  # of a verdict that no more than a lack of samples leaves open
NOT_COMPUTED = "not computed"  # of one whose numbers the samples do not have
NO_MAIN, NEW_MAIN = "no main claim", "a main claim"  # of a claim that no longer is, or becomes one


@dataclass(frozen=True)
class Alternative:
    """One change, alone: of conventions, of claims, or of which samples of which claims count."""

    name: str
    kind: str
    change: str
    conventions: Conventions
    claims: Mapping[str, Claim] = field(default_factory=dict)
    keep: Mapping[str, Keep] = field(default_factory=dict)


@dataclass(frozen=True)
class Changed:
    """Effect of an alternative on a claim (none: on no claim), and on the title."""

    alternative: Alternative
    claim: str
    verdict: str
    other: str
    title: str
    other_title: str
    note: str = ""


@dataclass(frozen=True)
class Title:
    """The title of a replication, and what it would take to change it, by name."""

    word: str
    reasons: tuple[str, ...] = ()


class Decider:
    """Verdicts of a paper's claims from their samples, by the conventions and by alternatives.

    Parameters
    ----------
    registry
        The claims.
    numbers
        The metrics with the parameter file as it is, which decide claims without choices.
    samples
        The samples of the others, by name.
    seed
        The root of the random streams that weigh samples.
    """

    def __init__(
        self,
        registry: Registry,
        numbers: Numbers,
        samples: Mapping[str, Robustness],
        seed: int,
    ) -> None:
        self.registry, self.conventions = registry, registry.conventions
        self.numbers, self.samples, self._seed = numbers, samples, seed
        self._known: dict[str, list[Outcome]] = {}
        self.judged = {
            claim.name: self._judged(claim, self.conventions) for claim in registry.claims
        }

    @property
    def title(self) -> str:
        """The title by the conventions, as if nothing could be seen otherwise."""
        return self._title(self.judged, self.conventions) or OPEN

    def outcomes(self, claim: Claim) -> list[Outcome]:
        """The outcomes in the samples, or with the parameter file where nothing is open."""
        own = claim is self._own(claim.name)
        if own and claim.name in self._known:
            return self._known[claim.name]
        if claim.choices:
            outcomes = self.samples[claim.name].outcomes(claim)
        else:
            outcomes = [outcome(claim, self.numbers)]
        if own:
            self._known[claim.name] = outcomes
        return outcomes

    def counted(self, claim: Claim, outcomes: Sequence[Outcome]) -> Counted:
        """The number of settings in which it holds."""
        if not claim.choices:
            return counted(outcomes, whole=True)
        return self.samples[claim.name].counted(outcomes)

    def alternatives(self) -> Iterator[Alternative]:
        """All alternatives: of conventions, single ones, and of what main claims depend on."""
        conventions = self.conventions
        for name, convention in conventions.stated.items():
            concerned = self.registry.naming(name)
            for label, value in convention.alternatives.items():
                other = conventions.with_value(name, value)
                claims = {claim: self.registry.variant(claim, other) for claim in concerned}
                change = f"{name} from {spelt(convention.value)} to {spelt(value)}"
                yield Alternative(f"{name}: {label}", "convention", change, other, claims)
        for name, single in conventions.single.items():
            if self.registry.claims and single.paper == self.registry.claims[0].paper:
                with located(f"alternatives.{name}"):
                    yield self._single(name, single)
        for claim in main_claims(
            self.judged.values(), conventions.values["main"], conventions.values["purpose"]
        ):
            for name, keep in narrower(self._own(claim.name)):
                yield Alternative(name, "samples", name, self.conventions, {}, {claim.name: keep})

    def changes(self, alternatives: Iterable[Alternative]) -> Iterator[Changed]:
        """Yield what each alternative changes, one without a claim where it changes nothing."""
        title = self.title
        for alternative in alternatives:
            judged, rows = dict(self.judged), []
            for claim in self._concerned(alternative):
                before = self.judged[claim.name]
                after, note = self._other(claim, alternative)
                judged[claim.name] = after
                moved = after.verdict != before.verdict
                lost = bool(before.promised) and not after.promised
                gained = bool(after.promised) and not before.promised
                note = note or (NO_MAIN if lost else NEW_MAIN if gained else "")
                if moved or note:
                    rows.append((claim.name, before.verdict, after.verdict, note))
            # Where it leaves no main claim it says nothing of the title.
            other_title = self._title(judged, alternative.conventions) or title
            for name, verdict, other, note in rows or [("", "", "", "")]:
                yield Changed(alternative, name, verdict, other, title, other_title, note)

    def _own(self, name: str) -> Claim:
        return next(claim for claim in self.registry.claims if claim.name == name)

    def _concerned(self, alternative: Alternative) -> list[Claim]:
        """The claims whose verdict an alternative might change, as it reads them."""
        rule = alternative.conventions.values["share"] != self.conventions.values["share"]
        return [
            alternative.claims.get(claim.name, claim)
            for claim in self.registry.claims
            if rule or claim.name in alternative.claims or claim.name in alternative.keep
        ]

    def _judged(self, claim: Claim, conventions: Conventions, keep: Keep | None = None) -> Judged:
        return Judged(
            claim.name, claim.place, claim.promised, claim.purpose,
            self._verdicts(claim, conventions, keep),
        )  # fmt: skip

    def _verdicts(
        self, claim: Claim, conventions: Conventions, keep: Keep | None
    ) -> tuple[str, ...]:
        if not claim.testable:
            return (NOT_TESTABLE,)
        if claim.choices and claim.name not in self.samples:
            return (BROKEN,)
        try:
            if claim.quantifier == "always" and self._nominal_outcome(claim) != "holds":
                return (CONTRADICTED,)
            outcomes = self.outcomes(claim)
        except InputError:
            if claim is not self._own(claim.name):
                raise
            return (BROKEN,)
        fitted = (claim.quantifier == "can" or claim.printed) and self.setting(claim) != ""
        if keep is not None:
            outcomes = self._kept(claim, outcomes, keep)
        count = self.counted(claim, outcomes)
        if keep is not None and claim.choices and self.samples[claim.name].whole is not None:
            count = counted(outcomes, whole=bool(outcomes))
        return possible(claim.quantifier, count, conventions.values["share"], fitted)

    def setting(self, claim: Claim) -> str:
        """A setting at which a claim is known to hold, or for what is `always` so, to fail."""
        wanted = claim.quantifier != "always"
        if (self._nominal_outcome(claim) == "holds") == wanted:
            return "the parameter file"
        samples = self.samples.get(claim.name, Robustness())
        outcomes = self.outcomes(claim) if samples.trials else []
        for trial, word in zip(samples.trials, outcomes, strict=True):
            if (word == "holds") == wanted and word not in ("diverged", "refused"):
                listed = zip(samples.names, trial.values, strict=True)
                return ", ".join(f"{name} {spelt(value)}" for name, value in listed)
        return claim.setting

    def holds(self, claim: Claim) -> bool:
        """True if it holds with the parameter file as it is, which has no vote."""
        return self._nominal_outcome(claim) == "holds"

    def nominal(self, claim: Claim) -> Sample:
        """The numbers of a claim with the parameter file as it is."""
        references = [ref for check in claim.checks for ref in check.references]
        return taken(references, self.numbers)

    def _nominal_outcome(self, claim: Claim) -> Outcome:
        return outcome(claim, self.numbers)

    def _kept(self, claim: Claim, outcomes: list[Outcome], keep: Keep) -> list[Outcome]:
        samples = self.samples[claim.name]
        return [
            word
            for number, (trial, word) in enumerate(zip(samples.trials, outcomes, strict=True))
            if keep(dict(zip(samples.names, trial.values, strict=True)), number)
        ]

    def _other(self, claim: Claim, alternative: Alternative) -> tuple[Judged, str]:
        """The verdict by an alternative, or the one there is where that cannot be said."""
        before = self.judged[claim.name]
        unchanged = replace(before, promised=claim.promised, purpose=claim.purpose)
        try:
            after = self._judged(claim, alternative.conventions, alternative.keep.get(claim.name))
        except InputError:
            return unchanged, NOT_COMPUTED
        if len(after.verdicts) > 1 and before.verdict in after.verdicts:
            return unchanged, LACKS
        return after, ""

    def _title(self, judged: Mapping[str, Judged], conventions: Conventions) -> str:
        """The title by verdicts, none without main claims."""
        values = conventions.values
        mains = main_claims(judged.values(), values["main"], values["purpose"])
        return title_of(mains, values["majority"]) if mains else ""

    def _single(self, name: str, single: SingleAlternative) -> Alternative:
        claims = {
            claim: self.registry.variant(claim, self.conventions, changes)
            for claim, changes in single.claims.items()
        }
        keep = kept_by(self.registry, single, self._seed)
        parts = [f"{claim}: {', '.join(map(str, keys))}" for claim, keys in single.claims.items()]
        selection = {**single.ranges, **single.weights}
        parts += [f"{key} {spelt(value)}" for key, value in selection.items()]
        kind = "claim" if claims else "samples"
        return Alternative(name, kind, "; ".join(parts), self.conventions, claims, keep)


def decide(decider: Decider) -> tuple[list[Changed], Title]:
    """Return what all alternatives change, and the title that follows."""
    changes = list(decider.changes(decider.alternatives()))
    return changes, title(decider, changes)


def title(decider: Decider, changes: Iterable[Changed]) -> Title:
    """The title: open where one alternative, or one open interval, would change it."""
    values = decider.conventions.values
    plain = decider.title
    mains = main_claims(decider.judged.values(), values["main"], values["purpose"])
    reasons: list[str] = []
    if plain == OPEN:
        short = [claim for claim in mains if claim.verdict != REPRODUCED]
        listed = ", ".join(f"{claim.name} {claim.verdict}" for claim in short)
        reasons.append(
            f"{len(mains) - len(short)} of {len(mains)} main claims are reproduced: {listed}"
        )
    if contradicted := [claim.name for claim in mains if claim.verdict == CONTRADICTED]:
        reasons.append(f"contradicted: {', '.join(contradicted)}")
    by: dict[str, dict[str, None]] = {}
    for change in changes:
        if change.other_title != plain:
            by.setdefault(change.other_title, {})[change.alternative.name] = None
    changing = [f"{word} with {'; '.join(names)}" for word, names in by.items()]
    changing += [
        f"{other} if {claim} is {word}, which its samples allow"
        for claim, word, other in open_verdicts(mains, values["majority"])
    ]
    return Title(OPEN if changing else plain, (*reasons, *changing))


def write_alternatives(path: Path, changes: Iterable[Changed], title: Title) -> None:
    """Write the title, and a row for each claim that an alternative changes, or one for nothing."""
    first = {
        **dict.fromkeys(HEADER, ""), "alternative": STATED, "kind": "title", "title": title.word,
        "change": _BETWEEN.join(title.reasons),
    }  # fmt: skip
    rows = (
        {
            "alternative": change.alternative.name, "kind": change.alternative.kind,
            "change": change.alternative.change, "claim": change.claim, "verdict": change.verdict,
            "other": change.other, "title": change.title, "other_title": change.other_title,
            "note": change.note,
        }
        for change in changes
    )  # fmt: skip
    write_table(path, [first, *rows], HEADER, seal=True)


def read_alternatives(path: Path) -> tuple[Title, list[dict[str, str]]]:
    """The title and the rows of `write_alternatives`."""
    rows = read_table(path, HEADER, KINDS, ("alternative", "claim"))
    if not rows or rows[0]["kind"] != "title":
        raise InputError(str(path), "has no title in its first row")
    return Title(rows[0]["title"], tuple(filter(None, rows[0]["change"].split(_BETWEEN)))), rows[1:]
