"""The gain of the identity observer, L(x) = dT/dz at z = S(x), as a series.

As T(S(x)) = x it is the inverse of dS/dx, so S alone is enough: with M = (S')^-1,

    M_0 = I,    M_k = -(S'_1 M_(k-1) + ... + S'_k M_0).

A gain truncated at an order has three variants, which agree in the limit only:

    series      the series of L up to the order, as the paper has it
    jacobian    the inverse of dS/dx, S up to one degree more
    composed    dT/dz at z = S(x), both up to one degree more
"""

from __future__ import annotations

import numpy as np

from reobserve.core.arguments import as_word
from reobserve.polynomials.arithmetic import Coefficients, add_applied, zeros
from reobserve.polynomials.maps import PolynomialMap

GAINS = ("series", "jacobian", "composed")


def gain_series(S: PolynomialMap) -> PolynomialMap:
    """L up to one degree less than S: component n c + i is its entry (c, i).

    Thomas, Kwatny & Chang, after (7), Remarks 4.22 and 4.23.
    """
    jacobian = S.jacobian()
    basis, n = jacobian.basis, S.variables
    gain = zeros(jacobian.coefficients.shape, jacobian.coefficients)
    gain[:: n + 1, 0] = 1
    for k in range(1, S.degree):
        part = basis.part(k)
        for column in range(n):
            fed: Coefficients = zeros((n, gain.shape[1]), gain)
            vector = np.ascontiguousarray(gain[column::n])
            for j in range(1, k + 1):
                add_applied(basis, jacobian.coefficients, vector, j, k - j, fed)
            gain[column::n, part] = -fed[:, part]
    return PolynomialMap(basis, gain)


def gain_at(
    gain: str,
    order: int,
    S: PolynomialMap,
    T: PolynomialMap,
    series: PolynomialMap,
    x: Coefficients,
) -> Coefficients:
    """The gain L of an order, read in one of the three ways, at points of shape (k, n).

    Thomas, Kwatny & Chang, Remark 4.23.

    ``series`` is `gain_series` of S; the result has shape (k, n, n).
    """
    as_word("gain", gain, GAINS)
    n = S.variables
    if order == 0:
        return np.broadcast_to(np.eye(n), (len(x), n, n))
    if gain == "series":
        values = series.upto(order)(x)
    elif gain == "composed":
        values = T.upto(order + 1).jacobian()(S.upto(order + 1)(x))
    else:
        return np.linalg.inv(S.upto(order + 1).jacobian()(x).reshape(-1, n, n))
    matrices: Coefficients = values.reshape(-1, n, n)
    return matrices
