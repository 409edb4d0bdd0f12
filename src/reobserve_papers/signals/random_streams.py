"""Named random streams: the same name gives the same numbers, whatever else is drawn."""

from __future__ import annotations

import hashlib

import numpy as np
from numpy.typing import NDArray

from reobserve.core.arguments import MOST_STEPS, as_kind, as_whole
from reobserve.core.errors import InputError


def random_stream(seed: int, *names: str) -> np.random.Generator:
    """A generator that depends on the run-wide seed and on the stream's names only.

    Raises
    ------
    InputError
        If the seed is not a whole number, 0 or more, or a name is no text or holds a slash, which
        keeps the names apart.
    """
    seed = as_whole("seed", seed, 0, 2**128)
    for name in names:
        if "/" in as_kind("stream", name, str):
            raise InputError("stream", f"the name {name!r} must not hold a slash")
    spelled = hashlib.sha256("/".join(names).encode()).digest()
    words = np.frombuffer(spelled[:16], dtype="<u4")
    return np.random.Generator(np.random.PCG64(np.random.SeedSequence([seed, *words.tolist()])))


def held_normal(
    stream: np.random.Generator, samples: int, hold: int, columns: int | None = None
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Unit normal noise, drawn again every ``hold`` samples: values and their limits from the left.

    Both have shape (samples,), or (samples, columns).

    Raises
    ------
    InputError
        If ``samples``, ``hold`` or ``columns`` is not a whole number, the first is below 0, another
        is below 1, or more than `MOST_STEPS` numbers would be drawn.
    """
    samples, hold = as_whole("samples", samples, 0, MOST_STEPS), as_whole("hold", hold, 1)
    hold = min(hold, samples + 1)  # a longer one is the same, and need not be an index
    count = samples // hold + 1
    if columns is not None:
        columns = as_whole("columns", columns, 1, MOST_STEPS // count)
    drawn = stream.standard_normal(count if columns is None else (count, columns))
    index = np.arange(samples)
    return drawn[index // hold], drawn[np.maximum(index - 1, 0) // hold]
