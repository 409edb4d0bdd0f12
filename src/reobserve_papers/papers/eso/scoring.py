"""Errors and lags of estimated faults."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from reobserve_papers.metrics.metrics import Score, name_at
from reobserve_papers.metrics.responses import check_windows, error_of, root_mean_square, window
from reobserve_papers.papers.eso import keys
from reobserve_papers.signals.series import Series

Array = NDArray[np.float64]

FAULTS = {"actuator": "V", "sensor": "rad/s"}


def check_rules(rules: keys.Metrics, plant: keys.Plant) -> None:
    """Refuse windows that hold fewer than two samples of the estimates."""
    names = [f"{name}_{what}" for name in FAULTS for what in ("varying", "constant")]
    windows = {name: getattr(rules, name) for name in names}
    check_windows(windows, plant.horizon, 2.0 * plant.step, least=2)


class Shift(NamedTuple):
    """The time shift of an estimate with the minimum error [s], and the RMS error left by it."""

    lag: float
    left: float


def best_shift(time: Array, truth: Array, estimate: Array, bounds: Any, longest: float) -> Shift:
    """Lag of the estimate, and its error without this lag.

    Shifts are whole samples, refined by a parabola through the minimum squared error and its
    neighbours; the error is that at the whole sample. The longest is ``longest`` seconds or half
    the window. Truth and estimate outside the window do not count, because the estimate may respond
    to a jump at the end of the window.
    """
    chosen = window(time, *bounds)
    truth, estimate = truth[chosen], estimate[chosen]
    step, count = time[1] - time[0], len(truth)
    most = min(round(longest / step), count // 2)

    def error(shift: int) -> float:
        return float(np.mean((estimate[shift:] - truth[: count - shift]) ** 2))

    # The mean of (estimate(t + k) - truth(t))^2 over all t in both, for each shift k.
    left = np.arange(count, count - most - 1, -1)
    squares = np.cumsum(truth**2)[left - 1] + np.cumsum(estimate[::-1] ** 2)[left - 1]
    spectra = np.fft.rfft([estimate, truth], 2 * count)
    products = np.fft.irfft(spectra[0] * spectra[1].conj(), 2 * count)[: most + 1]
    errors = (squares - 2.0 * products) / left
    # Transforms have rounding errors of 1e-15 of the squares; below 1e-12 of them is zero.
    best = int(np.argmin(np.maximum(errors, 1e-12 * squares[0] / count)))
    rest = float(np.sqrt(error(best)))
    if not 0 < best < most:
        return Shift(float(best * step), rest)
    before, least, after = error(best - 1), error(best), error(best + 1)
    lag = (best + 0.5 * (before - after) / (before - 2.0 * least + after)) * step
    return Shift(float(lag), rest)


def scores(rules: keys.Metrics, plant: Series, estimate: Series) -> Iterator[Score]:
    """Errors of both faults where they vary and where they are constant, and their lags.

    Where they vary, the lag counts as an error or is removed.
    """
    for name, unit in FAULTS.items():
        channel, time = f"{name}_fault", estimate.time
        error = error_of(plant, estimate, channel)
        truth, bounds = plant[channel][::2], getattr(rules, f"{name}_varying")
        shift = best_shift(time, truth, estimate[channel], bounds, rules.longest_lag)
        counted = float(root_mean_square(error[window(time, *bounds)]))
        for lag, value in (("counted", counted), ("removed", shift.left)):
            yield name_at(f"rms_{name}_error_varying", lag=lag), value, unit
        constant = error[window(time, *getattr(rules, f"{name}_constant"))]
        yield f"rms_{name}_error_constant", float(root_mean_square(constant)), unit
        yield f"{name}_lag", shift.lag, "s"


def sizes(rules: keys.Metrics, plant: Series) -> Iterator[Score]:
    """Root mean squares of the faults and the noise, for comparison with the errors."""
    time = plant.time[::2]
    for name, unit in FAULTS.items():
        fault = plant[f"{name}_fault"][::2][window(time, *getattr(rules, f"{name}_varying"))]
        yield f"rms_{name}_fault_varying", float(root_mean_square(fault)), unit
    speed = (plant["output"] - plant["state"])[::2, 0] - plant["sensor_fault"][::2]
    noise = speed[window(time, *rules.sensor_constant)]
    yield "rms_noise_constant", float(root_mean_square(noise)), "rad/s"


def corrected_speed(rules: keys.Metrics, plant: Series, estimate: Series) -> Iterator[Score]:
    """Error of the speed as y1 minus the estimated sensor fault, where that fault is constant."""
    error = (plant["output"] - plant["state"])[::2, 0] - estimate["sensor_fault"]
    chosen = error[window(estimate.time, *rules.sensor_constant)]
    yield "rms_corrected_speed_error_constant", float(root_mean_square(chosen)), "rad/s"


def differences(rules: keys.Metrics, left: Series, right: Series) -> Iterator[Score]:
    """Root mean square differences of two estimates of the faults, where these vary."""
    for name, unit in FAULTS.items():
        difference = left[f"{name}_fault"] - right[f"{name}_fault"]
        chosen = difference[window(left.time, *getattr(rules, f"{name}_varying"))]
        yield f"rms_{name}_difference", float(root_mean_square(chosen)), unit
