"""Kinds of fault, each closed by a test that draws its members; cases once seen are examples.

`make test` draws the same few of each kind every time. A nightly workflow draws many with
`--hypothesis-profile=thorough` and the date as seed, which `--hypothesis-seed` repeats.
"""

from __future__ import annotations

from hypothesis import Phase, settings
from hypothesis.internal.conjecture.providers import AVAILABLE_PROVIDERS, HypothesisProvider


class Fresh(HypothesisProvider):
    """Draws all examples independently, where hypothesis repeats parts of each in five more."""


AVAILABLE_PROVIDERS["fresh"] = f"{__name__}.Fresh"


def times(factor: float) -> settings:
    """Settings with ``factor`` times the examples of the profile, at least one."""
    count = max(1, int(factor * settings().max_examples))
    phases = settings().phases if factor > 1 else [Phase.explicit, Phase.generate]  # those are long
    return settings(max_examples=count, phases=phases, backend="fresh")
