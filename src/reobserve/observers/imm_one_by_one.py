"""The loop of a bank over filters that are called one by one: they may be anyone's."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from reobserve.core.errors import DivergenceError
from reobserve.core.value import for_loop
from reobserve.observers.gaussian_state import Correction, Gaussian
from reobserve.observers.imm_loop import combine, interact, update_probabilities
from reobserve.observers.imm_work import BankRows, Posteriors, new_bank_work

if TYPE_CHECKING:
    from reobserve.observers.imm import IMM

Array = NDArray[np.float64]


def run_one_by_one(
    bank: IMM,
    posteriors: Posteriors,
    measurements: Array,
    inputs: Array,
    fresh: bool,
    rows: BankRows,
) -> tuple[int, str]:
    """Fill the rows as `run_bank` does, and return the number of good ones and why it stopped."""
    transition = for_loop(bank.transition)
    work, gated = new_bank_work(posteriors, bank.mixing, bank._rules), bank.gate is not None
    for k, y in enumerate(measurements):
        moves = k > 0 or not fresh
        if moves:
            interact(transition, bank.mixing, posteriors, work)
            posteriors.log_probabilities[:] = work.mixed.log_probabilities
        parts = (work.mixed if moves else posteriors)[:3]
        begun = [Gaussian(*(part[j].copy() for part in parts)) for j in range(len(bank.filters))]
        try:
            if moves:
                pairs = zip(bank.filters, begun, strict=True)
                begun = [mode.predict(posterior, inputs[k]) for mode, posterior in pairs]
            corrections = _corrected(bank, begun, y, inputs[k + 1], rows.outlier[k * gated])
        except DivergenceError as error:
            return k, error.finding
        for j, after in enumerate(corrections):
            posteriors.means[j] = after.posterior.mean
            posteriors.errors[j] = after.posterior.error
            posteriors.covariances[j] = after.posterior.covariance
            rows.innovation[k, j] = after.innovation
            work.log_likelihoods[j] = after.log_likelihood
        whole = update_probabilities(posteriors.log_probabilities, work.log_likelihoods)
        rows.log_likelihood[k] = 0.0 if np.isnan(y).all() else whole
        combine(posteriors, k, rows, work)
        if not all(np.isfinite(part[k]).all() for part in rows[:3]):
            return k, ""
    return len(measurements), ""


def _corrected(
    bank: IMM, begun: Sequence[Gaussian], y: Array, u: Array, outliers: Array
) -> list[Correction]:
    """The corrections of all filters, without what is beyond the gates of all of them."""
    pairs = list(zip(bank.filters, begun, strict=True))
    corrections = [mode.correct(posterior, y, u) for mode, posterior in pairs]
    if bank.gate is None:
        return corrections
    deviations = np.array(
        [each.innovation / np.sqrt(np.diag(each.innovation_covariance)) for each in corrections]
    )
    least = deviations[np.argmin(np.abs(deviations), axis=0), np.arange(len(y))]
    beyond = np.abs(least) > bank.gate
    outliers[:] = np.where(beyond, least, 0.0)
    if not beyond.any():
        return corrections
    taken = np.where(beyond, np.nan, y)
    return [mode.correct(posterior, taken, u) for mode, posterior in pairs]
