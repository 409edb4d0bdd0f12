"""How draws are cut into chunks that other processes make ahead, and which chunks wait for which.

A chunk is a range of numbers of draws, named by its ends: ``50-99``. Its size alone follows from
what is asked for, so that asking for more draws in as many more chunks leaves those that are there.

Where the draws of a claim end is decided in their order; chunks that are made at the same time
cannot know it. So they come in waves of 1, 2, 4, ... chunks, each of which reads those of all waves
before: of no claim more than about twice the draws are made that decide it, and n chunks wait for
each other log2(n) times. Which chunks one reads depends on its place only, not on how many follow.
"""

from __future__ import annotations

import re
from collections.abc import Iterator

from reobserve.errors import InputError, shown


def chunks_of(draws: int, chunks: int) -> list[str]:
    """The names of the chunks that cover so many draws, all of one size, the first ones first."""
    size = -(-draws // chunks)
    return [_name(start, size) for start in range(0, draws, size)]


def numbers_of(chunk: str) -> range:
    """The numbers of the draws in a chunk.

    Raises
    ------
    InputError
        If it is no name of a chunk.
    """
    ends = re.fullmatch(r"(\d{1,9})-(\d{1,9})", chunk, re.ASCII)
    if ends is None or int(ends[1]) > int(ends[2]):
        raise InputError("chunk", f"{shown(chunk)} must be two rising numbers, as 50-99")
    return range(int(ends[1]), int(ends[2]) + 1)


def earlier(chunk: str) -> Iterator[str]:
    """The chunks of the same size in the waves before that of a chunk."""
    numbers = numbers_of(chunk)
    size = len(numbers)
    wave = (numbers.start // size + 1).bit_length() - 1
    for place in range(2**wave - 1):
        yield _name(place * size, size)


def _name(start: int, size: int) -> str:
    return f"{start}-{start + size - 1}"
