"""Random streams by name, and noise that is held."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from reobserve.core.errors import InputError
from reobserve_papers.signals.random_streams import held_normal, random_stream


def test_random_stream_depends_only_on_seed_and_names() -> None:
    first = random_stream(7, "ilo", "rate noise").standard_normal(100)
    random_stream(7, "ilo", "start").standard_normal(1000)  # other streams may be used in between
    again = random_stream(7, "ilo", "rate noise")
    assert np.array_equal(again.standard_normal(40), first[:40])
    assert np.array_equal(again.standard_normal(60), first[40:])


def test_streams_of_different_names_are_uncorrelated() -> None:
    keys = [(7, "ilo", "noise"), (7, "ilo", "start"), (8, "ilo", "noise"), (7, "other", "noise")]
    drawn = np.array([random_stream(*key).standard_normal(4000) for key in keys])
    correlation = np.corrcoef(drawn) - np.eye(len(keys))
    assert np.abs(correlation).max() < 5 / np.sqrt(4000)  # five standard deviations
    assert drawn.std(axis=1) == pytest.approx(1, abs=5 / np.sqrt(8000))


def test_streams_of_differently_split_names_differ() -> None:
    """The slash separates ("a", "bc") and ("ab", "c"), so no name may contain one."""
    drawn = [random_stream(7, *names).random() for names in (("a", "bc"), ("ab", "c"), ("abc",))]
    assert len(set(drawn)) == 3
    with pytest.raises(InputError, match=r"^stream: the name 'a/b' must not hold a slash$"):
        random_stream(7, "a/b", "c")


@pytest.mark.parametrize(("samples", "hold"), [(7, 3), (6, 3), (1, 4), (5, 1)])
def test_held_noise_changes_at_the_stated_interval(samples: int, hold: int) -> None:
    """The left limit changes one sample later; in order, no number is used twice."""
    drawn = random_stream(7, "noise").standard_normal(samples)
    values, before = held_normal(random_stream(7, "noise"), samples, hold)
    assert values.tolist() == [drawn[k // hold] for k in range(samples)]
    assert before.tolist() == [drawn[max(k - 1, 0) // hold] for k in range(samples)]


@pytest.mark.parametrize("argument", ["samples", "hold", "columns"])
@given(st.integers(max_value=-1) | st.integers(min_value=2**40))
def test_noise_that_no_memory_holds_is_refused(argument: str, size: int) -> None:
    sizes = {"samples": 20, "hold": 2, "columns": 3, argument: size}
    with pytest.raises(InputError, match=f"^{argument}: .* must be a whole number"):
        held_normal(random_stream(7), **sizes)
