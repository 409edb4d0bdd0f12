"""Units as they are written: those of pint, as ``N m s/rad``, and what engineers write for them.

Products and quotients of common symbols are known without pint, which is imported for all others.
"""

from __future__ import annotations

import itertools
import math
import re
from functools import cache
from typing import Any

from reobserve.core.errors import InputError, shown
from reobserve.core.extras import package

# Those of the SI that systems are described in, and one for a number that has none.
SYMBOLS = (
    "1", "%", "s", "min", "h", "m", "mm", "cm", "km", "kg", "g", "rad", "deg", "rpm", "Hz",
    "N", "kN", "Pa", "kPa", "MPa", "bar", "l", "J", "kJ", "W", "kW", "V", "mV", "kV", "A", "mA",
    "Ω", "H", "mH", "F", "C", "T", "mT", "uT", "Wb", "K", "°C", "mol", "cd",
)  # fmt: skip
# Labels of stored signals: a level, and the paper's velocity whose unit nobody states.
_LABELS = ("dB", "y")

_DEFINITIONS = (
    "@alias turn = rev = Umdr", "@alias revolutions_per_minute = Upm",
    "@alias kilometer_per_hour = kmh", "degree_per_second = degree / second = dps",
    "newton_meter = newton * meter = Nm", "newton_millimeter = newton * millimeter = Nmm",
    "newton_centimeter = newton * centimeter = Ncm",
    "newton_meter_second = newton * meter * second = Nms", "newton_second = newton * second = Ns",
    "volt_second = volt * second = Vs", "ampere_second = ampere * second = As",
    "watt_second = watt * second = Ws", "joule_second = joule * second = Js",
    "volt_ampere_reactive = volt * ampere = var = VAr", "gauss = 1e-4 * tesla = G",
    "@alias ohm = Ohm", "hectonanosecond = 100 * nanosecond = hns",  # of Windows
)  # fmt: skip

# Symbols that pint knows as one thing, and engineers as two.
_AMBIGUOUS = {
    "g": ("gram", "g_0"), "mg": ("milligram", "millig_0"), "ug": ("microgram", "microg_0"),
    "µg": ("microgram", "microg_0"), "G": ("gauss", "g_0"), "mG": ("milligauss", "millig_0"),
    "Gs": ("gauss", "gigasecond"), "C": ("coulomb", "degree_Celsius"),
    "F": ("farad", "degree_Fahrenheit"), "U": ("turn", "enzyme_unit"), "r": ("turn",),
    "Grad": ("degree", "grade"), "PS": ("metric_horsepower", "petasiemens"),
    "Min": ("minute", "megainch"), "c": (), "e": (), "k": (),  # constants, and no units
    "pH": ("dimensionless", "picohenry"), "mK": ("millikelvin", "(meter * kelvin)"),
}  # fmt: skip

_LONGEST = 60  # characters
_MOST_POWERS = 1000  # multiplied: pint works out powers of numbers
_MOST_READINGS = 16

_CHARACTERS = re.compile(r"[\w\s°%‰Ωµμ²³¹⁰⁴-⁹⁻·⋅*/^()+.-]+")
_NO_PRODUCT = re.compile(r"\w\(|\.$|%\s*\w")  # bar(g), a.u., %RH
_SPELLINGS = str.maketrans({
    "º": "°", "˚": "°", "℃": "°C", "℉": "°F", "Ω": "Ω", "−": "-", "×": "*", "∙": "*", "•": "*"
})  # fmt: skip
_ROOT = re.compile(r"√\s*(\w+)")
# Scales of temperature, in any case and with any word for a degree, and those that need none.
_SCALES = {"c": "°C", "f": "°F", "k": "kelvin", "r": "degree_Rankine"}
_SCALE = "cel[sc]ius|centigrade|fahrenheit|kelvins?|rankine"
_DEGREE = r"(?:°|\b(?:deg(?:ree)?s?\.?|grad))[\s_-]*"
_DEGREES = re.compile(rf"{_DEGREE}([cfkr]|{_SCALE})\b|\b({_SCALE})\b|\b([cfkr])°", re.IGNORECASE)
_PLAIN_POWER = re.compile(r"(?<![\w^*.])((?![Ll]\d)[A-Za-zΩµμ]+)(-1|-?[2-4])(?![\w.])")
_LETTER = r"[^\W\d_²³¹⁰⁴-⁹]"
_TOKEN = re.compile(rf"(?<![\w.°]){_LETTER}+(?!{_LETTER}|[\d_])")
# A second factor after a stroke, which may be meant to be below it or not.
_BELOW = re.compile(
    r"/\s*[^\s/()*·⋅]+(?:\s+|\s*[*·⋅]\s*)(?=[^\W\d_])(?![^\W\d_]+\s*(?:\^|\*\*)?\s*[-⁻])"
)

_POWER = re.compile(r"\*\*|\^")
_RAISED = re.compile("[⁰¹²³⁴⁵⁶⁷⁸⁹⁻]+")
_DIGITS = str.maketrans("⁰¹²³⁴⁵⁶⁷⁸⁹⁻", "0123456789-")
_NUMBER = r"[+-]?\s*(\d{1,4}|\d{0,4}\.\d{1,9})(?:\s*/\s*\d{1,4})?"
_EXPONENT = re.compile(rf"\s*(?:{_NUMBER}|\(\s*{_NUMBER}\s*\))(?!\w)\s*+(?![(\d._])")


def _products(symbols: tuple[str, ...]) -> str:
    power = rf"(?:{'|'.join(map(re.escape, symbols))})(?:\^[+-]?\d{{1,2}})?"
    product = rf"{power}(?: {power}){{0,7}}"
    return rf"{product}(?:/(?:{power}|\({product}\)))?"


_COMMON = re.compile(_products(SYMBOLS), re.ASCII)
_LABEL = re.compile(_products(SYMBOLS + _LABELS), re.ASCII)
_MOST_LISTED = 100


def is_unit(text: str) -> bool:
    """True if text is a unit, or a list of them with commas for the components of one signal."""
    units = text.split(", ")
    known = len(text) <= 200 and len(units) <= _MOST_LISTED
    return known and all(_LABEL.fullmatch(unit) or _problem(unit) is None for unit in units)


def check_unit(place: str, text: str) -> None:
    """Refuse invalid units.

    Raises
    ------
    InputError
        If a unit is unknown, logarithmic, or can be read in two ways whatever it is converted to.
    """
    if not _COMMON.fullmatch(text) and (problem := _problem(text)) is not None:
        raise InputError(place, problem)


@cache
def _problem(text: str) -> str | None:
    """The end of a sentence on a text that is no valid unit."""
    if (match := _BELOW.search(text)) and readings(text):
        above, below = text[: match.start()], text[match.start() + 1 :].strip()
        return f"{shown(text)} must be {above}/({below}), or have what is not divided in front"
    if not readings(text):
        return f"{shown(text)} is no unit that is known; rad/s, deg/s, N m, °C, V and 1 are some"
    if not any(map(is_affine, readings(text))):
        return f"{shown(text)} counts by a logarithm, which has no conversion"
    return None


@cache
def readings(text: str) -> tuple[Any, ...]:
    """Units of pint that a text may stand for, usually one, and none if it is no unit."""
    if text in ("-", "–", "—"):  # as of a column without a unit
        text = "1"
    good = 0 < len(text) <= _LONGEST and text.isprintable() and text == text.strip()
    if not good or _numeric(text):
        return ()
    text = _ROOT.sub(r" \1**0.5 ", text.translate(_SPELLINGS)).strip()
    text = _DEGREES.sub(lambda match: _SCALES[(match[1] or match[2] or match[3])[0].lower()], text)
    known = _COMMON.fullmatch(text) or not _NO_PRODUCT.search(text)
    if not _CHARACTERS.fullmatch(text) or not known or not _has_low_powers(text):
        return ()
    text = _PLAIN_POWER.sub(lambda match: _raised(match[0], match[1], match[2]), text)
    text = _TOKEN.sub(lambda match: _lowered(match[0]), text)
    tokens = [match[0] for match in _TOKEN.finditer(text)]
    choices = [_AMBIGUOUS.get(token, (token,)) for token in tokens]
    if math.prod(map(len, choices)) > _MOST_READINGS:
        return ()
    units = []
    for chosen in itertools.product(*choices):
        names = iter(chosen)
        unit = _parsed(_TOKEN.sub(lambda _, names=names: next(names), text))  # type: ignore[misc]
        if unit is not None and unit not in units:
            units.append(unit)
    return tuple(units)


def _raised(whole: str, symbol: str, power: str) -> str:
    """A power without a sign for it, as in m3/h."""
    return whole if _parsed(whole) is not None else f"{symbol}**{power}"


def _lowered(token: str) -> str:
    """A name in lower case if it is one, as Volt and RPM are."""
    if token in _AMBIGUOUS or len(token) < 3 or not (token.istitle() or token.isupper()):
        return token
    parse = registry().parse_unit_name
    plain = any(not prefix for prefix, _, _ in parse(token.lower()))
    return token.lower() if plain and not parse(token) else token


@cache
def registry() -> Any:
    """The registry of pint, with units that engineers write and pint lacks."""
    pint = package("pint", "convert units")
    made = pint.UnitRegistry(
        autoconvert_offset_to_baseunit=True, cache_folder=None, on_redefinition="ignore"
    )
    for definition in _DEFINITIONS:
        made.define(definition)
    made._build_cache()  # of those that are defined a second time
    return made


@cache
def _parsed(text: str) -> Any:
    """The unit of pint that a text names, or None if it is none."""
    units = registry()
    try:
        unit = units.parse_units(text)
        units.Quantity(1.0, unit).to_base_units()
    except Exception:  # of pint, and of its tokenizer, which raises what Python's does
        return None
    return unit


def _has_low_powers(text: str) -> bool:
    """True if each exponent is a number, none is a power itself, and their product is small."""
    plain = _RAISED.sub(lambda match: f"**{match[0].translate(_DIGITS)}", text)
    *between, last = _POWER.split(plain)[1:] or [""]
    terms = [_EXPONENT.match(rest) for rest in (*between, *[last] * bool(last))]
    whole = any(term is None or term.end() == len(term.string) for term in terms[: len(between)])
    if whole or (last and terms[-1] is None):
        return False
    powers = [float(term[1] or term[2]) for term in terms if term is not None]
    return math.prod(max(1.0, power) for power in powers) <= _MOST_POWERS


def _numeric(text: str) -> bool:
    """True if text is a number other than 1, which pint would take for a unit of that size."""
    return text != "1" and text.replace(".", "", 1).isdigit()


def same(one: str, other: str) -> bool:
    """True if numbers are equal in both units: in N m s and kg m^2/s, but not in Hz and rad/s."""
    return one == other or not _sizes(one).isdisjoint(_sizes(other))


@cache
def _sizes(text: str) -> set[tuple[Any, ...]]:
    """Dimension and size of each reading of a unit, and the angles that a rate counts."""
    found = set()
    for unit in readings(text):
        counted = angles(unit) if {*unit.dimensionality} == {"[time]"} else 0.0
        base = registry().Quantity(1.0, unit).to_base_units()
        found.add((unit.dimensionality, counted, f"{base.magnitude:.9g}"))
    return found


@cache
def angles(unit: Any) -> float:
    """The power of an angle in a unit."""
    return float(dict(registry().get_root_units(unit)[1]._units).get("radian", 0))


@cache
def is_affine(unit: Any) -> bool:
    """True for a scale of even steps, with an offset or none, False for a logarithm."""
    if registry().Quantity(1.0, unit)._is_multiplicative:
        return True
    try:
        quantity = registry().Quantity
        at = [quantity(value, unit).to_base_units().magnitude for value in (0.0, 1.0, 2.0)]
    except Exception:  # pint's, of which there are many
        return False
    return bool(abs((at[2] - at[1]) - (at[1] - at[0])) <= 1e-9 * abs(at[1] - at[0]))
