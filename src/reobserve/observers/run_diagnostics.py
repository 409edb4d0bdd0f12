"""Signs against the model in the numbers of a Gaussian filter's run."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from reobserve.core.chi_squared import inflated_rows
from reobserve.core.errors import InputError
from reobserve.observers.run import Run

Rows = NDArray[np.int64]

_FAR = 10.0  # standard deviations
_LENGTHS = 2 ** np.arange(11)
_FALSE = 1e-3  # the probability that a run of a right model has a row in `inflated`


@dataclass(frozen=True, eq=False)
class Diagnostics:
    """Signs against the model in a Gaussian filter's run (both lists are empty where it holds).

    Attributes
    ----------
    far
        Rows with an innovation e of more than ten of its standard deviations, or beyond the
        filter's gate: outliers, angles whose period is not given, wrong units, a start that was
        taken for certain.
    inflated
        Rows at which the sum of e' S^-1 e over the last 1, 2, 4, ..., 1024 measured rows is too
        large for its chi-squared distribution: noise that is larger than stated, or another model.
        A right model has such a row in one run of a thousand at most.
    distance
        The mean of e' S^-1 e over the number of outputs: 1 if the model is right, nan without a row
        that is measured whole.
    eigenvalue
        The smallest one of all covariances, scaled to correlations: 0 or less where one is none.
    """

    far: Rows
    inflated: Rows
    distance: float
    eigenvalue: float

    def __repr__(self) -> str:
        rows = [
            f"{name}: {'none' if not len(which) else f'{len(which)} rows, the first {which[0]}'}"
            for name, which in (("far", self.far), ("inflated", self.inflated))
        ]
        numbers = f"distance: {self.distance:.3g}, eigenvalue: {self.eigenvalue:.2g}"
        return f"Diagnostics({', '.join(rows)}, {numbers})"


def diagnose(run: Run[Any]) -> Diagnostics:
    """`Run.diagnostics`."""
    needed = ("innovation", "innovation_covariance", "covariance")
    if not all(name in run.estimates for name in needed):
        raise InputError("run", "has no innovations with covariances, as Gaussian filters give")
    e, S, P = (run[name] for name in needed)
    with np.errstate(invalid="ignore", divide="ignore"):
        far = (np.abs(e) > _FAR * np.sqrt(np.einsum("kii->ki", S))).any(axis=1)
    if "outlier" in run:
        far |= run["outlier"].any(axis=1)
    whole = np.isfinite(e).all(axis=1) & np.isfinite(S).all(axis=(1, 2))
    e, S, rows = e[whole], S[whole], np.flatnonzero(whole)
    # d = e' S^-1 e
    distances = (e * np.linalg.solve(S, e[..., None])[..., 0]).sum(axis=1)
    outputs = e.shape[1]
    inflated = inflated_rows(distances, outputs, _LENGTHS, _FALSE)
    mean = float(distances.mean()) / outputs if len(rows) else float("nan")
    return Diagnostics(np.flatnonzero(far), rows[inflated], mean, _least(P))


def _least(P: NDArray[np.float64]) -> float:
    """The smallest eigenvalue of P_ij / sqrt(P_ii P_jj), variances of zero left as they are."""
    size = np.sqrt(np.maximum(np.einsum("kii->ki", P), 0.0))
    size[size == 0.0] = 1.0
    scaled = P / size[:, :, None] / size[:, None, :]
    return float(np.linalg.eigvalsh(scaled).min()) if scaled.size else float("nan")
