"""Restrictions of an alternative to some samples: a narrower range, or other weights."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from fnmatch import fnmatchcase
from typing import Any

from reobserve.core.errors import InputError, nearest, shown
from reobserve_papers.claims.choices import Knob
from reobserve_papers.claims.conventions import SingleAlternative
from reobserve_papers.claims.labels import spelt
from reobserve_papers.claims.registry import Claim, Registry
from reobserve_papers.parameters.config import refuse_unknown
from reobserve_papers.signals.random_streams import random_stream

# Which samples count: by the values that were chosen, and the number of the sample.
Keep = Callable[[Mapping[str, Any], int], bool]


def kept_by(registry: Registry, single: SingleAlternative, seed: int) -> dict[str, Keep]:
    """Return tests of the samples that an alternative keeps, by claim.

    ``seed`` is the root of random streams.
    """
    if single.ranges or single.weights:
        _check_limits(registry, single)
    keep: dict[str, Keep] = {}
    for claim in _about(registry, single):
        tests = []
        for knob in _knobs(claim):
            if (listed := _of_key(knob, single.ranges)) is not None:
                tests.append(_within(knob, listed))
            if (weights := _of_key(knob, single.weights)) is not None:
                tests.append(_weighed(knob, weights, seed))
        if tests:
            keep[claim.name] = _all(tests)
    return keep


def narrower(claim: Claim) -> Iterator[tuple[str, str, Keep]]:
    """Yield both halves of ranges of what a claim depends on, and each word left out.

    Each is a name, a sentence and the test of a sample.
    """
    for knob in _knobs(claim):
        label = claim.label(knob.name)
        for word in knob.words:
            said = f"If {label} is not {label.readings.get(spelt(word), word)}."
            yield f"{claim.name}: {knob.name} not {spelt(word)}", said, _not(knob, word)
        if not knob.words:
            for half, upper in (("lower", False), ("upper", True)):
                said = f"If {label} is in the {half} half of its range."
                yield f"{claim.name}: {knob.name}, {half} half", said, _half(knob, upper)


def _about(registry: Registry, single: SingleAlternative) -> list[Claim]:
    names = [claim.name for claim in registry.claims]
    refuse_unknown("only", single.only, names)
    return [claim for claim in registry.claims if not single.only or claim.name in single.only]


def _knobs(claim: Claim) -> list[Knob]:
    return [knob for choice in claim.choices for knob in choice.knobs]


def _check_limits(registry: Registry, single: SingleAlternative) -> None:
    knobs = [knob for claim in _about(registry, single) for knob in _knobs(claim)]
    for section, limits in (("ranges", single.ranges), ("weights", single.weights)):
        for key, listed in limits.items():
            matching = [knob for knob in knobs if _matches(key, knob)]
            if not matching:
                known = dict.fromkeys(knob.name for knob in knobs)
                raise InputError(section, f"no claim depends on {shown(key)}{nearest(key, known)}")
            for knob in matching:
                _check_limit(f"{section}.{key}", knob, listed)
    keys = [*single.ranges, *single.weights]
    for claim in _about(registry, single) if single.only else ():
        if not any(_matches(key, knob) for key in keys for knob in _knobs(claim)):
            raise InputError("only", f"{claim.name} depends on none of {', '.join(keys)}")


def _check_limit(place: str, knob: Knob, listed: Any) -> None:
    """Refuse a range or weights that a choice cannot have."""
    if knob.words:
        words = list(map(spelt, knob.words))
        refuse_unknown(place, map(spelt, listed), words)
    elif isinstance(listed, Mapping):
        raise InputError(place, "is a choice of numbers, which have ranges and no weights")
    elif not (
        len(listed) == 2
        and all(isinstance(end, int | float) and not isinstance(end, bool) for end in listed)
        and listed[0] <= listed[1]
    ):
        raise InputError(place, f"{shown(listed)} must be two numbers, the lower one first")
    elif listed[1] < knob.span[0] or listed[0] > knob.span[1]:
        low, high = map(spelt, knob.span)
        raise InputError(place, f"{shown(listed)} has no sample of {knob.name}, {low} to {high}")


def _matches(key: str, knob: Knob) -> bool:
    return key == knob.name or any(
        fnmatchcase(".".join((entry, *map(str, knob.path))), key) or fnmatchcase(entry, key)
        for entry in knob.keys
    )


def _of_key(knob: Knob, listed: Mapping[str, Any]) -> Any:
    return next((value for key, value in listed.items() if _matches(key, knob)), None)


def _within(knob: Knob, listed: Sequence[Any]) -> Keep:
    words = set(map(spelt, listed))

    def keep(values: Mapping[str, Any], _: int) -> bool:
        value = values[knob.name]
        return spelt(value) in words if knob.words else bool(listed[0] <= value <= listed[1])

    return keep


def _weighed(knob: Knob, weights: Mapping[str, float], seed: int) -> Keep:
    def keep(values: Mapping[str, Any], number: int) -> bool:
        stream = random_stream(seed, "weights", knob.name, str(number))
        return bool(stream.random() < weights.get(spelt(values[knob.name]), 1.0))

    return keep


def _not(knob: Knob, word: Any) -> Keep:
    return lambda values, _: bool(values[knob.name] != word)


def _half(knob: Knob, upper: bool) -> Keep:
    return lambda values, _: (knob.place(values[knob.name]) > 0.5) == upper


def _all(tests: Sequence[Keep]) -> Keep:
    return lambda values, number: all(test(values, number) for test in tests)
