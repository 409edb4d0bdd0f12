"""Kinds of fault, each closed by a test that draws its members; cases once seen are examples.

`make test` draws the same few of each kind every time. A nightly workflow draws many with
`--hypothesis-profile=thorough` and the date as seed, which `--hypothesis-seed` repeats.
"""

from __future__ import annotations

from hypothesis import Phase, settings


def fewer(divisor: int) -> settings:
    """Settings with a part of the examples of the profile, at least one, where each is long."""
    phases = [Phase.explicit, Phase.generate]
    return settings(max_examples=max(1, settings().max_examples // divisor), phases=phases)
