"""All observers with a record each; a new family adds its own here."""

from __future__ import annotations

from collections.abc import Callable

from tests.reobserve.observers.case import Case
from tests.reobserve.observers.cases_delay import DELAY_CASES
from tests.reobserve.observers.cases_filters import FILTER_CASES
from tests.reobserve.observers.cases_nonlinear import NONLINEAR_CASES
from tests.reobserve.observers.cases_rigid_body import RIGID_BODY_CASES

CASES: dict[str, Callable[[], Case]] = {
    **RIGID_BODY_CASES,
    **FILTER_CASES,
    **NONLINEAR_CASES,
    **DELAY_CASES,
}
