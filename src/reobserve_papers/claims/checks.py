"""A check: a number behind a figure, or a list of them, and what a claim asks of it."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any, NamedTuple

from reobserve.core.errors import InputError, nearest
from reobserve_papers.metrics.metrics import name_at, parse_name
from reobserve_papers.parameters.config import refuse_unknown

THEORY = "theory"  # stands where a reference names a figure

# By figure (or `THEORY`): the values by (observer, metric).
Numbers = Mapping[str, Mapping[tuple[str, str], float]]


class Reference(NamedTuple):
    """Place of a number: a row of a figure's metrics, or of the theory's."""

    figure: str
    observer: str
    metric: str

    def __str__(self) -> str:
        """The reference as a registry writes it."""
        return " ".join(self)

    @classmethod
    def parse(cls, text: str) -> Reference:
        """The reference of ``FIGURE OBSERVER METRIC``, coordinates of studies as ``NAME=LEVEL``."""
        figure, observer, metric = [*text.split(maxsplit=2), "", "", ""][:3]
        try:
            name, at = parse_name(metric)
        except InputError:
            name, at = "", {}
        if not name or "=" in name:
            problem = f"{text!r} must be FIGURE OBSERVER METRIC, then NAME=LEVEL for a coordinate"
            raise InputError("reference", problem)
        return cls(figure, observer, name_at(name, **at))

    def look_up(self, numbers: Numbers) -> float:
        """The value, or `InputError` if there is no such figure or number."""
        refuse_unknown("figure", [self.figure], numbers)
        rows = numbers[self.figure]
        if (self.observer, self.metric) in rows:
            return rows[self.observer, self.metric]
        observers = list(dict.fromkeys(observer for observer, _ in rows))
        if self.observer not in observers:
            raise InputError(
                "observer",
                f"{self.figure} has no {self.observer!r}{nearest(self.observer, observers)}",
            )
        metrics = [metric for observer, metric in rows if observer == self.observer]
        raise InputError(
            "metric",
            f"{self.figure} has no {self.metric!r} of {self.observer}"
            f"{nearest(self.metric, metrics)}",
        )


@dataclass(frozen=True)
class Check:
    """Condition that some numbers must satisfy.

    Parameters
    ----------
    value
        The numbers.
    other, how
        What each is divided by (`over`) or what is taken from it (`minus`), if anything.
    relation, bound
        `below`, `above` (a number, strictly), `within` (a closed interval), `falling`, `rising`
        (strictly, over the list) or `exists` (true: finite; false: nan, it never happens).
    share
        The minimum share of the list that must satisfy the relation.
    """

    value: tuple[Reference, ...]
    relation: str
    bound: Any
    other: tuple[Reference, ...] = ()
    how: str = ""
    share: float = 1.0

    @classmethod
    def parse(cls, body: Mapping[str, Any]) -> Check:
        """The check of an entry of a registry that its schema has accepted."""
        relations = (*RELATIONS, *_OF_LISTS)
        asked = [word for word in relations if word in body]
        if len(asked) != 1:
            listed = ", ".join(relations)
            raise InputError("", f"{len(asked)} relations given, must be one of {listed}")
        if "over" in body and "minus" in body:
            raise InputError("", "has both over and minus, must have one of them")
        how = next((word for word in ("over", "minus") if word in body), "")
        value, other = _references(body["value"]), _references(body.get(how, []))
        if other and len(other) != len(value):
            if len(other) != 1:
                raise InputError(how, f"has {len(other)} references, must have {len(value)} or 1")
            other *= len(value)
        if asked[0] in _OF_LISTS and len(value) < 2:
            raise InputError(asked[0], "asks for a list of two references or more")
        return cls(value, asked[0], body[asked[0]], other, how, body.get("share", 1.0))

    @property
    def references(self) -> tuple[Reference, ...]:
        """All numbers that it looks up."""
        return self.value + self.other

    def of_others(self, others: Mapping[str, str]) -> Check:
        """The same check of other observers, by name."""
        value, other = (
            tuple(ref._replace(observer=others.get(ref.observer, ref.observer)) for ref in listed)
            for listed in (self.value, self.other)
        )
        return replace(self, value=value, other=other)

    @property
    def mirrored(self) -> Check | None:
        """The check of the opposite where it says which of two numbers is less, else None.

        Of ``a / b < 0.95`` it is ``b / a < 0.95``, of ``a - b < 0`` it is ``b - a < 0``.
        """
        neutral = {"over": 1.0, "minus": 0.0}.get(self.how)
        if neutral is None or self.relation not in ("below", "above"):
            return None
        if (self.bound - neutral) * (1 if self.relation == "above" else -1) < 0:
            return None  # it tolerates the opposite, and says nothing of which is less
        return replace(self, value=self.other, other=self.value)

    @property
    def name(self) -> str:
        """The name of what is checked, by the first of its numbers."""
        value = str(self.value[0])
        if not self.how:
            return value
        return f"{value} {'/' if self.how == 'over' else '-'} {self.other[0]}"

    def values(self, numbers: Numbers) -> list[float]:
        """The values of the relation, one for each reference (see `Reference.look_up`)."""
        values = [reference.look_up(numbers) for reference in self.value]
        others = [reference.look_up(numbers) for reference in self.other]
        if self.how == "over":
            return [_quotient(a, b) for a, b in zip(values, others, strict=True)]
        if self.how == "minus":
            return [a - b for a, b in zip(values, others, strict=True)]
        return values

    def is_case(self, numbers: Numbers) -> bool:
        """False if it divides by what is not a number, such as a difference that is rounding."""
        return self.how != "over" or not any(math.isnan(one.look_up(numbers)) for one in self.other)

    def holds(self, numbers: Numbers) -> bool:
        """True if the numbers satisfy it."""
        return self.satisfied_by(self.deciding(numbers))

    def deciding(self, numbers: Numbers) -> float:
        """The deciding number: the worst of those that must satisfy the relation.

        For a sequence that must rise or fall it is the smallest step in that direction.
        """
        values = self.values(numbers)
        if self.relation in _OF_LISTS:
            values = [b - a for a, b in pairwise(values)]
        best_first = sorted(values, key=self.margin, reverse=True)
        asked = math.ceil(
            self.share * len(values) - 1e-9
        )  # 0.28 of 25 are 7, not 7.000000000000001
        return float(best_first[asked - 1])

    def satisfied_by(self, number: float, bound: Any = None) -> bool:
        """True if the check holds where this number decides, with another ``bound`` if given."""
        if self.relation in _OF_LISTS:
            return self.margin(number) > 0
        return RELATIONS[self.relation](number, self.bound if bound is None else bound)

    def measured(self, numbers: Numbers) -> str:
        """The numbers and what is asked of them, for a reader, of a list the worst."""
        values = self.values(numbers)
        name = self.name
        if self.relation in _OF_LISTS:
            listed = ", ".join(f"{value:.3g}" for value in values)
            return f"{name} = {listed}: must be {self.relation}"
        asked = _asked(self.relation, self.bound)
        if len(values) == 1:
            return f"{name} = {values[0]:.3g}, must be {asked}"
        satisfied = [RELATIONS[self.relation](value, self.bound) for value in values]
        worst = min(values, key=self.margin)
        part = f", for at least {self.share:.0%}" if self.share < 1 else ""
        return (
            f"{name} and so on: {sum(satisfied)} of {len(values)} are {asked}{part}; "
            f"the worst is {worst:.3g}"
        )

    def margin(self, value: float) -> float:
        """The margin by which a number satisfies the relation, of which only the order counts."""
        if self.relation == "exists":
            return float(_exists(value, self.bound))
        if math.isnan(value):
            return -math.inf
        if self.relation in ("below", "falling"):
            return -value
        if self.relation == "within":
            return -abs(value - float(sum(self.bound)) / 2)
        return value


def _exists(value: float, wanted: bool) -> bool:
    return math.isfinite(value) if wanted else math.isnan(value)


RELATIONS: dict[str, Callable[[float, Any], bool]] = {
    "below": lambda value, bound: value < bound,
    "above": lambda value, bound: value > bound,
    "within": lambda value, bound: bound[0] <= value <= bound[1],
    "exists": _exists,
}
_OF_LISTS = ("falling", "rising")  # which no member satisfies by itself


def _references(listed: str | list[str]) -> tuple[Reference, ...]:
    return tuple(
        map(Reference.parse, [listed] if isinstance(listed, str) else listed),
    )


def _quotient(a: float, b: float) -> float:
    return a / b if b else math.copysign(math.inf, a) if a else math.nan


def _asked(relation: str, bound: Any) -> str:
    if relation == "within":
        low, high = bound
        return f"{low:g}" if low == high else f"between {low:g} and {high:g}"
    if relation == "exists":
        return "finite" if bound else "nan"
    return f"{relation} {bound:g}"
