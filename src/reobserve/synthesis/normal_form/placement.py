"""A linear output injection from the poles that the error dynamics are to have."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from reobserve.core.arguments import as_kind, as_poles
from reobserve.core.balancing import Scales, output_scales
from reobserve.core.errors import InputError
from reobserve.synthesis.linear_gain import unobservable_modes
from reobserve.synthesis.normal_form.problem import refuse_undetectable
from reobserve.systems.polynomial import PolynomialSystem

_MODERATE = 10.0  # powers of two between scales of states that are left as they are
_REACHED = 1e-6  # relative distance at which a pole counts as placed


@np.errstate(over="ignore", invalid="ignore")  # what is not finite is refused
def injection_for(system: PolynomialSystem, poles: Sequence[complex]) -> NDArray[np.float64]:
    """L0, shape (n, p), that gives A = F + L0 H the ``poles`` [1/s]."""
    from scipy.signal import place_poles

    as_kind("system", system, PolynomialSystem)
    F, H = system.F.astype(np.float64), system.H.astype(np.float64)
    wanted = np.sort_complex(as_poles("poles", poles))
    shown = ", ".join(f"{pole:g}" for pole in wanted)
    if len(wanted) != len(F):
        raise InputError("poles", f"{shown}: {len(wanted)} given, must be {len(F)}")
    if not np.allclose(wanted, np.sort_complex(wanted.conj())):
        raise InputError("poles", f"{shown} must come in conjugate pairs")
    if np.max(wanted.real) >= 0:
        raise InputError("poles", f"{shown} must all have negative real parts")
    refuse_undetectable(system)
    remaining = [
        mode
        for mode in unobservable_modes(F, H)
        if np.min(np.abs(wanted - mode)) > _REACHED * max(1.0, abs(mode))
    ]
    if remaining:
        raise InputError(
            "poles",
            f"{shown} cannot be placed, {', '.join(f'{mode:.4g}' for mode in remaining)} remain: "
            "the pair (F, H) is not observable; keep the modes that the output does not show "
            "among the poles, or give the injection itself",
        )
    # Outputs that say the same twice are taken together: scipy wants H of full rank.
    scales = output_scales(F, H).completed(F).rounded()
    if np.ptp(scales.states) <= _MODERATE:
        scales = Scales(np.zeros(len(F)), np.zeros(len(H)), 0.0)
    F, H = scales.transition(F), scales.output(H)
    U, sizes, V = np.linalg.svd(H)
    rank = int(np.sum(sizes > _REACHED * sizes[0]))
    reduced = sizes[:rank, None] * V[:rank]
    try:
        gain = -place_poles(F.T, reduced.T, wanted).gain_matrix.T @ U[:, :rank].T
    except (ValueError, np.linalg.LinAlgError) as error:
        reason = " ".join(str(error).split()).rstrip(".").split(". ")[0]
        raise InputError("poles", f"{shown} cannot be placed: {reason}") from None
    reached = np.linalg.eigvals(F + gain @ H)
    # Compared by the characteristic polynomial: the order of near poles is not defined.
    off = np.abs(np.poly(reached) - np.poly(wanted))
    if np.any(off > _REACHED * np.maximum(1.0, np.abs(np.poly(wanted)))):
        raise InputError(
            "poles",
            f"{shown} cannot be placed, only {', '.join(f'{v:.4g}' for v in reached)}: the pair "
            "(F, H) is hardly observable; give the injection itself",
        )
    injection: NDArray[np.float64] = np.ascontiguousarray(scales.gain(gain.real))
    return injection
