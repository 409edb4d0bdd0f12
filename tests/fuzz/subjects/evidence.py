"""What every part uses: matrices, random streams, metrics."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from reobserve.numerics.matrices import (
    as_floats,
    as_matrix,
    as_positive,
    as_positive_definite,
    as_scalar,
    as_vector,
)
from reobserve.numerics.random_streams import held_normal, random_stream

from .subject import Subject, subject


def subjects() -> Iterator[Subject]:
    """Calls that must be accepted; names are the library's own, so they are not changed."""
    three = np.array([1.0, 2.0, 3.0])
    checks = {
        as_floats: (three,), as_scalar: (1.0,), as_positive: (1.0,), as_vector: (three,),
        as_matrix: (np.eye(3),), as_positive_definite: (np.eye(3),),
    }  # fmt: skip
    for check, values in checks.items():
        sized = check in (as_vector, as_matrix, as_positive_definite)

        def call(value: object, check: object = check, sized: bool = sized) -> object:
            return check("x", value, 3) if sized else check("x", value)  # type: ignore[operator]

        yield Subject(f"matrices.{check.__name__}", call, values)
    yield subject(random_stream, 3, "noise")

    def held(samples: object, hold: object, columns: object) -> object:
        return held_normal(random_stream(1), samples, hold, columns)  # type: ignore[arg-type]

    yield Subject("random_streams.held_normal", held, (20, 2, 3))
