"""Examples: a specification for each observer, and the record that it is for."""

from __future__ import annotations

from functools import cache
from textwrap import dedent

from reobserve.core.errors import InputError, nearest, shown
from reobserve.estimation.example_records import Simulated, followed
from reobserve.estimation.families import FAMILIES, family
from reobserve.estimation.observer_design import Example

_EVEN = "sampling: {{period: {}, missing: interpolate, gap: {}, at_gap: restart}}\n"
_TIME = "columns:\n  time: {column: t, unit: ms}\n  measurements:\n"

_SATELLITE = f"""\
{_TIME.rstrip()}              # what the observer reads in rad/s, in the units of the log
    - {{column: wx, unit: deg/s}}
    - {{column: wy, unit: deg/s}}
    - {{column: wz, unit: deg/s}}
  inputs:
    - {{column: Tx, unit: mN m}}
    - {{column: Ty, unit: mN m}}
    - {{column: Tz, unit: mN m}}
sampling:
  period: 0.01               # [s]
  missing: interpolate       # samples that were lost: refuse, interpolate, or skip (Kalman filters)
  gap: 0.1                   # [s], the longest stretch that is filled
  at_gap: restart            # after a longer one: refuse, restart, or coast (Kalman filters)
"""
_MOTOR_COLUMNS = f"""\
{_TIME}    - {{column: speed, unit: rpm}}
    - {{column: current, unit: mA}}
  inputs:
    - {{column: voltage, unit: V}}
"""
_SKIPPING = """\
sampling:
  period: 0.01               # [s]
  missing: skip              # lost samples are predicted; of two sensors one may be lost
  gap: 0.1                   # [s]
  at_gap: coast              # keep predicting, with growing sigmas; or restart, or refuse
"""
_MOTOR = f"{_MOTOR_COLUMNS}{_SKIPPING}"
_SWING = (
    f"{_TIME}    - {{column: angle, unit: deg}}\n  inputs:\n    - {{column: torque, unit: mN m}}\n"
)
# The columns of the records of plants, and the sampling.
_RECORDS = {
    "satellite": _SATELLITE,
    "pendulum": f"{_TIME}    - {{column: angle, unit: deg}}\n{_EVEN.format(0.02, 0.2)}",
    "driven_pendulum": f"{_SWING}{_EVEN.format(0.01, 0.1)}",
    "swing": f"{_SWING}{_SKIPPING}",
    "lag": f'{_TIME}    - {{column: level, unit: "%"}}\n'
    f'  inputs:\n    - {{column: valve, unit: "%", model_unit: "1"}}\n{_EVEN.format(0.01, 0.1)}',
    "signal": f"{_TIME}    - {{column: voltage, unit: mV, model_unit: V}}\n"
    f"{_EVEN.format(0.01, 0.1)}",
    "motor": _MOTOR,
    "weak_motor": _MOTOR,
    "biased_motor": _MOTOR,
    "worn_motor": _MOTOR,
    "faulty_motor": f"{_MOTOR_COLUMNS}{_EVEN.format(0.01, 0.1)}",
}


@cache
def examples() -> dict[str, Example]:
    """The examples of all families, by their names."""
    return {name: example for kind in FAMILIES for name, example in family(kind).records.items()}


def _example(name: str) -> Example:
    """The example of one name, of which the family is imported alone."""
    kind = next((kind for kind in FAMILIES if name == kind or name.startswith(f"{kind}-")), "")
    records = family(kind).records if kind else examples()
    if name not in records:
        raise InputError("example", f"there is no {shown(name)}{nearest(name, examples())}")
    return records[name]


def specification_text(name: str) -> str:
    """The specification of an example, with comments."""
    example = _example(name)
    alarms = f"alarms:\n{example.alarms}" if example.alarms else ""
    return f"{example.observer}{example.gains}{_RECORDS[example.plant]}{alarms}"


def model_text(kind: str) -> str:
    """A model of a kind that can be designed as it is: the first example's observer."""
    title, _, keys = next(iter(family(kind).records.values())).observer.partition("observer:\n")
    rest = dedent(keys).removeprefix(f"kind: {kind}\n")
    return f"{title}sampling_period: 0.01       # [s]\n{rest}"


def simulated(name: str) -> Simulated:
    """The plant of an example, followed over its record."""
    return followed(_example(name).plant)
