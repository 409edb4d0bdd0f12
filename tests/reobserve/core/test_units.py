"""Valid and invalid texts of units."""

from __future__ import annotations

import subprocess
import sys

import pytest

from reobserve.core.errors import InputError
from reobserve.core.units import check_unit, readings, same

SIXTY = "*".join(["m"] * 29) + "*mm"


def test_unit_has_at_most_sixty_characters() -> None:
    assert len(SIXTY) == 60
    check_unit("unit", SIXTY)
    with pytest.raises(InputError, match=r"^unit: .* is no unit that is known"):
        check_unit("unit", f"m{SIXTY}")


@pytest.mark.parametrize("text", ["bar(g)", "a.u.", "c", "LSB", "%RH"])
def test_what_only_looks_like_a_unit_is_refused(text: str) -> None:
    with pytest.raises(InputError, match="is no unit that is known"):
        check_unit("unit", text)


@pytest.mark.parametrize("text", ["", " V", "V ", "V\n", "2", "1.0", "volts per", "rad/", "m\0"])
def test_invalid_unit_is_refused(text: str) -> None:
    with pytest.raises(InputError, match=r"^columns\.time: .* is no unit that is known"):
        check_unit("columns.time", text)


@pytest.mark.parametrize("text", ["dB", "dBm", "Np"])
def test_logarithmic_unit_is_refused(text: str) -> None:
    with pytest.raises(InputError, match="counts by a logarithm"):
        check_unit("unit", text)


@pytest.mark.parametrize(
    "text",
    [
        "9**9**9**9 rad/s",
        "rad/s^9^9^9",
        "((9**99)**99)**99 m",
        "9⁹⁹⁹⁹⁹⁹⁹⁹⁹ m",
        "m**(9**9**9)",
        "9**(9)(9)(9)**9**9 m",
        "9**9_999_999_9 m",
        "2**9.9**99 m",
        "9**99999999 m",
    ],
)
def test_unit_of_endless_powers_is_refused_at_once(text: str) -> None:
    with pytest.raises(InputError, match="is no unit that is known"):
        check_unit("unit", text)


@pytest.mark.parametrize(
    "text",
    [
        "m²",
        "kg·m²/s³",
        "s⁻¹",
        "rad / s ** 2",
        "(m/s)^2",
        "V/Hz**0.5",
        "V/Hz**(1/2)",
        "m**-2 * s**+2",
    ],
)
def test_unit_with_powers_is_known(text: str) -> None:
    check_unit("unit", text)


@pytest.mark.parametrize(
    ("one", "others", "unlike"),
    [
        ("N m s/rad", "N m s, kg m^2/s, Nms, rad^-1*s*m*N", "N m, mN m s, N mm s/deg, kg"),
        ("rad/s", "s^-1 rad, radian per second, (rad/s)", "1/s, Hz, rpm, deg/s, rad, mrad/s"),
        ("1/s", "Hz, s^-1, 1/sec", "rad/s, kHz, 1/min, s, rpm"),
        ("1", "rad, dimensionless", "%, deg, turn, dB, s, furlongs per"),
        ("°C", "degC, celsius", "K, °F, mK"),
        ("Ω", "ohm, V/A", "kΩ, S"),
        ("kg", "N s^2/m", "g, Mg"),
    ],
)
def test_same_units_agree_in_dimension_size_and_zero(one: str, others: str, unlike: str) -> None:
    found = {other: (same(one, other), same(other, one)) for other in others.split(", ")}
    assert found == dict.fromkeys(found, (True, True))
    found = {other: (same(one, other), same(other, one)) for other in unlike.split(", ")}
    assert found == dict.fromkeys(found, (False, False))


def test_common_units_are_known_without_pint() -> None:
    code = (
        "import sys; sys.modules['pint'] = None\n"
        "from reobserve.core.units import check_unit, is_unit\n"
        "check_unit('unit', 'N m s/rad'); assert is_unit('rad/s, y')\n"
        "try: check_unit('unit', 'mbar')\n"
        "except ImportError as error: assert 'reobserve[data]' in str(error)\n"
        "else: raise SystemExit(1)\n"
    )
    subprocess.run([sys.executable, "-c", code], check=True)


@pytest.mark.parametrize("name", ["L1", "L2", "L3", "l2", "R1", "V1", "A1", "C1", "m1", "N1"])
def test_numbered_phases_and_parts_are_no_units(name: str) -> None:
    """Nor are their titles, as I (L1)."""
    assert not readings(name)
    assert readings(name[0])
