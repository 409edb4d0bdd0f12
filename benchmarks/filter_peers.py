"""The interacting multiple model by filterpy, by numpy, and of filters that are a user's own."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from reobserve.observers.gaussian_filter import GaussianFilter
from reobserve.observers.gaussian_state import Correction, Gaussian
from reobserve.systems.linear import LinearModel

Array = NDArray[np.float64]
Found = tuple[Array, Array]  # estimates (k, n) and probabilities (k, r)


def by_filterpy(
    models: list[LinearModel], transition: Array, measurements: Array, controls: Array
) -> Found:
    """filterpy's `IMMEstimator` from zero, covariance 1, all modes as likely.

    It knows no feedthrough; that is the same in all modes and taken off the measurements.
    """
    from filterpy.kalman import IMMEstimator, KalmanFilter

    filters = []
    for model in models:
        one = KalmanFilter(model.states, model.outputs, model.inputs)
        one.F, one.B, one.H, _, one.Q, one.R = model.arrays
        filters.append(one)
    bank = IMMEstimator(filters, np.full(len(models), 1.0 / len(models)), transition)
    freed = measurements - controls[1:] @ models[0].arrays.D.T
    estimates = np.empty((len(freed), models[0].states))
    probabilities = np.empty((len(freed), len(models)))
    for k in range(len(freed)):
        bank.predict(controls[k][:, np.newaxis])
        bank.update(freed[k][:, np.newaxis])
        estimates[k], probabilities[k] = bank.x[:, 0], bank.mu
    return estimates, probabilities


def by_numpy(
    models: list[LinearModel], transition: Array, measurements: Array, controls: Array
) -> Found:
    """The same as it would be written in numpy: the modes side by side, no loop but over time."""
    A, B, C, D, Q, R = (
        np.stack(part) for part in zip(*(model.arrays for model in models), strict=True)
    )
    (r, n), identity = A.shape[:2], np.eye(A.shape[1])
    mean, covariance = np.zeros((r, n)), np.tile(identity, (r, 1, 1))
    mu = np.full(r, 1.0 / r)
    estimates, probabilities = np.empty((len(measurements), n)), np.empty((len(measurements), r))
    for k in range(len(measurements)):
        predicted = mu @ transition
        weights = transition * mu[:, np.newaxis] / predicted
        mixed = weights.T @ mean
        apart = mean - mixed[:, np.newaxis]  # by the mode that follows, and the mode that was
        spread = np.einsum("ij,iab->jab", weights, covariance)
        spread += np.einsum("ij,jia,jib->jab", weights, apart, apart)

        x = np.einsum("jab,jb->ja", A, mixed) + B @ controls[k]
        P = A @ spread @ A.transpose(0, 2, 1) + Q
        innovation = measurements[k] - np.einsum("joa,ja->jo", C, x) - D @ controls[k + 1]
        cross = P @ C.transpose(0, 2, 1)
        S = C @ cross + R
        inverse = np.linalg.inv(S)
        K = cross @ inverse
        mean = x + np.einsum("jao,jo->ja", K, innovation)
        rest = identity - K @ C
        covariance = rest @ P @ rest.transpose(0, 2, 1) + K @ R @ K.transpose(0, 2, 1)

        distance = np.einsum("jo,jop,jp->j", innovation, inverse, innovation)
        log_likelihood = -0.5 * (distance + np.linalg.slogdet(2.0 * np.pi * S)[1])
        mu = predicted * np.exp(log_likelihood - log_likelihood.max())
        mu /= mu.sum()
        estimates[k], probabilities[k] = mu @ mean, mu
    return estimates, probabilities


@dataclass(frozen=True)
class OwnFilter:
    """A Kalman filter of a user's own, in numpy: what a bank has to call from Python."""

    model: LinearModel

    def predict(self, posterior: Gaussian, u: Array) -> Gaussian:
        """Time update."""
        A, B, _, _, Q, _ = self.model.arrays
        return Gaussian(
            A @ posterior.mean + B @ u, A @ posterior.covariance @ A.T + Q, posterior.error
        )

    def correct(self, posterior: Gaussian, y: Array, u: Array) -> Correction:
        """Measurement update."""
        _, _, C, D, _, R = self.model.arrays
        P = posterior.covariance
        innovation = y - C @ posterior.mean - D @ u
        cross = P @ C.T
        S = C @ cross + R
        inverse = np.linalg.inv(S)
        K = cross @ inverse
        mean = posterior.mean + K @ innovation
        rest = np.eye(len(mean)) - K @ C
        after = Gaussian(mean, rest @ P @ rest.T + K @ R @ K.T, y - C @ mean - D @ u)
        distance = innovation @ inverse @ innovation
        log_likelihood = -0.5 * (distance + np.linalg.slogdet(2.0 * np.pi * S)[1])
        return Correction(after, innovation, S, float(log_likelihood))


@dataclass(frozen=True)
class CalledFilter:
    """A filter of the library in a wrapper, so that a bank has to call it from Python."""

    inner: GaussianFilter

    @property
    def model(self) -> Any:
        """The model of the filter within."""
        return self.inner.model

    def predict(self, posterior: Gaussian, u: Array) -> Gaussian:
        """Time update."""
        return self.inner.predict(posterior, u)

    def correct(self, posterior: Gaussian, y: Array, u: Array) -> Correction:
        """Measurement update."""
        return self.inner.correct(posterior, y, u)
