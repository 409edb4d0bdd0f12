"""Alternatives to conventions: each is changed once, alone, and what that changes is said.

Most are re-evaluated from samples that are stored with all numbers that any alternative names:
another bound, measure, quantifier, promise or rule, fewer of the samples. A narrower range keeps
the samples in it; other weights keep some of the samples by a seeded draw, since the interval of a
share does not hold for weighted ones.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace

from reobserve.core.errors import InputError, located
from reobserve_papers.claims.checks import Numbers
from reobserve_papers.claims.conventions import Conventions, SingleAlternative
from reobserve_papers.claims.inquiry import Robustness, counted
from reobserve_papers.claims.labels import spelt
from reobserve_papers.claims.outcomes import Outcome, Sample, outcome, taken
from reobserve_papers.claims.registry import Claim, Registry
from reobserve_papers.claims.restrictions import Keep, kept_by, narrower
from reobserve_papers.claims.title import (
    CLAIMS,
    INTERVAL,
    LACKS,
    MAIN,
    NEW_MAIN,
    NO_MAIN,
    NOT_COMPUTED,
    TITLE,
    counts_of,
    row_as_stated,
)
from reobserve_papers.claims.verdict_rules import (
    BROKEN,
    CONTRADICTED,
    NOT_TESTABLE,
    UNDECIDED,
    Counted,
    Judged,
    main_claims,
    open_verdicts,
    possible,
    title_of,
)

_RULES = ("share", "majority", "main", "purpose")  # conventions that change titles themselves


@dataclass(frozen=True)
class Alternative:
    """One change, alone: of conventions, of claims, or of which samples of which claims count.

    ``chosen`` says of claims who set the reading as stated, and when, as `Claim.threshold`.
    """

    name: str
    kind: str
    change: str
    why: str
    conventions: Conventions
    claims: Mapping[str, Claim] = field(default_factory=dict)
    keep: Mapping[str, Keep] = field(default_factory=dict)
    chosen: Callable[[str], str] = lambda claim: ""


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
        """The title by the conventions as stated."""
        mains = self._mains(self.judged, self.conventions)
        return title_of(mains, self.conventions.values["majority"])

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
                why = convention.reasons.get(label, f"The convention {change}.")
                yield Alternative(
                    f"{name}: {label}",
                    "convention",
                    change,
                    why,
                    other,
                    claims,
                    {},
                    lambda _: "after",
                )
        for name, single in conventions.single.items():
            if self.registry.claims and single.paper == self.registry.claims[0].paper:
                with located(f"alternatives.{name}"):
                    yield self._single(name, single)
        for claim in self._mains(self.judged, conventions):
            for name, why, keep in narrower(self._own(claim.name)):
                yield Alternative(name, "samples", name, why, conventions, {}, {claim.name: keep})

    def rows(self) -> Iterator[dict[str, str]]:
        """The rows of `write_alternatives`: title, main claims as stated, and alternatives."""
        stated, title = self._mains(self.judged, self.conventions), self.title
        plain = row_as_stated(title, (claim.name for claim in stated))
        yield plain
        for judged in stated:
            own = {"claim": judged.name, "verdict": judged.verdict, "held": judged.held}
            yield {**plain, **own, "kind": MAIN, "chosen": self._own(judged.name).threshold}
        for alternative in self.alternatives():
            yield from self._changed(alternative, plain)
        for name, word, other in open_verdicts(stated, self.conventions.values["majority"]):
            yield {
                **plain, "alternative": f"{name} is {word}", "kind": INTERVAL, "claim": name,
                "verdict": UNDECIDED, "held": self.judged[name].held, "other": word,
                "other_title": other,
            }  # fmt: skip

    def _changed(self, alternative: Alternative, plain: dict[str, str]) -> Iterator[dict[str, str]]:
        """Yield what an alternative changes, a row without a claim where it changes nothing."""
        judged, rows = dict(self.judged), []
        concerned = self._concerned(alternative)
        for claim in concerned:
            before = self.judged[claim.name]
            after, note = self._other(claim, alternative)
            judged[claim.name] = after
            lost = bool(before.promised) and not after.promised
            gained = bool(after.promised) and not before.promised
            note = note or (NO_MAIN if lost else NEW_MAIN if gained else "")
            if after.verdict != before.verdict or note:
                rows.append({
                    "claim": claim.name, "verdict": before.verdict, "held": before.held,
                    "other": after.verdict, "other_held": after.held, "note": note,
                    "chosen": alternative.chosen(claim.name),
                })  # fmt: skip
        # Where it leaves no main claim it says nothing of the title.
        values, before_names = alternative.conventions.values, plain["mains"].split()
        mains = self._mains(judged, alternative.conventions) or self._mains(
            self.judged, self.conventions
        )
        names = [claim.name for claim in mains]
        rules = any(values[rule] != self.conventions.values[rule] for rule in _RULES)
        touches = rules or names != before_names
        touches = touches or any(claim.name in names for claim in concerned)
        counts = {
            "held": counts_of([self.judged[name].verdict for name in before_names]),
            "other_held": counts_of([claim.verdict for claim in mains]),
            "chosen": alternative.chosen(""),
        }  # fmt: skip
        for row in rows or [counts]:
            yield {
                **plain, **row, "alternative": alternative.name, "kind": alternative.kind,
                "change": alternative.change, "why": alternative.why, "mains": " ".join(names),
                "touches": TITLE if touches else CLAIMS,
                "other_title": title_of(mains, values["majority"]),
            }  # fmt: skip

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
        verdicts, held = self._verdicts(claim, conventions, keep)
        return Judged(claim.name, claim.place, claim.promised, claim.purpose, verdicts, held)

    def _verdicts(
        self, claim: Claim, conventions: Conventions, keep: Keep | None
    ) -> tuple[tuple[str, ...], str]:
        """The verdicts that are possible, and the numbers that they rest on, in words."""
        if not claim.testable:
            return (NOT_TESTABLE,), ""
        if claim.choices and claim.name not in self.samples:
            return (BROKEN,), ""
        try:
            stated = self._nominal_outcome(claim)
            if claim.quantifier == "always" and stated not in ("holds", "no case"):
                return (CONTRADICTED,), self._measured(claim)
            outcomes = self.outcomes(claim)
        except InputError:
            if claim is not self._own(claim.name):
                raise
            return (BROKEN,), ""
        fitted = claim.quantifier in ("can", "shown") or claim.printed
        fitted = fitted and self.setting(claim) != ""
        if keep is not None:
            outcomes = self._kept(claim, outcomes, keep)
        count = self.counted(claim, outcomes)
        if keep is not None and claim.choices and self.samples[claim.name].whole is not None:
            count = counted(outcomes, whole=bool(outcomes))
        held = f"{count.held} of {count.samples}" if claim.choices else self._measured(claim)
        return possible(claim.quantifier, count, conventions.values["share"], fitted), held

    def _measured(self, claim: Claim) -> str:
        """The numbers with the parameter file of the checks that fail."""
        failed = [check for check in claim.checks if not check.holds(self.numbers)]
        return "; ".join(check.measured(self.numbers) for check in failed)

    def setting(self, claim: Claim) -> str:
        """A setting at which a claim is known to hold, or for what is `always` so, to fail."""
        wanted, stated = claim.quantifier != "always", self._nominal_outcome(claim)
        if (stated == "holds") == wanted and stated != "no case":
            return "the parameter file"
        samples = self.samples.get(claim.name, Robustness())
        outcomes = self.outcomes(claim) if samples.trials else []
        for trial, word in zip(samples.trials, outcomes, strict=True):
            if (word == "holds") == wanted and word not in ("diverged", "refused", "no case"):
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

    def _mains(self, judged: Mapping[str, Judged], conventions: Conventions) -> list[Judged]:
        """The main claims by conventions."""
        values = conventions.values
        return main_claims(judged.values(), values["main"], values["purpose"])

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
        change = "; ".join(parts)

        def chosen(claim: str) -> str:
            keys = single.claims.get(claim, {})
            bounds = bool(keys) and all(key.startswith("checks") for key in keys)
            return self._own(claim).threshold if bounds else "after" if claims else ""

        return Alternative(name, kind, change, single.why, self.conventions, claims, keep, chosen)
