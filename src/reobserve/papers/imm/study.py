"""Stage study: many runs behind one figure, as one table.

The ``method`` of a study in the ledger is one of

    neighbourhood    how far each tuned number may move before a quoted value leaves its band
    changes          the calibrated banks with one thing changed
    closeness        correct diagnoses against how far apart the models are
"""

from __future__ import annotations

from typing import Any

from reobserve.errors import InputError, located
from reobserve.files import NAME, NUMBER, SCORE, UNIT, WHOLE
from reobserve.matrices import as_floats
from reobserve.papers.imm import study_changes, study_closeness, study_neighbourhood
from reobserve.series import Series

HEADER = ("observer", "sweep", "level", "run", "quantity", "value", "unit")
KINDS = {
    **dict.fromkeys(("observer", "sweep", "quantity"), NAME),
    "level": NUMBER, "run": WHOLE, "value": SCORE, "unit": UNIT,
}  # fmt: skip

METHODS = {
    "neighbourhood": study_neighbourhood.run,
    "changes": study_changes.run,
    "closeness": study_closeness.run,
}
_CHECKS = {
    "neighbourhood": study_neighbourhood.check,
    "changes": study_changes.check,
    "closeness": study_closeness.check,
}


def run(settings: dict[str, Any], plant: Series) -> list[dict[str, Any]]:
    """The rows of the study's method, with the columns of `HEADER`.

    Raises
    ------
    InputError
        If there is no such method or a setting cannot be used.
    """
    with located("study"):
        check_study(settings)
    rows = METHODS[settings["study"]["method"]](settings, plant)
    return [dict(zip(HEADER, row, strict=True)) for row in rows]


def check_study(settings: dict[str, Any]) -> None:
    """Refuse a method that there is not, levels that are no positive numbers, and what it says.

    Raises
    ------
    InputError
        With the key of the study.
    """
    study = settings["study"]
    if study.get("method") not in METHODS:
        raise InputError("method", f"{study.get('method')!r} must be one of {', '.join(METHODS)}")
    if "runs" in study and (not isinstance(study["runs"], int) or study["runs"] < 1):
        raise InputError("runs", f"{study['runs']!r} must be a whole number, 1 or more")
    for name in ("factors", "noise_levels", "shares", "layer_factors", "periods"):
        if name in study:
            levels = as_floats(name, study[name])
            if levels.ndim != 1 or not (levels > 0).all():
                raise InputError(name, f"{study[name]} must all be greater than zero, in a list")
    _CHECKS[study["method"]](settings)
