"""Conversion of arguments to numbers; other array types trigger no recompilation."""

from __future__ import annotations

from typing import Any

import numpy as np
import pandas as pd
import pytest

from reobserve.core.covariances import as_positive_definite
from reobserve.core.discretisation import zero_order_hold
from reobserve.core.errors import InputError, shown
from reobserve.core.matrices import as_floats, as_matrix, as_numbers, as_row, as_rows, as_samples
from reobserve.core.vector_field import vector_field
from reobserve.observers.kalman import KalmanFilter, run_linear
from reobserve.systems.linear import LinearModel

ROWS = np.array([[1.0, 2.0], [3.0, 4.0], [5.0, 6.0]])
READ_ONLY = ROWS.copy()
READ_ONLY.flags.writeable = False
PLAIN = LinearModel([[0.9, 0.1], [0.0, 0.8]], [[0.0], [1.0]], [[1.0, 0.0]], Q=0.1, R=0.2)


class Odd:
    def __array__(self, *_: Any, **__: Any) -> Any:
        raise RuntimeError


NUMBERS = {
    "lists": ROWS.tolist(),
    "tuples": tuple(map(tuple, ROWS.tolist())),
    "read-only": READ_ONLY,
    "32 bits": ROWS.astype(np.float32),
    "whole numbers": ROWS.astype(np.int16),
    "other bytes": ROWS.astype(">f8"),
    "Fortran": np.asfortranarray(ROWS),
    "a part": np.repeat(ROWS, 2, axis=0)[::2],
    "a frame": pd.DataFrame(ROWS),
    "unmasked": np.ma.masked_array(ROWS, False),
}


@pytest.mark.parametrize("kind", NUMBERS)
def test_array_likes_are_converted_for_compiled_loops(kind: str) -> None:
    found = as_numbers("x", NUMBERS[kind])
    assert np.array_equal(found, ROWS)
    assert type(found) is np.ndarray
    assert found.dtype == np.float64
    assert found.dtype.isnative
    assert found.flags.c_contiguous
    assert found.flags.writeable


def test_valid_record_is_not_copied_but_a_parameter_is() -> None:
    assert as_numbers("x", ROWS) is ROWS
    assert not np.shares_memory(as_floats("x", ROWS), ROWS)


OTHERS = {
    "masked": np.ma.masked_array(ROWS, ROWS > 5),
    "text": [["1", "2"]],
    "text among numbers": [[1.0, "2"]],
    "a number as text": "1.5",
    "bytes": b"12",
    "booleans": np.array([[True, False]]),
    "a boolean among numbers": [[1.0, True]],
    "complex": ROWS * 1j,
    "objects": ROWS.astype(object),
    "none": [[1.0, None]],
    "masked in a list": [np.ma.masked_array([1.0, 2.0], [True, False]), [1.0, 2.0]],
    "dates": np.array([["2020", "2021"]], dtype="datetime64"),
    "ragged": [[1.0, 2.0], [3.0]],
    "a long whole number": [[10**400, 1]],
    "a dictionary": {"x": 1.0},
    "a function": abs,
    "what fails": Odd(),
}


@pytest.mark.parametrize("kind", OTHERS)
def test_non_numeric_array_is_refused(kind: str) -> None:
    with pytest.raises(
        InputError, match=r"^x: .+ is not a number or an array of numbers$"
    ) as reported:
        as_floats("x", OTHERS[kind])
    assert len(str(reported.value)) < 200
    with pytest.raises(InputError, match=r"^x: is no array of numbers"):
        as_samples("x", OTHERS[kind], 2)


EMPTY = np.empty((0, 0))
REFUSED: list[tuple[Any, str]] = [
    (lambda: as_samples("x", [[1.0], [2.0]], None), "has shape (2, 1), must be a list of 1 sample"),
    (lambda: as_samples("x", [1.0, 2.0], 1), "has shape (2,), must have one row or more of 1 numb"),
    (lambda: as_samples("x", np.empty((0, 2)), 2), "has shape (0, 2), must have one row or more"),
    (lambda: as_samples("x", ROWS, 2, rows=4, like="y"), "has 3 rows, must have 4 like y"),
    (lambda: as_samples("x", [[1.0, np.nan]], 2), "sample 0 is [1.0, nan], must be finite"),
    (lambda: as_samples("x", [[np.inf, np.nan]], 2, missing=True), "sample 0 is [inf, nan], must"),
    (lambda: as_rows("x", [1.0, 2.0]), "has shape (2,), must be (samples, n)"),
    (lambda: as_rows("x", ROWS, ROWS[:2]), "has shape (3, 2), must be (2, 2)"),
    (lambda: as_row("x", "text"), "'text' is no array of numbers"),
    (lambda: as_matrix("x", ROWS, 2), "has shape (3, 2), must be one number"),
    (lambda: as_positive_definite("x", EMPTY, 0), "is empty, must have one row or more"),
    (lambda: as_positive_definite("x", [[1.0, 2.0], [0.0, 1.0]], 2), "[[1.0, 2.0], [0.0, 1.0]] mu"),
    (lambda: as_positive_definite("x", -1.0, 2), "must be positive definite, its eigenvalues are"),
]


@pytest.mark.parametrize(("call", "said"), REFUSED)
def test_arrays_of_wrong_shape_are_refused(call: Any, said: str) -> None:
    with pytest.raises(InputError) as reported:
        call()
    assert reported.value.parameter == "x"
    assert reported.value.problem.startswith(said)


def test_invalid_hold_period_is_refused() -> None:
    with pytest.raises(InputError, match=r"^period: "):
        zero_order_hold([[1e3]], [[1.0]], 1.0)


def test_messages_are_short_for_any_argument() -> None:
    for value in (
        np.zeros(10**6),
        "x" * 10**6,
        list(range(10**5)),
        10**5000,
        {i: i for i in range(999)},
    ):
        assert len(shown(value)) <= 120
    assert len(str(InputError("x", "y" * 10**6 + "\nz"))) < 900
    assert "\n" not in str(InputError("x", "y\nz"))


def test_record_types_do_not_affect_compilation_or_bits() -> None:
    kalman = KalmanFilter(PLAIN)
    start = kalman.init([0, 0], 1)
    z, u = np.arange(12.0)[:, None] % 5, np.ones((12, 1))
    wanted = kalman.run(z, u, start=start)["state"]
    compiled = len(run_linear.signatures)  # type: ignore[attr-defined]
    frozen = z.copy()
    frozen.flags.writeable = False
    for other in (frozen, z.tolist(), z.astype(np.float32), z.astype(int), pd.DataFrame(z)):
        assert np.array_equal(kalman.run(other, u.tolist(), start=start)["state"], wanted)
    assert len(run_linear.signatures) == compiled  # type: ignore[attr-defined]


def test_compilation_failure_quotes_the_compiler() -> None:
    with pytest.raises(InputError, match=r"<lambda> cannot be compiled: Failed in nopython mode"):
        vector_field(lambda x, p, f: open("y", encoding="utf-8"))  # noqa: SIM115
    with pytest.raises(InputError, match=r"^function: 3 must be"):
        vector_field(3)  # type: ignore[arg-type]


def test_array_beyond_memory_is_reported_with_its_shape() -> None:
    large = np.broadcast_to(0.0, (10**6, 10**6))
    with pytest.raises(InputError, match=r"^x: of shape \(1000000, 1000000\) is too large"):
        as_numbers("x", large)


def test_unknown_estimate_name_is_refused() -> None:
    kalman = KalmanFilter(PLAIN)
    run = kalman.run([[1.0]], [[0.0]], start=kalman.init([0.0, 0.0], 1.0))
    for name in ("sate", 0, [1], None):
        with pytest.raises(InputError, match=r"^estimate: there is no .+"):
            run[name]  # type: ignore[index]
