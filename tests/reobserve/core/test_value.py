"""Field conversion, and the repr of values."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
import pytest

from reobserve.core.errors import InputError
from reobserve.core.matrices import as_matrix, as_positive
from reobserve.core.value import Value, converter, represented
from reobserve.systems.linear import LinearModel
from reobserve.systems.rigid_body import RigidBody


@dataclass(frozen=True, eq=False, repr=False)
class Base(Value):
    period: float = field(kw_only=True, metadata=converter(as_positive))


@dataclass(frozen=True, eq=False, repr=False)
class Derived(Base):
    gain: Any = field(metadata=converter(as_matrix, 2))
    note: str = "none"


def test_fields_are_converted_by_class_and_base_class() -> None:
    made = Derived(3, period=np.float64(2))
    assert np.array_equal(made.gain, 3.0 * np.eye(2))
    assert type(made.period) is float
    with pytest.raises(InputError, match=r"^period: -1 must be greater than zero$"):
        Derived(3, period=-1)
    with pytest.raises(InputError, match=r"^gain: has shape \(3,\)"):
        Derived([1.0, 2.0, 3.0], period=1)


def test_keyword_fields_come_last_in_a_repr() -> None:
    assert repr(Derived([1.0, 2.5], period=0.1)) == (
        "Derived(gain=diag(1, 2.5), note='none', period=0.1)"
    )


def test_models_show_their_numbers() -> None:
    body = RigidBody([[36.0, 1.5, 0.0], [1.5, 17.0, 0.0], [0.0, 0.0, 26.0]])
    assert repr(body) == (
        "RigidBody(inertia=[[36, 1.5, 0], [1.5, 17, 0], [0, 0, 26]], "
        "input_matrix=diag(1, 1, 1), fault_matrix=diag(1, 1, 1))"
    )
    model = LinearModel([[0.5]], C=[[1.0]], Q=1.0, R=2.0, state_names=["x"])  # and names no others
    assert repr(model).endswith("check=True, state_names=('x'))")


@dataclass
class Plain:
    large: Any
    small: Any


@pytest.mark.parametrize(
    ("value", "reported"),
    [
        (np.arange(12.0), "[0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11]"),
        (np.zeros((4, 4)), "array of shape (4, 4)"),
        (np.zeros((2, 2)), "[[0, 0], [0, 0]]"),
        (np.array([[1.0]]), "[[1]]"),
        (np.array([1.0, np.nan]), "[1, nan]"),
        (np.array([1 + 2j]), "[(1+2j)]"),
        (np.array([None]), "array of shape (1,)"),
        ((0.0, 1.5), "(0, 1.5)"),
        ([None, "text"], "[None, 'text']"),
        (Plain(np.zeros(99), np.array(1 / 3)), "Plain(large=array of shape (99,), small=0.333333)"),
        (object(), "an object of type object"),
    ],
)  # fmt: skip
def test_repr_of_values(value: Any, reported: str) -> None:
    assert represented(value) == reported
