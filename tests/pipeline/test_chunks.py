"""Chunks of draws: which there are, and which each waits for."""

from __future__ import annotations

from itertools import pairwise

import pytest

from reobserve.errors import InputError
from reobserve.pipeline.chunks import chunks_of, earlier, numbers_of


@pytest.mark.parametrize(("draws", "chunks"), [(10_000, 200), (10, 4), (1, 1), (3, 7), (40, 40)])
def test_chunks_cover_the_draws_without_gaps_or_overlap(draws: int, chunks: int) -> None:
    ranges = [numbers_of(name) for name in chunks_of(draws, chunks)]
    assert len(ranges) <= chunks
    assert ranges[0].start == 0
    assert draws <= ranges[-1].stop < draws + len(ranges[0])
    assert all(one.stop == other.start for one, other in pairwise(ranges))


def test_more_draws_in_as_many_more_chunks_leave_those_that_are_there() -> None:
    few, many = chunks_of(1000, 20), chunks_of(10_000, 200)
    assert many[:20] == few
    assert few[1] == "50-99"


def test_chunks_come_in_waves_that_double() -> None:
    names = chunks_of(90, 9)
    waits = [len(list(earlier(name))) for name in names]
    assert waits == [0, 1, 1, 3, 3, 3, 3, 7, 7]
    for name, wait in zip(names, waits, strict=True):
        assert list(earlier(name)) == names[:wait]


@pytest.mark.parametrize("name", ["", "5", "5-4", "-1-4", "a-b", "1-2-3", "٣-٤", "0-" + "9" * 30])
def test_what_is_no_chunk_is_told(name: str) -> None:
    with pytest.raises(InputError, match="must be two rising numbers, as 50-99"):
        numbers_of(name)
