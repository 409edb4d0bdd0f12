"""What observers and their states are as Python objects."""

from __future__ import annotations

from dataclasses import fields

from reobserve.core.errors import shown

_FIELD = 60  # letters


class Value:
    """Of a frozen dataclass: fits a screen when shown, and equals nothing but itself.

    Whether two hold the same numbers is asked of their arrays: a comparison of all of them would
    be an array, and a model's functions cannot be compared.
    """

    def __repr__(self) -> str:
        said = (
            f"{field.name}={shown(getattr(self, field.name), _FIELD)}"
            for field in fields(self)  # type: ignore[arg-type]
            if field.repr
        )
        return f"{type(self).__name__}({', '.join(said)})"
