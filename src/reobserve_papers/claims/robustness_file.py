"""The robustness of claims as it is cached between two stages, in JSON."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from reobserve.core.documents import read_json
from reobserve.core.errors import InputError, shown
from reobserve.core.validation import parse
from reobserve_papers.claims.outcomes import Outcome
from reobserve_papers.claims.registry import Quantifier
from reobserve_papers.claims.reversals import Reversal
from reobserve_papers.claims.robustness import Robustness, Trial


def to_data(robustness: Robustness) -> dict[str, Any]:
    """The samples as JSON keeps them, with what was chosen and the numbers that came out."""
    reversal = robustness.reversal
    return {
        "stated": _outcome(robustness.stated),
        "names": list(robustness.names),
        "trials": [
            {"values": list(trial.values), **_outcome(trial.outcome)} for trial in robustness.trials
        ],
        "refused": robustness.refused,
        "basis": robustness.basis,
        "cached": robustness.cached,
        "quantifier": robustness.quantifier,
        "looked": robustness.looked,
        "reversal": reversal and vars(reversal),
    }


def _outcome(outcome: Outcome) -> dict[str, Any]:
    # As words: JSON has no infinity and no number for what is none.
    return {"held": outcome.held, "numbers": list(map(repr, outcome.numbers))}


@dataclass(frozen=True)
class _StoredOutcome:
    held: bool
    numbers: tuple[str, ...]

    def __post_init__(self) -> None:
        self.outcome()

    def outcome(self) -> Outcome:
        """The outcome that was stored, or `InputError` for what is no number."""
        try:
            return Outcome(self.held, tuple(map(float, self.numbers)))
        except ValueError as error:
            raise InputError("numbers", f"must be numbers ({error})") from None


@dataclass(frozen=True)
class _StoredTrial(_StoredOutcome):
    values: tuple[Any, ...]


@dataclass(frozen=True)
class _StoredRobustness:
    """Entry that `to_data` makes of one claim."""

    stated: _StoredOutcome
    names: tuple[str, ...]
    trials: tuple[_StoredTrial, ...]
    refused: tuple[int, ...]
    basis: str
    cached: int
    quantifier: Quantifier
    looked: bool
    reversal: Reversal | None

    def __post_init__(self) -> None:
        drawn = range(len(self.trials))
        if sorted(set(self.refused) & set(drawn)) != list(self.refused):
            raise InputError("refused", f"{shown(self.refused)} must be numbers of samples, rising")
        if not 0 <= self.cached <= len(self.trials):
            raise InputError("cached", f"{self.cached} must be a number of samples")
        checks = len(self.stated.numbers)
        for k, trial in enumerate(self.trials):
            if len(trial.values) != len(self.names):
                problem = f"has {len(trial.values)} values, must have {len(self.names)}"
                raise InputError(f"trials.{k}", problem)
            if len(trial.numbers) not in (0, checks) or (trial.held and not trial.numbers):
                problem = f"has {len(trial.numbers)} numbers, must have {checks}"
                raise InputError(f"trials.{k}", problem)

    def robustness(self) -> Robustness:
        """The robustness that was stored."""
        trials = [Trial(trial.values, trial.outcome()) for trial in self.trials]
        return Robustness(
            self.stated.outcome(), self.names, trials, list(self.refused), self.reversal,
            self.looked,
            self.basis, self.cached, self.quantifier,
        )  # fmt: skip


@dataclass(frozen=True)
class _Stored:
    """The file of a paper."""

    paper: str
    seed: int
    samples: int
    claims: dict[str, _StoredRobustness]


def read_robustness(path: Path, paper: str) -> dict[str, Robustness]:
    """The robustness of a paper's claims by name, from the file that its stage wrote.

    Raises
    ------
    InputError
        If the file is missing or damaged, or of another paper.
    """
    stored = parse(_Stored, read_json(path), str(path))
    if stored.paper != paper:
        raise InputError(str(path), f"is of {stored.paper}, must be of {paper}")
    return {name: one.robustness() for name, one in stored.claims.items()}
