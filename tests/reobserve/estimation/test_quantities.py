"""Units of a specification: valid texts and their conversions."""

from __future__ import annotations

import pytest

from reobserve.core.errors import InputError
from reobserve.estimation.quantities import check_unit

SIXTY = "*".join(["m"] * 29) + "*mm"


def test_unit_has_at_most_sixty_characters() -> None:
    assert len(SIXTY) == 60
    check_unit("unit", SIXTY)
    with pytest.raises(InputError, match=r"^unit: .* is no unit that is known"):
        check_unit("unit", f"m{SIXTY}")


@pytest.mark.parametrize("text", ["", " V", "V ", "V\n", "2", "1.0", "volts per", "rad/", "m\0"])
def test_invalid_unit_is_refused(text: str) -> None:
    with pytest.raises(InputError, match=r"^columns\.time: .* is no unit that is known"):
        check_unit("columns.time", text)


@pytest.mark.parametrize("text", ["dB", "dBm", "Np"])
def test_logarithmic_unit_is_refused(text: str) -> None:
    with pytest.raises(InputError, match="counts by a logarithm"):
        check_unit("unit", text)
