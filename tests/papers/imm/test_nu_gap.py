"""The nu-gap: printed values, closed forms, 50 digits, and its meaning for a feedback loop."""

from __future__ import annotations

from itertools import permutations, product
from typing import Any

import mpmath
import numpy as np
import pytest
from numpy.typing import ArrayLike, NDArray

from reobserve.core.errors import InputError
from reobserve.papers.imm.nu_gap import (
    _distance,
    _stationary_frequencies,
    nu_gap,
)

Array = NDArray[np.float64]
Plant = tuple[ArrayLike, ArrayLike]

# Three identified models of an electrohydrostatic actuator.
NORMAL = ([27.03, 9577, 1.87e6, 1.65e8], [1, 535.20, 7.38e4, 6.08e6, 1.813e8])
FRICTION = ([11.29, 1883, 1.77e5, 6.61e6], [1, 151.80, 1.28e4, 6.14e5, 1.07e7])
LEAKAGE = ([2.34, 910.60, 1.63e5, 1.32e7], [1, 116, 2.70e4, 1.41e6, 3.521e7])

# Zhou & Doyle, Essentials of Robust Control, chapter 17.
LAG = ([100], [2, 1])
UNSTABLE = ([100], [2, -1])
SECOND_ORDER = ([100], [1, 2, 1])


def random_plant(rng: np.random.Generator, order: int, spread: float = 1.0) -> tuple[Array, Array]:
    """Gain, zeros and poles over this many decades each way; a quarter of the roots on the
    right."""

    def polynomial(degree: int) -> Array:
        value = np.ones(1)
        while len(value) <= degree:
            size = 10 ** rng.uniform(-spread, spread)
            sign = rng.choice([1, 1, 1, -1])
            if degree - len(value) >= 1 and rng.random() < 0.6:
                damping = 10 ** rng.uniform(-2, 0)
                value = np.convolve(value, [1, 2 * sign * damping * size, size**2])
            else:
                value = np.convolve(value, [1, sign * size])
        return value

    gain = rng.choice([-1, 1]) * 10 ** rng.uniform(-spread, spread)
    return gain * polynomial(int(rng.integers(0, order + 1))), polynomial(order)


# --- Known answers ------------------------------------------------------------------------------


@pytest.mark.parametrize(("k1", "k2"), [(2, 3), (-1, 2), (0.1, -30), (1, -1), (1e-9, 1e9)])
def test_distance_of_static_gains_is_the_chordal_distance(k1: float, k2: float) -> None:
    expected = abs(k1 - k2) / np.hypot(1, k1) / np.hypot(1, k2)
    assert nu_gap(([k1], [1]), ([k2], [1])) == pytest.approx(expected, rel=1e-15)


def test_plants_of_zhou_and_doyle_have_the_published_gaps() -> None:
    # |n1 d2 - n2 d1| = 200 and both lengths are 100^2 + 1 + 4 omega^2: largest at omega = 0.
    assert nu_gap(LAG, UNSTABLE) == pytest.approx(200 / 10001, rel=1e-14)
    assert nu_gap(LAG, SECOND_ORDER) == pytest.approx(0.8988, abs=5e-5)
    assert nu_gap(UNSTABLE, SECOND_ORDER) == pytest.approx(0.8941, abs=5e-5)


@pytest.mark.parametrize("ratio", [1.001, 1.5, 40.0])
def test_integrators_differ_most_between_their_crossovers(ratio: float) -> None:
    # (k - 1) w / sqrt((1 + w^2)(k^2 + w^2)) is largest at w^2 = k; the poles are on the axis.
    expected = (ratio - 1) / (ratio + 1)
    found = nu_gap(([3e4], [1, 0]), ([3e4 * ratio], [1, 0]))
    assert found == pytest.approx(expected, rel=1e-12)


def test_undamped_oscillators_differ_most_between_their_frequencies() -> None:
    # For 1 / (s^2 + a^2) and 1 / (s^2 + b^2) with x = s^2 + a^2 and c = b^2 - a^2, kappa is
    # c / sqrt((1 + x^2)(1 + (x + c)^2)), largest at x = -c / 2 for c below 2.
    c = 0.6
    found = nu_gap(([1], [1, 0, 1]), ([1], [1, 0, 1 + c]))
    assert found == pytest.approx(c / (1 + c**2 / 4), rel=1e-14)


def test_gap_is_one_for_orthogonal_graphs() -> None:
    # c = 2 in the formula above: phi has a root on the axis.
    assert nu_gap(([1], [1, 0, 1]), ([1], [1, 0, 3])) == pytest.approx(1, abs=1e-14)
    assert nu_gap(([2, 1], [1, 3]), ([-0.5, 1], [1, 5])) == pytest.approx(1, abs=1e-14)
    # phi vanishes identically.
    assert nu_gap(([1, 2], [1, 3]), ([1, -3], [-1, 2])) == pytest.approx(1, abs=1e-14)


# --- Independent computation with 50 digits -----------------------------------------------------


def chordal_distance_with_50_digits(first: Plant, second: Plant) -> float:
    """The supremum of kappa, from all stationary points of its square in omega^2."""

    def exact(coefficients: ArrayLike) -> list[Any]:
        return [mpmath.mpf(float(c)) for c in np.asarray(coefficients, dtype=float)[::-1]]

    def times(p: list[Any], q: list[Any]) -> list[Any]:
        out = [mpmath.mpf(0)] * (len(p) + len(q) - 1)
        for (i, a), (j, b) in product(enumerate(p), enumerate(q)):
            out[i + j] += a * b
        return out

    def plus(p: list[Any], q: list[Any], sign: int = 1) -> list[Any]:
        size = max(len(p), len(q))
        p, q = (x + [mpmath.mpf(0)] * (size - len(x)) for x in (p, q))
        return [a + sign * b for a, b in zip(p, q, strict=True)]

    def square(p: list[Any]) -> list[Any]:
        whole = times(p, [(-1) ** k * c for k, c in enumerate(p)])
        return [(-1) ** k * c for k, c in enumerate(whole[::2])]

    def slope(p: list[Any]) -> list[Any]:
        return [k * c for k, c in enumerate(p)][1:]

    with mpmath.workdps(50):
        (n1, d1), (n2, d2) = (tuple(map(exact, plant)) for plant in (first, second))
        difference = plus(times(n1, d2), times(n2, d1), -1)
        while not difference[-1]:
            difference.pop()
        above = square(difference)
        below = times(plus(square(n1), square(d1)), plus(square(n2), square(d2)))
        stationary = plus(times(slope(above), below), times(above, slope(below)), -1)
        if len(above) == len(below):  # the leading coefficients cancel
            stationary.pop()
        roots = mpmath.polyroots(stationary[::-1], maxsteps=500, extraprec=500)
        real = [r.real for r in roots if r.real > 0 and abs(r.imag) < 1e-20 * abs(r)]
        found = [mpmath.polyval(above[::-1], w) / mpmath.polyval(below[::-1], w) for w in real]
        limit = above[-1] / below[-1] if len(above) == len(below) else mpmath.mpf(0)
        return float(mpmath.sqrt(max([above[0] / below[0], limit, *found])))


def winding(first: Plant, second: Plant) -> int:
    """wno(1 + P2* P1) + eta(P1) - eta(P2) from a plot, for plants without poles on the axis."""
    (n1, d1), (n2, d2) = first, second
    s = 1j * np.tan(np.linspace(-np.pi / 2, np.pi / 2, 40002)[1:-1])
    back = np.polyval(n2, -s) / np.polyval(d2, -s)
    phase = np.unwrap(np.angle(1 + back * np.polyval(n1, s) / np.polyval(d1, s)))
    clockwise = -(phase[-1] - phase[0]) / (2 * np.pi)
    unstable = [np.count_nonzero(np.roots(np.asarray(d)).real > 0) for d in (d1, d2)]
    return round(clockwise + unstable[0] - unstable[1])


@pytest.mark.parametrize(
    ("first", "second", "printed"),
    [(NORMAL, LEAKAGE, 0.408), (NORMAL, FRICTION, 0.253), (FRICTION, LEAKAGE, 0.193)],
)
def test_gaps_of_the_actuator_models_agree_with_50_digits(
    first: Plant, second: Plant, printed: float
) -> None:
    found = nu_gap(first, second)
    assert found == pytest.approx(printed, abs=5e-4)
    assert winding(first, second) == 0
    assert found == pytest.approx(chordal_distance_with_50_digits(first, second), abs=1e-13)


@pytest.mark.parametrize("spread", [0.5, 3.0])
def test_gaps_of_nearby_random_plants_agree_with_50_digits(spread: float) -> None:
    rng = np.random.default_rng(11)
    values = []
    for _ in range(15):
        first = random_plant(rng, int(rng.integers(1, 5)), spread)
        second = tuple(p * (1 + 0.01 * rng.normal(size=len(p))) for p in first)
        found = nu_gap(first, second)
        if found < 1:
            expected = chordal_distance_with_50_digits(first, second)
            assert found == pytest.approx(expected, abs=1e-12)
            values.append(found)
    assert len(values) > 8


@pytest.mark.parametrize("ratio", [1.5, 4.0, 30.0])
def test_search_starts_where_integrators_differ_most(ratio: float) -> None:
    """At the geometric mean of their crossovers; at zero and infinite frequency they agree."""
    first, second = (np.array([0.0, gain]) for gain in (0.5, 0.5 * ratio))
    integrator = np.array([1.0, 0.0])
    found = _stationary_frequencies((first, integrator), (second, integrator))
    assert np.abs(found - 0.5 * np.sqrt(ratio)).min() < 1e-12


def test_search_starts_at_every_peak_of_the_distance() -> None:
    """On a dense grid, for resonances that are not so sharp that roots are rounded."""
    rng, peaks = np.random.default_rng(5), 0
    omega = np.geomspace(1e-3, 1e3, 100_001)
    for _ in range(20):
        size, damping = rng.uniform(0.3, 3.0, 2), rng.uniform(0.03, 0.3, 2)
        numerator = rng.uniform(0.3, 3.0) * np.array([0.0, 1.0, 2 * damping[0], size[0] ** 2])
        denominator = np.convolve([1.0, size[0]], [1.0, 2 * damping[1] * size[1], size[1] ** 2])
        first = numerator, denominator
        second = numerator * rng.uniform(0.8, 1.2, 4), denominator * rng.uniform(0.8, 1.2, 4)
        distance = _distance(first, second, np.arctan(omega))
        found = np.log(_stationary_frequencies(first, second))
        inner = distance[1:-1]
        for place in np.flatnonzero((inner > distance[:-2]) & (inner > distance[2:])) + 1:
            assert np.abs(found - np.log(omega[place])).min() < 1e-3
            peaks += 1
    assert peaks > 20


def test_gap_is_one_exactly_if_the_winding_condition_fails() -> None:
    rng = np.random.default_rng(12)
    counts = [0, 0]
    for _ in range(60):
        first, second = (
            (rng.normal(size=rng.integers(1, order + 2)), rng.normal(size=order + 1))
            for order in rng.integers(1, 4, size=2)
        )
        holds = winding(first, second) == 0
        counts[holds] += 1
        expected = chordal_distance_with_50_digits(first, second) if holds else 1.0
        assert nu_gap(first, second) == pytest.approx(expected, abs=1e-12)
    assert min(counts) > 15


# --- Properties of a metric ---------------------------------------------------------------------


def test_gap_is_symmetric_and_satisfies_the_triangle_inequality() -> None:
    rng = np.random.default_rng(13)
    proper = 0
    for _ in range(60):
        base = random_plant(rng, 3)
        plants = [tuple(p * (1 + 0.1 * rng.normal(size=len(p))) for p in base) for _ in range(3)]
        plants[2] = random_plant(rng, 2) if rng.random() < 0.3 else plants[2]
        gaps = {(i, j): nu_gap(plants[i], plants[j]) for i, j in permutations(range(3), 2)}
        for i, j, k in permutations(range(3)):
            assert gaps[i, j] == pytest.approx(gaps[j, i], abs=1e-13)
            assert gaps[i, j] <= gaps[i, k] + gaps[k, j] + 1e-13
            assert 0 < gaps[i, j] <= 1
        proper += max(gaps.values()) < 1
    assert proper > 15


@pytest.mark.parametrize("plant", [NORMAL, FRICTION, LEAKAGE, LAG, UNSTABLE, ([1e-9], [1, 0, 1])])
def test_equal_plants_have_no_gap_in_any_scaling(plant: Plant) -> None:
    # The last one: phi = (s^2 + 1)^2 + 1e-18, which rounding would put on the axis.
    assert nu_gap(plant, plant) == 0
    scaled = tuple(-8.0 * np.asarray(p) for p in plant)
    assert nu_gap(plant, scaled) == pytest.approx(0, abs=1e-15)


@pytest.mark.parametrize("factor", [-3.0, 1e-6, 7e40])
def test_gap_does_not_depend_on_scaling_leading_zeros_or_time_unit(
    factor: float,
) -> None:
    expected = nu_gap(NORMAL, LEAKAGE)
    scaled = tuple(np.append([0.0, 0.0], factor * np.asarray(p)) for p in LEAKAGE)
    assert nu_gap(NORMAL, scaled) == pytest.approx(expected, rel=1e-13)
    unit = np.abs(factor) ** 0.25
    faster = [
        tuple(np.asarray(p) * unit ** np.arange(len(p))[::-1] for p in plant)
        for plant in (NORMAL, LEAKAGE)
    ]
    assert nu_gap(*faster) == pytest.approx(expected, rel=1e-13)


def test_inverse_plants_have_the_same_gap() -> None:
    rng = np.random.default_rng(14)
    below = 0
    for _ in range(40):
        n1, d1 = rng.normal(size=(2, 4))
        n2, d2 = n1 + 0.1 * rng.normal(size=4), d1 + 0.1 * rng.normal(size=4)
        gap = nu_gap((n1, d1), (n2, d2))
        assert nu_gap((d1, n1), (d2, n2)) == pytest.approx(gap, abs=1e-13)
        below += gap < 1
    assert below > 10


# --- Meaning for a feedback loop ----------------------------------------------------------------


@pytest.mark.parametrize("gain", [0.1, 0.9, 0.9999, 1.0001, 1.1, 30.0])
def test_unstable_pole_is_near_a_gain_only_if_feedback_stabilises_it(gain: float) -> None:
    # phi = k^2 - 1 - s has its root at the mirror image of the pole that feedback of k gives to
    # k / (s - 1): on the right, as required, for k above 1. kappa is monotone in omega.
    rest, fast = 2 * gain / (1 + gain**2), gain / np.hypot(1, gain)
    expected = max(rest, fast) if gain > 1 else 1.0
    pair = ([gain], [1]), ([gain], [1, -1])
    assert nu_gap(*pair) == pytest.approx(expected, rel=1e-14)
    assert nu_gap(*pair[::-1]) == pytest.approx(expected, rel=1e-14)


def test_gap_is_one_if_a_pole_changes_sides_even_for_small_gains() -> None:
    pair = ([0.1], [1, 1]), ([0.1], [1, -1])
    assert chordal_distance_with_50_digits(*pair) == pytest.approx(0.2 / 1.01, rel=1e-14)
    assert nu_gap(*pair) == 1


def test_gain_with_margin_above_the_gap_stabilises_both_plants() -> None:
    rng = np.random.default_rng(15)

    def stable(plant: Plant, gain: float) -> bool:
        """The loop u = -gain y: its characteristic polynomial is d + gain n."""
        loop = np.polyadd(np.asarray(plant[1]), gain * np.asarray(plant[0]))
        return bool(np.all(np.roots(loop).real < 0))

    s = 1j * np.tan(np.linspace(0, np.pi / 2, 4001)[:-1])
    promised = broken = 0
    for _ in range(400):
        n, d = random_plant(rng, 2)
        gain = rng.normal() / 2
        if len(n) > 2 or not stable((n, d), gain):
            continue
        # The smallest chordal distance from the plant to -1 / gain, the point it must avoid.
        n_s, d_s = np.polyval(n, s), np.polyval(d, s)
        lengths = np.hypot(1, gain) * np.hypot(np.abs(n_s), np.abs(d_s))
        margin = np.min(np.abs(d_s + gain * n_s) / lengths)
        other = tuple(p + rng.normal(size=len(p)) * rng.choice([0.1, 1]) for p in (n, d))
        if nu_gap((n, d), other) < 0.99 * margin:
            promised += 1
            assert stable(other, gain)
        else:
            broken += not stable(other, gain)
    assert promised > 20
    assert broken > 20


# --- Bad input ----------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("plant", "said"),
    [
        (([], [1, 1]), r"numerator: \[\] must be a list of coefficients, one of them not zero"),
        (("s", [1, 1]), "numerator: 's' is not a number or an array of numbers"),
        (([0, 0], [1, 1]), r"numerator: \[0.0, 0.0\] must be a list of coefficients, one of them"),
        (([1], [0]), r"denominator: \[0.0\] must be a list of coefficients, one of them not zero"),
        ((1, [1, 1]), r"numerator: 1.0 must be a list of coefficients"),
        (([[1]], [1, 1]), r"numerator: \[\[1.0\]\] must be a list of coefficients"),
        (([1], [1, np.nan]), r"denominator: \[1.0, nan\] has an entry that is not finite"),
        (([1, 0, 0], [0, 1, 1]), r": has a numerator of degree 2, must not exceed that of the den"),
        (([1, -1], [1, 1, -2]), r": has the factor \[1.0, -1.0\] in numerator and denominator"),
        (([2, 0], [1, 1, 0]), r": has the factor \[1.0, 0.0\] in numerator and denominator"),
        (([1], [1, 1], 0.1), r": has 3 entries, must be a numerator and a denominator"),
    ],
)
def test_wrong_plants_are_refused(plant: Any, said: str) -> None:
    with pytest.raises(InputError, match=f"^first.?{said}"):
        nu_gap(plant, LAG)
    with pytest.raises(InputError, match=f"^second.?{said}"):
        nu_gap(LAG, plant)
