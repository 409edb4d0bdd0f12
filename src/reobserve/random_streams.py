"""Named random streams: the same name gives the same numbers, whatever else is drawn."""

from __future__ import annotations

import hashlib

import numpy as np

from reobserve.errors import InputError


def random_stream(seed: int, *names: str) -> np.random.Generator:
    """A generator that depends on the run-wide seed and on the stream's names only.

    Raises
    ------
    InputError
        If a name holds a slash, which keeps the names apart.
    """
    for name in names:
        if "/" in name:
            raise InputError("stream", f"the name {name!r} must not hold a slash")
    spelled = hashlib.sha256("/".join(names).encode()).digest()
    words = np.frombuffer(spelled[:16], dtype="<u4")
    return np.random.Generator(np.random.PCG64(np.random.SeedSequence([seed, *words.tolist()])))
