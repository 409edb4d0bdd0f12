"""Checks of numbers and matrices, each at its limit and just beyond."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from reobserve.core.covariances import as_covariance, as_positive_definite
from reobserve.core.errors import InputError
from reobserve.core.matrices import (
    all_finite,
    as_floats,
    as_matrix,
    as_numbers,
    as_positive,
    as_probabilities,
    as_row_stochastic,
    as_rows,
    as_sample_rows,
    as_samples,
    as_scalar,
    as_vector,
    spectral_radius,
)

EVEN = np.ones((4, 2))
ACCEPTED: list[tuple[Callable[..., Any], tuple[Any, ...], dict[str, Any], Any]] = [
    (as_scalar, (2,), {}, 2.0),
    (as_positive, (5e-324,), {}, 5e-324),
    (as_vector, ([1, 2], 2), {}, [1.0, 2.0]),
    (as_probabilities, ([0.0, 1.0], 2), {}, [0.0, 1.0]),
    (as_probabilities, ([0.5, 0.5 + 9e-10], 2), {}, [0.5, 0.5 + 9e-10]),
    (as_row_stochastic, ([[0.2, 0.8], [1.0, 0.0]], 2), {}, [[0.2, 0.8], [1.0, 0.0]]),
    (as_matrix, (3, 2), {}, [[3.0, 0.0], [0.0, 3.0]]),
    (as_matrix, ([1, 2], 2), {}, [[1.0, 0.0], [0.0, 2.0]]),
    (as_covariance, ([[1.0, 0.5], [0.5 + 0.9e-12, 1.0]], 2), {},
     [[1.0, 0.5 + 0.45e-12], [0.5 + 0.45e-12, 1.0]]),
    (as_covariance, ([[1e308, 1e308], [1e308 * (1 + 4e-16), 1e308]], 2), {},
     [[1e308, 1e308], [1e308, 1e308]]),
    (as_covariance, ([[1.0, 1.0 - 1e-15], [1.0 - 1e-15, 1.0]], 2), {"definite": True},
     [[1.0, 1.0], [1.0, 1.0]]),
    (as_positive_definite, ([[1.0, 0.999], [0.999, 1.0]], 2), {}, [[1.0, 0.999], [0.999, 1.0]]),
    (as_samples, (EVEN, 2), {}, EVEN),
    (as_samples, ([1.0], None), {}, [1.0]),
    (as_samples, (EVEN, 2), {"rows": 4, "like": "y"}, EVEN),
    (as_sample_rows, ([1, 2, 3], 1), {}, [[1.0], [2.0], [3.0]]),
    (as_sample_rows, (EVEN, 2), {}, EVEN),
    (as_rows, (EVEN,), {}, EVEN),
    (spectral_radius, (np.array([[0.0, 2.0], [-2.0, 0.0]]),), {}, 2.0),
]  # fmt: skip


@pytest.mark.parametrize(("check", "arguments", "options", "wanted"), ACCEPTED)
def test_value_at_the_limit_is_accepted(
    check: Callable[..., Any], arguments: tuple[Any, ...], options: dict[str, Any], wanted: Any
) -> None:
    named = arguments if check in (spectral_radius, all_finite) else ("it", *arguments)
    assert check(*named, **options) == pytest.approx(np.array(wanted), rel=1e-15)


REFUSED: list[tuple[Callable[..., Any], tuple[Any, ...], dict[str, Any], str]] = [
    (as_numbers, (True,), {}, "True is not a number or an array"),
    (as_numbers, ([1, [2]],), {}, r"\[1, \[2\]\] is not a number or an array"),
    (as_numbers, (1j,), {}, "1j is not a number or an array"),
    (as_floats, ([1.0, np.inf],), {}, r"\[1.0, inf\] has an entry that is not finite"),
    (as_scalar, ([1.0],), {}, r"must be one number, not an array of shape \(1,\)"),
    (as_positive, (0.0,), {}, "0 must be greater than zero"),
    (as_vector, ([1, 2], 1), {}, r"has shape \(2,\), must be a list of 1 number$"),
    (as_vector, ([1, 2], 3), {}, r"has shape \(2,\), must be a list of 3 numbers$"),
    (as_probabilities, ([-1e-15, 1.0], 2), {}, "must be 0 or more and sum to 1, not 1"),
    (as_probabilities, ([0.5, 0.5 + 2e-9], 2), {}, "must be 0 or more and sum to 1"),
    (as_row_stochastic, ([[1.0, 0.0], [0.6, 0.5]], 2), {}, r"it\[1\]: \[0.6, 0.5\] must be"),
    (as_row_stochastic, (np.eye(3), 2), {}, r"has shape \(3, 3\), must be \(2, 2\)"),
    (as_matrix, ([1, 2, 3], 2), {}, r"has shape \(3,\), must be one number"),
    (as_covariance, ([[1.0, 1.0], [1.0 + 2e-12, 1.0]], 2), {}, "must be symmetric"),
    (as_covariance, ([[1.0, 1.0 - 3e-16], [1.0 - 3e-16, 1.0]], 2), {"definite": True}, "definite"),
    (as_covariance, (-np.eye(10), 10), {}, "semidefinite, its eigenvalues are from -1 to -1$"),
    (as_positive_definite, ([[1.0, 1.0], [1.0, 1.0]], 2), {}, "must be positive definite, its"),
    (as_positive_definite, (np.zeros((0, 0)), 0), {}, "is empty, must have one row or more"),
    (as_samples, (np.ones((0, 2)), 2), {}, "must have one row or more of 2 numbers$"),
    (as_samples, (np.ones((2, 1)), 2), {}, "must have one row or more of 2 numbers$"),
    (as_samples, (EVEN, 1), {}, "must have one row or more of 1 number$"),
    (as_samples, (EVEN, None), {}, "must be a list of 1 sample or more"),
    (as_samples, (EVEN, 2), {"rows": 3, "like": "y"}, "has 4 rows, must have 3 like y"),
    (as_samples, ([1.0, np.nan, np.inf], None), {}, "sample 1 is nan, must be finite$"),
    (as_samples, ([1.0, np.nan, np.inf], None), {"missing": True}, "sample 2 is inf, must be fin"),
    (as_rows, (EVEN, np.ones((3, 2))), {}, r"has shape \(4, 2\), must be \(3, 2\)"),
]  # fmt: skip


@pytest.mark.parametrize(("check", "arguments", "options", "said"), REFUSED)
def test_value_beyond_the_limit_is_refused(
    check: Callable[..., Any], arguments: tuple[Any, ...], options: dict[str, Any], said: str
) -> None:
    with pytest.raises(InputError, match=said):
        check("it", *arguments, **options)


@pytest.mark.parametrize("size", [1, 24, 25, 100])
def test_any_entry_that_is_not_finite_is_found(size: int) -> None:
    """Few entries are looked at by another way than many."""
    assert all_finite(np.ones(size))
    for place in (0, size - 1):
        for value in (np.nan, np.inf, -np.inf):
            array = np.ones(size)
            array[place] = value
            assert not all_finite(array)


def test_array_is_handed_back_only_if_loops_can_take_it() -> None:
    whole = np.ones((3, 2))
    assert as_numbers("it", whole) is whole
    assert as_floats("it", whole) is not whole
    for other in (whole.T, whole[::2], whole.astype(np.float32), whole.astype(">f8"), [[1.0, 2.0]]):
        found = as_numbers("it", other)
        assert found.flags.carray
        assert found.dtype == np.float64
        assert np.array_equal(found, other)
    whole.flags.writeable = False
    assert as_numbers("it", whole) is not whole
    assert as_numbers("it", whole, writable=False) is whole
