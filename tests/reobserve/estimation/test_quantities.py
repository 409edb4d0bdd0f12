"""Conversions of the units of a specification."""

from __future__ import annotations

import contextlib
import itertools
import math

import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from reobserve.core.errors import InputError
from reobserve.core.units import check_unit, is_unit, readings
from reobserve.estimation.families.signals import check_signals, product
from reobserve.estimation.layout import find_column
from reobserve.estimation.quantities import agree, conversion
from reobserve.estimation.specification import Column

TURN = 2.0 * math.pi
# Rates of events, of which nobody says what is counted, and of angles [rad/s].
BARE = {"1/min": 1 / 60, "1/s": 1.0, "count/s": 1.0, "Hz": 1.0, "kHz": 1e3, "min^-1": 1 / 60}
ANGULAR = {
    "rpm": TURN / 60, "rev/s": TURN, "U/min": TURN / 60, "r/min": TURN / 60, "rad/s": 1.0,
    "deg/s": TURN / 360, "dps": TURN / 360, "°/s": TURN / 360, "mrad/s": 1e-3, "RPM": TURN / 60,
}  # fmt: skip


@pytest.mark.parametrize("kind", [BARE, ANGULAR])
@given(value=st.floats(-1e9, 1e9), data=st.data())
def test_rates_are_converted_there_and_back(
    kind: dict[str, float], value: float, data: st.DataObject
) -> None:
    one, other = data.draw(st.sampled_from(list(itertools.product(kind, repeat=2))))
    found = conversion("unit", one, other).of(value)
    assert found == pytest.approx(value * kind[one] / kind[other], rel=1e-12)
    assert conversion("unit", other, one).of(found) == pytest.approx(value, rel=1e-12)


@pytest.mark.parametrize("bare", BARE)
@pytest.mark.parametrize("angular", ANGULAR)
def test_rate_that_may_count_turns_or_radians_is_refused(bare: str, angular: str) -> None:
    said = "does not say whether turns or radians are counted, as rpm and rad/s do"
    for given_, wanted in ((bare, angular), (angular, bare)):
        with pytest.raises(InputError, match=said):
            conversion("unit", given_, wanted)


@pytest.mark.parametrize(
    ("one", "other"),
    [("count", "rad"), ("%", "rad"), ("deg", "1"), ("V min", "V s/rad"), ("1/s^2", "rad/s^2")],
)
def test_counts_are_no_angles(one: str, other: str) -> None:
    with pytest.raises(InputError, match="does not say whether turns or radians are counted"):
        conversion("unit", one, other)


@pytest.mark.parametrize(
    ("one", "other", "factor"),
    [
        ("Nm", "N m", 1.0), ("mNm", "N m", 1e-3), ("Nm/rad", "N m/rad", 1.0), ("1/Nm", "1/J", 1.0),
        ("Nms", "N m s", 1.0), ("Vs", "Wb", 1.0), ("As", "C", 1.0), ("kWh", "J", 3.6e6),
        ("Volt", "V", 1.0), ("mOhm", "Ω", 1e-3), ("-", "1", 1.0), ("%", "-", 0.01),
        ("MPH", "m/s", 0.44704), ("m3/h", "m^3/s", 1 / 3600), ("m/s2", "m/s^2", 1.0),
        ("m s-2", "m/s^2", 1.0), ("º/s", "deg/s", 1.0), ("N m s", "N m s/rad", 1.0),
        ("rad", "1", 1.0), ("mbar", "Pa", 100.0), ("deg/s/√Hz", "deg/√s", 1.0),
        # of two readings, the one that can be converted
        ("g", "kg", 1e-3), ("g", "m/s^2", 9.80665), ("mg", "m/s^2", 9.80665e-3), ("mg", "g", 1e-3),
        ("G", "m/s^2", 9.80665), ("G", "uT", 100.0), ("mG", "nT", 100.0), ("C", "A s", 1.0),
        ("PS", "W", 735.49875), ("W/mK", "W/(m K)", 1.0), ("mK", "K", 1e-3), ("pH", "1", 1.0),
    ],
)  # fmt: skip
def test_symbols_mean_what_engineers_mean(one: str, other: str, factor: float) -> None:
    assert conversion("unit", one, other).of(2.0) == pytest.approx(2.0 * factor, rel=1e-9)
    assert conversion("unit", other, one).of(2.0) == pytest.approx(2.0 / factor, rel=1e-9)


def test_degrees_of_two_scales_are_converted() -> None:
    for fahrenheit in ("°F", "degF", "F", "deg F"):
        assert conversion("unit", fahrenheit, "°C").of(212.0) == pytest.approx(100.0, rel=1e-9)
    assert conversion("unit", "C", "K").of(20.0) == pytest.approx(293.15)


DEGREES = ("deg", "deg.", "degs", "degree", "degrees", "Grad", "°", "º", "˚")
SCALES = {
    scale: sorted(
        {f"{degree}{between}{name}" for degree in DEGREES for between in ("", " ")
         for name in (scale[0], scale)}
        | {scale, f"°{scale[0]}", f"{scale[0]}°", f"degree_{scale}", f"deg_{scale[0]}"}
    )
    for scale in ("Celsius", "Fahrenheit", "Kelvin")
}  # fmt: skip
CASES = [str, str.lower, str.upper, str.title]


@pytest.mark.parametrize(("one", "other"), list(itertools.product(SCALES, repeat=2)))
def test_spellings_of_a_temperature_agree(one: str, other: str) -> None:
    """All pairs of them, in any case, also as a title and the stated unit."""
    want = conversion("unit", f"deg{one[0]}" if one != "Kelvin" else "K",
                      f"deg{other[0]}" if other != "Kelvin" else "K")  # fmt: skip
    spellings = [sorted({case(text) for text in SCALES[name] for case in CASES})
                 for name in (one, other)]  # fmt: skip
    firsts = {text: readings(text) for names in spellings for text in names}
    assert all(len(units) == 1 for units in firsts.values()), firsts
    assert len({units[0] for units in firsts.values()}) == len({one, other})
    for given_, wanted in zip(spellings[0], itertools.cycle(spellings[1]), strict=False):
        assert conversion("unit", given_, wanted).of(40.0) == pytest.approx(want.of(40.0))
        assert agree(given_, wanted) == (one == other)


PARTS = st.sampled_from([
    *DEGREES, *SCALES, "C", "F", "K", "delta_degC", "m", "s", "g", "G", "rpm", "Hz", "rad", "turn",
    "V", "dB", "pH", "%", "1", "2", "0", ".5", "-1", "1e9", "/", "*", "**", "^", "-", "(", ")", "[",
    "]", " ", "·", "√", "²", "⁻¹", "_", "µ", "nan", "lambda", "\n", "'", "\\", "#", ",",
])  # fmt: skip
TEXTS = st.builds(
    lambda parts, between: between.join(parts),
    st.lists(PARTS, min_size=1, max_size=6), st.sampled_from(["", " "]),
) | st.text(max_size=8)  # fmt: skip


@settings(max_examples=100)
@given(text=TEXTS, other=st.sampled_from(["degC", "K", "m", "rad/s", "1", "V"]) | TEXTS)
@example(text="Deg C", other="degC")
@example(text="degree * delta_degC", other="degC")
@example(text="% rpm", other="degC")
def test_any_text_is_a_unit_or_refused_in_a_sentence(text: str, other: str) -> None:
    for use in (
        lambda: check_unit("unit", text), lambda: conversion("unit", text, other),
        lambda: conversion("unit", other, text), lambda: check_signals("states", {"x": text}),
        lambda: Column("T", unit=text), lambda: find_column(
            "at", Column("T", unit=other if readings(other) else ""), "degC", [f"T [{text}]"], "r"
        ), lambda: agree(text, other), lambda: product(text, text) if readings(text) else "",
    ):  # fmt: skip
        with contextlib.suppress(InputError):
            use()


@pytest.mark.parametrize(
    ("one", "other", "said"),
    [
        ("Grad", "rad", "may be degree to radian or grade to radian; name the unit in full"),
        ("kg/m s", "kg s/m", r"'kg/m s' must be kg/\(m s\), or have what is not divided in front"),
        ("W/m²K", "W/(m^2 K)", "is no unit that is known"),
        ("Nm", "m", r"'Nm' cannot become 'm': .* is not \[length\]"),
    ],
)
def test_unit_of_two_meanings_is_refused(one: str, other: str, said: str) -> None:
    with pytest.raises(InputError, match=said):
        conversion("unit", one, other)


def test_stated_unit_settles_what_the_title_leaves_open() -> None:
    for title, stated in (
        ("1/min", "rpm"), ("1/min", "rad/min"), ("Hz", "rev/s"), ("Grad", "deg"), ("C", "°C"),
        ("g", "g_0"), ("LSB", "V"), ("Nm", "N m"),
    ):  # fmt: skip
        assert agree(title, stated)
    for title, stated in (("1/min", "rad/s"), ("Hz", "rpm"), ("g", "m/s^2"), ("°C", "K")):
        assert not agree(title, stated)


UNITS = (
    "um", "µm", "us", "nF", "µA", "kΩ", "mbar", "hPa", "psi", "degC", "°F", "N·m", "N*m", "kWh",
    "MW", "°/s", "m³/h", "L/min", "ppm", "G", "nT", "inch", "kHz", "m/s²", "day", "Ah", "lx", "S",
    "t", "count", "-", "Nm", "dps", "m/s/s", "(m/s)^2", "rad/s", "1",
)  # fmt: skip


@pytest.mark.parametrize("unit", UNITS)
def test_models_have_the_units_of_columns(unit: str) -> None:
    check_unit("unit", unit)
    check_signals("states", {"x": unit})
    assert is_unit(unit)
    check_unit("unit", product(unit, unit))
    assert conversion("unit", product(unit, "m"), product("m", unit)).of(3.0) == 3.0


def test_product_of_units_keeps_their_powers() -> None:
    assert product("m²", "m²") == "m^4"
    assert product("N*m", "1/s^2") == "m N/s^2"
    assert product("m/s/s", "s") == "m/s"
    assert product("°C", "°C") == "°C^2"
