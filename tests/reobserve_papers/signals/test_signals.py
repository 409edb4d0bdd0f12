"""Signals against closed forms, their limits at jumps, sampled files, and invalid input."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import mpmath
import numpy as np
import pyarrow as pa
import pyarrow.parquet as parquet
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from reobserve.core.errors import InputError
from reobserve_papers.signals.inputs import Signal, sample_files
from reobserve_papers.signals.piecewise_constant import (
    PRIMITIVE_POLYNOMIALS,
    maximum_length_sequence,
)

Array = NDArray[np.float64]

GRID = np.arange(0, 101) * 0.05  # 0 ... 5 s
CONSTANT = {"kind": "constant", "axis": 1, "from": 1.0, "size": 0.5}
SINE = {"kind": "sine", "axis": 2, "from": 2.5, "amplitude": 2.0, "frequency": 3.0, "phase": 0.4}
RAMP = {"kind": "ramp", "axis": 3, "from": 0.5, "until": 2.0, "slope": -0.1}
SQUARE = {"kind": "square", "axis": 1, "from": 1.0, "until": 9.0, "high": 1.5, "period": 4.0}
PRBS = {"kind": "prbs", "axis": 1, "until": 30.0, "amplitude": 0.1, "clock": 100.0, "order": 7}
SWEEP = {"kind": "sweep", "axis": 1, "from": 0.5, "amplitude": 2.0}
SWEEP |= {"start": 1.0, "end": 11.0, "duration": 4.0}

more = settings(max_examples=4 * settings.default.max_examples)  # of a cheap test


def parse(*terms: Any, axes: int = 3) -> Signal:
    return Signal.parse("fault", terms, axes)


# --- Closed forms -------------------------------------------------------------------------------


def test_each_kind_agrees_with_closed_form() -> None:
    expected = np.zeros((len(GRID), 3))
    for row, t in zip(expected, GRID, strict=True):
        row[0] = 0.5 if t > 1 - 1e-12 else 0
        row[1] = 2 * np.sin(3 * t + 0.4) if t > 2.5 - 1e-12 else 0
        row[2] = -0.1 * (t - 0.5) if 0.5 - 1e-12 < t < 2 - 1e-12 else 0
    assert parse(CONSTANT, SINE, RAMP)(GRID) == pytest.approx(expected, abs=1e-14)


def test_terms_on_one_axis_add() -> None:
    other = {"kind": "sine", "axis": 1, "amplitude": -1.0, "frequency": 7.0}
    together = parse(CONSTANT, other, CONSTANT)(GRID)
    assert together[:, 0] == pytest.approx((GRID > 0.999) * 1.0 - np.sin(7 * GRID), abs=1e-14)
    assert not together[:, 1:].any()
    assert not parse()(GRID).any()


def test_phase_of_a_sine_counts_from_the_start_of_the_run() -> None:
    late = {"kind": "sine", "axis": 1, "from": 2.5, "amplitude": 1.0, "frequency": 10.0}
    assert parse(late)(np.array([2.5]))[0, 0] == pytest.approx(np.sin(25.0), rel=1e-15)


def test_both_limits_at_onset_and_end_are_correct() -> None:
    signal = parse({**CONSTANT, "until": 3.0}, {**RAMP, "axis": 1})
    times = np.array([0.5, 1.0, 2.0, 3.0])
    ramp = -0.1 * (times - 0.5)
    right = signal(times)[:, 0]
    left = signal(times, before=True)[:, 0]
    assert right == pytest.approx([0, 0.5 + ramp[1], 0.5, 0], abs=1e-15)
    assert left == pytest.approx([0, ramp[1], 0.5 + ramp[2], 0.5], abs=1e-15)


def test_limits_do_not_depend_on_rounding_of_the_grid() -> None:
    # 0.1 * 3 is above 0.3 and 0.7 below 0.1 * 7: products of grid times miss the onset by a bit.
    for steps, onset in ((3, 0.3), (7, 0.7), (6, 0.6)):
        signal = parse({**CONSTANT, "from": onset})
        for time in (np.nextafter(0.1 * steps, 0), 0.1 * steps, np.nextafter(0.1 * steps, 9)):
            assert signal(np.array([time]))[0, 0] == 0.5
            assert signal(np.array([time]), before=True)[0, 0] == 0


def test_onsets_and_jumps_are_listed() -> None:
    signal = parse(SINE, {**CONSTANT, "from": 0}, RAMP, {**CONSTANT, "from": 2.5, "until": 4})
    assert signal.onsets == (0.5, 2.5)  # a term active from the start has no onset
    assert signal.jumps == (0.5, 2.0, 2.5, 4.0)


def test_onsets_and_jumps_off_the_grid_are_refused() -> None:
    signal = parse(CONSTANT, RAMP)
    signal.check_grid("fault", 0.25, 5.0)
    with pytest.raises(InputError, match=r"^fault: starts at 1 s, must start before .* 1 s$"):
        signal.check_grid("fault", 0.25, 1.0)
    with pytest.raises(
        InputError,
        match=r"^fault: jumps at 0.5 s, must jump at a multiple of 0.3 s .* 0.3 and 0.6 s\)$",
    ):
        signal.check_grid("fault", 0.3, 5.0)
    # An end off the grid counts like an onset, unless it comes after the run.
    ending = parse({**CONSTANT, "until": 2.1})
    with pytest.raises(InputError, match=r"jumps at 2.1 s.* 2 and 2.25 s\)$"):
        ending.check_grid("fault", 0.25, 5.0)
    ending.check_grid("fault", 0.25, 2.0)
    # Only jumps: anything starting after the end does not matter.
    signal.check_jumps("fault", 0.25, 1.0)
    with pytest.raises(InputError, match=r"^fault: jumps at 0.5 s"):
        signal.check_jumps("fault", 0.3, 1.0)


# --- Before t = 0 -------------------------------------------------------------------------------


def test_term_starting_at_a_negative_time_acts_from_there() -> None:
    early = {"kind": "ramp", "axis": 1, "from": -1.5, "slope": 0.5}
    ended = {"kind": "constant", "axis": 2, "from": -2.0, "until": -0.5, "size": 3.0}
    late = {"kind": "sine", "axis": 3, "amplitude": 1.0, "frequency": 2.0, "phase": 1.0}
    signal = parse(early, ended, late)
    times = np.array([-3.0, -2.0, -1.5, -1.0, -0.5, 0.0, 1.0])
    assert signal(times)[:, 0].tolist() == [0, 0, 0, 0.25, 0.5, 0.75, 1.25]
    assert signal(times)[:, 1].tolist() == [0, 3, 3, 3, 0, 0, 0]
    assert signal(times, before=True)[:, 1].tolist() == [0, 0, 3, 3, 3, 0, 0]
    # Without ``from`` a term starts with the run.
    assert signal(times)[:, 2] == pytest.approx([0, 0, 0, 0, 0, np.sin(1), np.sin(3)], abs=1e-15)


def test_start_before_the_run_is_neither_onset_nor_jump() -> None:
    ended = {**CONSTANT, "from": -2.03, "until": -0.51}
    signal = parse({**SINE, "from": -1.57}, ended, RAMP, {**CONSTANT, "from": 0})
    assert signal.onsets == (0.5,)
    assert signal.jumps == (0.5, 2.0)
    assert signal.breaks == (-2.03, -1.57, -0.51, 0.0, 0.5, 2.0)
    signal.check_grid("fault", 0.25, 5.0)


# --- Derivatives --------------------------------------------------------------------------------


def test_each_kind_has_its_derivative() -> None:
    derivative = parse(CONSTANT, SINE, RAMP).derivative("fault")
    expected = np.zeros((len(GRID), 3))
    expected[:, 1] = np.where(GRID > 2.499, 6 * np.cos(3 * GRID + 0.4), 0)
    expected[:, 2] = np.where((GRID > 0.499) & (GRID < 1.999), -0.1, 0)
    assert derivative(GRID) == pytest.approx(expected, abs=1e-14)
    assert derivative.axes == 3
    # The limits at jumps are those of the terms, and a jumping constant keeps its slope.
    end = np.array([2.0])
    assert derivative(end, before=True)[0, 2] == -0.1
    assert derivative(end)[0, 2] == 0
    assert derivative.breaks == (0.5, 2.0, 2.5)


def test_derivatives_of_higher_order_are_exact() -> None:
    signal = parse(SINE, RAMP, {**CONSTANT, "axis": 2})
    times = np.linspace(2.6, 9, 50)
    for order in range(1, 9):
        signal = signal.derivative("fault")
        turned = 2.0 * 3.0**order * np.sin(3 * times + 0.4 + order * np.pi / 2)
        assert signal(times)[:, 1] == pytest.approx(turned, abs=1e-13 * 3.0**order)
    assert len(signal.terms) == 1  # a ramp has a slope and no higher derivatives
    assert not parse(RAMP).derivative("fault").derivative("fault").terms


def test_derivative_is_the_limit_of_differences() -> None:
    signal = parse({**SINE, "from": -9}, {**RAMP, "axis": 2, "from": -9, "until": 9}, CONSTANT)
    times, h = np.linspace(-0.9, 0.9, 37), 1e-3
    # These differences err by h^4/30 times the fifth derivative, 2 * 3^5 at most, and by rounding.
    near, far = (signal(times + k * h) - signal(times - k * h) for k in (1, 2))
    differences = (8 * near - far) / (12 * h)
    assert signal.derivative("u")(times) == pytest.approx(differences, abs=2e-11)


# --- Squares ------------------------------------------------------------------------------------


def test_pulse_train_is_exact_at_and_around_its_jumps() -> None:
    signal = parse({**SQUARE, "high": 1.0, "low": 0.0, "width": 2.0})
    times = np.array([0.9, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0, 9.0, 10.0])
    assert signal(times)[:, 0].tolist() == [0, 1, 1, 0, 0, 1, 1, 0, 0, 0, 0]
    assert signal(times, before=True)[:, 0].tolist() == [0, 0, 1, 1, 0, 0, 1, 1, 0, 0, 0]
    assert signal.jumps == (1.0, 3.0, 5.0, 7.0, 9.0)
    beside = np.array([3 - 1e-6, 3 + 1e-6, 5 - 1e-6, 5 + 1e-6])
    assert signal(beside)[:, 0].tolist() == [1, 0, 0, 1]
    # Half a period high and then zero has no other meaning.
    assert np.array_equal(parse({**SQUARE, "high": 1.0})(times), signal(times))


def test_square_wave_with_custom_low_and_width_may_end_high() -> None:
    signal = parse({**SQUARE, "from": -1.0, "until": 7.5, "low": -1.5, "width": 1.0})
    times = np.array([-2.0, -1.0, 0.0, 2.0, 3.0, 4.0, 7.0, 7.5])
    assert signal(times)[:, 0].tolist() == [0, 1.5, -1.5, -1.5, 1.5, -1.5, 1.5, 0]
    assert signal(times, before=True)[:, 0].tolist() == [0, 0, 1.5, -1.5, -1.5, 1.5, -1.5, 1.5]
    assert signal.breaks == (-1.0, 0.0, 3.0, 4.0, 7.0, 7.5)
    assert signal.onsets == ()


def test_square_wave_of_equal_levels_jumps_only_at_its_ends() -> None:
    assert parse({**SQUARE, "low": 1.5}).jumps == (1.0, 9.0)


@more
@given(st.integers(0, 40), st.integers(1, 300), st.integers(2, 30), st.data())
def test_square_wave_on_a_grid_agrees_with_integer_arithmetic(
    onset: int, span: int, period: int, data: st.DataObject
) -> None:
    width, h = data.draw(st.integers(1, period - 1)), 0.1
    term = {"kind": "square", "axis": 1, "from": h * onset, "until": h * (onset + span)}
    signal = parse({**term, "high": 2.0, "low": -1.0, "period": h * period, "width": h * width})
    k = np.arange(400)
    acts = (k >= onset) & (k < onset + span)
    expected = np.where(acts, np.where((k - onset) % period < width, 2.0, -1.0), 0.0)
    assert np.array_equal(signal(h * k)[:, 0], expected)
    assert np.array_equal(signal(h * k, before=True)[1:, 0], expected[:-1])
    jumps = np.flatnonzero(np.diff(expected)) + 1
    assert signal.jumps == pytest.approx(h * jumps, abs=1e-12)
    signal.check_jumps("fault", h, 40.0)


def test_square_wave_jumps_off_the_grid_are_refused() -> None:
    signal = parse({**SQUARE, "width": 1.3})
    signal.check_grid("fault", 0.1, 9.0)
    with pytest.raises(
        InputError, match=r"^fault: jumps at 2.3 s, .* \(the nearest are 2 and 2.5 s"
    ):
        signal.check_grid("fault", 0.5, 9.0)
    signal.check_jumps("fault", 0.5, 2.0)


# --- Pseudo-random binary sequences -------------------------------------------------------------


@pytest.mark.parametrize("order", range(2, 17))
def test_prbs_has_maximum_length(order: int) -> None:
    sequence = maximum_length_sequence(order)
    length = 2**order - 1
    assert sequence.shape == (length,)
    assert set(sequence) == {-1.0, 1.0}
    assert (sequence[:order] == 1).all()
    # The register runs through every value but zero.
    bits = np.concatenate([sequence, sequence[: order - 1]]) > 0
    registers = sum(2**i * bits[i : i + length] for i in range(order))
    assert sorted(registers) == list(range(1, length + 1))
    # One more +1 than -1, and two values of the periodic autocorrelation.
    assert sequence.sum() == 1
    correlation = np.fft.ifft(np.abs(np.fft.fft(sequence)) ** 2).real
    assert correlation == pytest.approx(np.r_[length, -np.ones(length - 1)], abs=1e-6)


def test_all_orders_from_2_to_16_have_a_polynomial() -> None:
    assert sorted(PRIMITIVE_POLYNOMIALS) == list(range(2, 17))


def test_prbs_agrees_with_hand_calculation() -> None:
    # By x^n + x^(n-1) + 1 a bit is the sum modulo 2 of the last one and of that n bits before.
    assert maximum_length_sequence(2).tolist() == [1, 1, -1]
    assert maximum_length_sequence(3).tolist() == [1, 1, 1, -1, 1, -1, -1]
    assert maximum_length_sequence(4)[:8].tolist() == [1, 1, 1, 1, -1, 1, -1, 1]


@more
@given(st.integers(2, 6), st.integers(0, 40), st.integers(1, 300), st.integers(1, 7))
def test_prbs_repeats_on_a_grid(order: int, onset: int, span: int, hold: int) -> None:
    h = 0.1
    term = {"kind": "prbs", "axis": 1, "from": h * onset, "until": h * (onset + span)}
    signal = parse({**term, "amplitude": 0.3, "clock": 1 / (h * hold), "order": order})
    k = np.arange(400)
    acts = (k >= onset) & (k < onset + span)
    bits = maximum_length_sequence(order)[(k - onset) // hold % (2**order - 1)]
    expected = np.where(acts, 0.3 * bits, 0.0)
    assert np.array_equal(signal(h * k)[:, 0], expected)
    assert np.array_equal(signal(h * k, before=True)[1:, 0], expected[:-1])
    # It jumps where the bit changes, and nowhere else.
    assert signal.jumps == pytest.approx(h * (np.flatnonzero(np.diff(expected)) + 1), abs=1e-12)
    signal.check_jumps("fault", h, 40.0)


def test_prbs_spectrum_is_flat_within_3_db_up_to_the_stated_frequency() -> None:
    # One period, 16 samples a bit: lines at multiples of 100/127 Hz.
    samples_a_bit = 16
    h = 0.01 / samples_a_bit
    values = parse({**PRBS, "amplitude": 1.0})(h * np.arange(127 * samples_a_bit))[:, 0]
    power = np.abs(np.fft.rfft(values)[1:127]) ** 2
    frequency = np.arange(1, 127) / 1.27
    flat = power > power[0] / 2
    assert flat[frequency < 0.443 * 100].all()
    assert not flat[frequency > 0.444 * 100].any()
    # Every line lies on that of a held bit (its samples have their Dirichlet kernel for a sinc).
    angle = np.pi * frequency / 100
    kernel = np.sin(angle) / np.sin(angle / samples_a_bit)
    assert power == pytest.approx(128 * kernel**2, rel=1e-9)


def test_prbs_jumps_off_the_grid_are_refused() -> None:
    signal = parse(PRBS)
    signal.check_grid("fault", 1e-3, 30.0)
    # Seven ones come first.
    with pytest.raises(InputError, match=r"^fault: jumps at 0.07 s, .* 0.06 and 0.08 s\)$"):
        signal.check_grid("fault", 0.02, 30.0)


def test_piecewise_constant_terms_have_zero_derivative() -> None:
    derivative = parse(SQUARE, RAMP, PRBS).derivative("fault")
    assert len(derivative.terms) == 1
    assert derivative.breaks == (0.5, 2.0)
    assert not derivative(GRID)[:, 0].any()


# --- Sweeps -------------------------------------------------------------------------------------


def swept(order: int, time: float, *, rising: bool) -> float:
    """The derivative of an order of ``SWEEP``, by differences of its closed form in 50 digits."""

    def law(t: mpmath.mpf) -> mpmath.mpf:
        s = t - mpmath.mpf(0.5)
        return 2 * mpmath.sin(s + 10 * s**2 / 8 if rising else 24 + 11 * (s - 4))

    with mpmath.workdps(50):
        return float(mpmath.diff(law, time, order))


@pytest.mark.parametrize("order", range(5))
def test_sweep_and_its_derivatives_agree_with_50_digits(order: int) -> None:
    signal = parse(SWEEP)
    for _ in range(order):
        signal = signal.derivative("fault")
    times = np.linspace(0.5, 9.5, 61)
    assert 4.5 not in times
    expected = [swept(order, t, rising=t < 4.5) for t in times]
    assert signal(times)[:, 0] == pytest.approx(expected, abs=1e-13 * 12.0**order)
    # The limits where the rise ends, which differ from the second derivative on.
    end = np.array([4.5])
    left, right = signal(end, before=True)[0, 0], signal(end)[0, 0]
    assert left == pytest.approx(swept(order, 4.5, rising=True), rel=1e-12)
    assert right == pytest.approx(swept(order, 4.5, rising=False), rel=1e-12)
    assert (abs(left - right) < 1e-10) == (order < 2)
    assert signal.breaks == (0.5, 4.5)
    assert signal(np.array([0.4]))[0, 0] == 0


def test_sweep_has_the_stated_frequency() -> None:
    # Zeros lie where the phase is a multiple of pi, and there the slope is the frequency.
    signal = parse(SWEEP)
    k = np.arange(1, 8)  # the phase at the end of the rise is 24
    frequency = np.sqrt(1 + 2 * 2.5 * k * np.pi)
    zeros = 0.5 + (frequency - 1) / 2.5
    assert zeros[-1] < 4.5
    assert signal(zeros)[:, 0] == pytest.approx(np.zeros(7), abs=1e-13)
    assert signal.derivative("u")(zeros)[:, 0] == pytest.approx(2 * (-1.0) ** k * frequency)
    # Later it is a sine of the frequency at the end.
    later = np.linspace(4.5, 9, 20)
    sine = {"kind": "sine", "axis": 1, "amplitude": 2.0, "frequency": 11.0}
    ahead = parse({**sine, "phase": 24 - 11 * 4.5})
    assert signal(later) == pytest.approx(ahead(later), abs=1e-13)


def test_sweep_may_decrease_to_zero_and_end_during_its_rise() -> None:
    falling = parse({**SWEEP, "start": 11.0, "end": 0.0})
    assert falling(np.array([4.5, 9.0]))[:, 0] == pytest.approx([2 * np.sin(22.0)] * 2, rel=1e-13)
    short = parse({**SWEEP, "until": 4.0})
    assert short.breaks == short.derivative("u").breaks == (0.5, 4.0)
    assert short(np.array([4.0, 4.5])).tolist() == [[0, 0, 0], [0, 0, 0]]
    with pytest.raises(InputError, match=r"^fault: jumps at 4.4 s"):
        parse({**SWEEP, "duration": 3.9}).check_grid("fault", 0.25, 9.0)


# --- Samples ------------------------------------------------------------------------------------

INSTANTS = np.array([0.5, 1.0, 2.0, 3.0])
VALUES = np.array([1.0, 3.0, -1.0, 0.5])


@pytest.fixture(params=["csv", "parquet"])
def record(request: pytest.FixtureRequest, tmp_path: Path) -> Path:
    path = tmp_path / f"torque.{request.param}"
    if path.suffix == ".csv":
        rows = (f"{float(t)!r},{float(v)!r}\n" for t, v in zip(INSTANTS, VALUES, strict=True))
        path.write_text("time,torque\n" + "".join(rows))
    else:
        parquet.write_table(pa.table({"time": INSTANTS, "torque": VALUES}), path)
    return path


def samples(path: Path, **changed: Any) -> dict[str, Any]:
    return {"kind": "samples", "axis": 1, "file": str(path), "column": "torque", **changed}


def test_linear_samples_are_interpolated(record: Path) -> None:
    signal = parse(samples(record))
    times = np.array([0.0, 0.4, 0.5, 0.75, 1.0, 1.5, 2.5, 3.0, 9.0])
    # Zero before the first sample, linear in between, the last one is held.
    expected = [0, 0, 1, 2, 3, 1, -0.25, 0.5, 0.5]
    assert signal(times)[:, 0] == pytest.approx(expected, abs=1e-15)
    assert signal(np.array([0.5]), before=True)[0, 0] == 0
    assert signal.onsets == signal.jumps == (0.5,)


def test_held_samples_jump_at_every_sample(record: Path) -> None:
    signal = parse(samples(record, interpolation="hold"))
    times = np.array([0.0, 0.5, 0.75, 1.0, 1.5, 2.0, 3.0, 9.0])
    assert signal(times)[:, 0].tolist() == [0, 1, 1, 3, 3, -1, 0.5, 0.5]
    assert signal(times, before=True)[:, 0].tolist() == [0, 0, 1, 1, 3, 3, -1, 0.5]
    assert signal.jumps == (0.5, 1.0, 2.0, 3.0)
    with pytest.raises(InputError, match=r"jumps at 0.5 s"):
        signal.check_grid("fault", 0.4, 5.0)


def test_samples_act_within_their_time_span(record: Path) -> None:
    signal = parse(samples(record, interpolation="hold", **{"from": 0.75, "until": 2.5}))
    times = np.array([0.5, 0.75, 1.0, 2.0, 2.5])
    assert signal(times)[:, 0].tolist() == [0, 1, 3, -1, 0]
    assert signal(times, before=True)[:, 0].tolist() == [0, 0, 1, 3, -1]
    assert signal.jumps == (0.75, 1.0, 2.0, 2.5)


@pytest.mark.parametrize("interpolation", ["linear", "hold"])
def test_samples_have_no_derivative(record: Path, interpolation: str) -> None:
    signal = parse(CONSTANT, samples(record, interpolation=interpolation))
    with pytest.raises(
        InputError,
        match=r"^u\[1\]: has no derivative in closed form; state it by constants, sines and ramps$",
    ):
        signal.derivative("u")


def test_sample_files_are_listed(record: Path) -> None:
    assert sample_files([CONSTANT, samples(record)]) == [str(record)]
    assert sample_files("nonsense") == []


# --- Invalid input ------------------------------------------------------------------------------


def without(term: dict[str, Any], key: str) -> dict[str, Any]:
    return {name: value for name, value in term.items() if name != key}


BAD_TERMS: list[tuple[Any, str]] = [
    ({**CONSTANT, "kind": "step"}, r"^fault\[0\].kind: 'step' must be one of constant, sine,"),
    (without(CONSTANT, "kind"), r"^fault\[0\].kind: None must be one of constant"),
    ({**CONSTANT, "kind": ["sine"]}, r"^fault\[0\].kind: \['sine'\] must be one of constant"),
    ("constant", r"^fault\[0\].kind: None must be one of"),
    ({**CONSTANT, "slope": 1.0}, r"^fault\[0\].slope: unknown key; a constant .* size, until$"),
    (without(CONSTANT, "size"), r"^fault\[0\].size: is missing; a constant term needs it$"),
    (without(SINE, "frequency"), r"^fault\[0\].frequency: is missing; a sine term needs it$"),
    ({**SINE, "frequency": 0.0}, r"^fault\[0\].frequency: 0 must be greater than zero$"),
    ({**SINE, "frequency": -1.0}, r"^fault\[0\].frequency: -1 must be greater than zero$"),
    ({**SINE, "amplitude": "big"}, r"^fault\[0\].amplitude: 'big' is not a number"),
    ({**SINE, "phase": [0.0]}, r"^fault\[0\].phase: \[0.0\] must be one number, not an array"),
    ({**CONSTANT, "axis": 4}, r"^fault\[0\].axis: 4 must be a whole number from 1 to 3$"),
    ({**CONSTANT, "axis": 0}, r"^fault\[0\].axis: 0 must be a whole number from 1 to 3$"),
    ({**CONSTANT, "axis": 1.0}, r"^fault\[0\].axis: 1.0 must be a whole number from 1 to 3$"),
    (without(CONSTANT, "axis"), r"^fault\[0\].axis: None must be a whole number from 1 to 3$"),
    ({**CONSTANT, "from": "early"}, r"^fault\[0\].from: 'early' is not a number"),
    ({**RAMP, "until": 0.5}, r"^fault\[0\].from: 0.5 s must be before 0.5 s, its end$"),
    ({**RAMP, "until": 0.1}, r"^fault\[0\].from: 0.5 s must be before 0.1 s, its end$"),
    ({**RAMP, "from": -1, "until": -2}, r"^fault\[0\].from: -1 s must be before -2 s, its end$"),
    ({"kind": "sine", "axis": 1, "until": -1, "amplitude": 1, "frequency": 1}, r"0 s must be bef"),
    (
        without(SQUARE, "until"),
        r"\[0\].until: is missing; a square .* it, or it would jump without",
    ),
    (
        without(PRBS, "until"),
        r"\[0\].until: is missing; a prbs .* it, or it would jump without end$",
    ),
    (without(SQUARE, "high"), r"^fault\[0\].high: is missing; a square term needs it$"),
    (without(PRBS, "clock"), r"^fault\[0\].clock: is missing; a prbs term needs it$"),
    (without(SWEEP, "duration"), r"^fault\[0\].duration: is missing; a sweep term needs it$"),
    ({**SQUARE, "until": None}, r"^fault\[0\].until: None is not a number"),
    ({**SQUARE, "period": 0}, r"^fault\[0\].period: 0 must be greater than zero$"),
    ({**SQUARE, "period": -2.0}, r"^fault\[0\].period: -2 must be greater than zero$"),
    ({**SQUARE, "period": "long"}, r"^fault\[0\].period: 'long' is not a number"),
    ({**SQUARE, "width": 0}, r"^fault\[0\].width: 0 s must be between 0 and the period 4 s$"),
    ({**SQUARE, "width": 4.0}, r"^fault\[0\].width: 4 s must be between 0 and the period 4 s$"),
    ({**SQUARE, "width": 5.0}, r"^fault\[0\].width: 5 s must be between 0 and the period 4 s$"),
    ({**SQUARE, "width": None}, r"^fault\[0\].width: None is not a number"),
    (
        {**SQUARE, "period": 1e-5},
        r"^fault\[0\].until: asks for 1600000 half periods, must ask for ",
    ),
    ({**PRBS, "until": 1e300}, r"^fault\[0\].until: asks for 1e\+302 bits, .* 1000000 or fewer$"),
    ({**PRBS, "clock": 0.0}, r"^fault\[0\].clock: 0 Hz must be between 0 and 1e\+09 Hz$"),
    ({**PRBS, "clock": -5}, r"^fault\[0\].clock: -5 Hz must be between 0 and 1e\+09 Hz$"),
    ({**PRBS, "clock": 2e9}, r"^fault\[0\].clock: 2e\+09 Hz must be between 0 and 1e\+09 Hz$"),
    ({**PRBS, "order": 1}, r"^fault\[0\].order: 1 must be a whole number from 2 to 16$"),
    ({**PRBS, "order": 17}, r"^fault\[0\].order: 17 must be a whole number from 2 to 16$"),
    ({**PRBS, "order": 7.5}, r"^fault\[0\].order: 7.5 must be a whole number from 2 to 16$"),
    ({**PRBS, "order": [7]}, r"^fault\[0\].order: \[7\] must be one number, not an array"),
    ({**SWEEP, "duration": 0.0}, r"^fault\[0\].duration: 0 must be greater than zero$"),
    ({**SWEEP, "start": -1.0}, r"^fault\[0\].start: -1 rad/s must not be negative$"),
    ({**SWEEP, "end": -2.0}, r"^fault\[0\].end: -2 rad/s must not be negative$"),
]


@pytest.mark.parametrize(("term", "sentence"), BAD_TERMS)
def test_invalid_terms_are_refused_in_one_sentence(term: Any, sentence: str) -> None:
    with pytest.raises(InputError, match=sentence):
        parse(term)


NEEDED = {
    "constant": ("size",),
    "sine": ("amplitude", "frequency"),
    "growing_sine": ("growth", "frequency"),
    "ramp": ("slope",),
    "square": ("high", "period"),
    "prbs": ("amplitude", "clock", "order"),
    "sweep": ("amplitude", "start", "end", "duration"),
    "samples": ("file", "column"),
}


@pytest.mark.parametrize(("kind", "key"), [(k, key) for k, keys in NEEDED.items() for key in keys])
def test_term_without_a_required_key_is_refused(kind: str, key: str) -> None:
    """All other required keys are given."""
    numbers = {"order": 7, "start": 0.5, "end": 2.0}
    words = {"file": "torque.csv", "column": "torque"}
    term = {name: words.get(name, numbers.get(name, 1.0)) for name in NEEDED[kind] if name != key}
    with pytest.raises(
        InputError, match=rf"^fault\[0\]\.{key}: is missing; a {kind} term needs it$"
    ):
        parse({"kind": kind, "axis": 1, "until": 5.0, **term})


def test_position_of_an_invalid_term_is_named() -> None:
    with pytest.raises(InputError, match=r"^fault\[2\].axis: 9 "):
        parse(CONSTANT, SINE, {**RAMP, "axis": 9})
    with pytest.raises(InputError, match=r"^fault: 'sine' must be a list of terms$"):
        Signal.parse("fault", "sine", 3)


def test_invalid_samples_are_refused(record: Path) -> None:
    with pytest.raises(InputError, match=r"^fault\[0\].interpolation: 'cubic' must be linear or "):
        parse(samples(record, interpolation="cubic"))
    with pytest.raises(InputError, match=r"^fault\[0\].until: 0.4 s, .* samples start at 0.5 s$"):
        parse(samples(record, until=0.4))


def test_growing_sine_and_its_derivatives_are_exact() -> None:
    term = {"kind": "growing_sine", "axis": 1, "from": 4, "until": 10, "growth": 0.01,
            "frequency": 0.5 * np.pi, "phase": 0.3}  # fmt: skip
    signal = Signal.parse("fault", [term], 1)
    time = np.array([3.9, 4.0, 5.5, 9.99, 10.0])
    for order in range(3):
        with mpmath.workdps(50):
            found = [
                float(mpmath.diff(lambda t: 0.01 * t * mpmath.sin(0.5 * np.pi * t + 0.3), t, order))
                if 4 <= t < 10 else 0.0
                for t in time
            ]  # fmt: skip
        assert signal(time)[:, 0] == pytest.approx(found, rel=1e-13, abs=1e-15)
        signal = signal.derivative("fault")


def test_signal_that_overflows_is_refused() -> None:
    terms = [{"kind": "ramp", "axis": 1, "slope": 1e308}]
    with pytest.raises(InputError, match=r"^signal: is not finite at t = 2 s$"):
        Signal.parse("fault", terms, 1)(np.array([0.0, 1.0, 2.0]))


def test_decreasing_times_are_refused() -> None:
    with pytest.raises(InputError, match=r"^time: "):
        Signal.parse("fault", [], 1)([0.0, -1.0])
