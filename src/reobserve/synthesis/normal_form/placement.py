"""A linear output injection from the poles that the error dynamics are to have."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from reobserve.errors import InputError
from reobserve.polynomial_system import PolynomialSystem

_REACHED = 1e-6  # relative distance at which a pole counts as placed


def injection_for(system: PolynomialSystem, poles: Sequence[complex]) -> NDArray[np.float64]:
    """L0, shape (n, p), that gives A = F + L0 H the ``poles`` [1/s].

    Raises
    ------
    InputError
        If there are not n poles, closed under conjugation, all stable, none repeated more often
        than there are outputs; or the pair (F, H) does not let them be placed.
    """
    from scipy.signal import place_poles

    F, H = system.F.astype(np.float64), system.H.astype(np.float64)
    wanted = np.sort_complex(np.asarray(poles, dtype=np.complex128).ravel())
    shown = ", ".join(f"{pole:g}" for pole in wanted)
    if len(wanted) != len(F):
        raise InputError("poles", f"{shown}: {len(wanted)} given, must be {len(F)}")
    if not np.allclose(wanted, np.sort_complex(wanted.conj())):
        raise InputError("poles", f"{shown} must come in conjugate pairs")
    if np.max(wanted.real) >= 0:
        raise InputError("poles", f"{shown} must all have negative real parts")
    try:
        gain = -place_poles(F.T, H.T, wanted).gain_matrix.T
        reached = np.sort_complex(np.linalg.eigvals(F + gain @ H))
    except (ValueError, np.linalg.LinAlgError) as error:
        reason = " ".join(str(error).split()).rstrip(".")
        raise InputError("poles", f"{shown} cannot be placed: {reason}") from None
    # Compared by the characteristic polynomial: the order of near poles is not defined.
    off = np.abs(np.poly(reached) - np.poly(wanted))
    if np.any(off > _REACHED * np.maximum(1.0, np.abs(np.poly(wanted)))):
        raise InputError(
            "poles",
            f"{shown} cannot be placed, eigenvalues {', '.join(f'{v:.4g}' for v in reached)} "
            "remain: the pair (F, H) is not observable; keep the modes that the output does not "
            "show among the poles, or give the injection itself",
        )
    found: NDArray[np.float64] = np.ascontiguousarray(gain.real)
    return found
