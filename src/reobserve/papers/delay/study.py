"""Stage study: many runs behind one figure, as one table.

The ``method`` of a study in the ledger is one of

    tradeoff    error of the delay against rho, for both Taylor orders, without and with noise
    tuning      errors of the four methods of Fig. 3 against the tuning of each
"""

from __future__ import annotations

from typing import Any

from reobserve.errors import InputError
from reobserve.files import NAME, NUMBER, SCORE, UNIT, WHOLE
from reobserve.matrices import as_floats
from reobserve.papers.delay import study_tradeoff, study_tuning
from reobserve.series import Series

HEADER = ("observer", "sweep", "level", "run", "quantity", "value", "unit")
KINDS = {
    **dict.fromkeys(("observer", "sweep", "quantity"), NAME),
    "level": NUMBER, "run": WHOLE, "value": SCORE, "unit": UNIT,
}  # fmt: skip

METHODS = {"tradeoff": study_tradeoff.run, "tuning": study_tuning.run}


def run(settings: dict[str, Any], plant: Series) -> list[dict[str, Any]]:
    """The rows of the study's method, with the columns of `HEADER`.

    Raises
    ------
    InputError
        If there is no such method or a setting cannot be used.
    """
    check_study(settings["study"])
    rows = METHODS[settings["study"]["method"]](settings, plant)
    return [dict(zip(HEADER, row, strict=True)) for row in rows]


def check_study(study: dict[str, Any]) -> None:
    """Refuse a method that there is not, and levels that are no positive numbers."""
    if study.get("method") not in METHODS:
        raise InputError("method", f"{study.get('method')!r} must be one of {', '.join(METHODS)}")
    runs = study.get("runs", 1)
    if not isinstance(runs, int) or runs < 1:
        raise InputError("runs", f"{runs!r} must be a whole number, 1 or more")
    for name in ("rhos", "forgetting", "relay_gains"):
        if name in study and not (as_floats(name, study[name]) > 0).all():
            raise InputError(name, f"{study[name]} must all be greater than zero")
