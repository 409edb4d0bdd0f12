"""Systems x' = f(x), y = h(x) whose right-hand sides are polynomials or truncated series."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from reobserve.core.arguments import as_kind
from reobserve.core.errors import InputError
from reobserve.core.value import Value, converter
from reobserve.polynomials.arithmetic import Coefficients
from reobserve.polynomials.expressions import from_expressions
from reobserve.polynomials.maps import PolynomialMap


@dataclass(frozen=True, eq=False, repr=False)
class PolynomialSystem(Value):
    """Autonomous system x' = f(x), y = h(x) with an equilibrium at the origin, where y = 0.

    Thomas, Kwatny & Chang, (1) and after (7).

    Parameters
    ----------
    dynamics
        f, n components in n variables.
    output
        h, p components in n variables.

    Raises
    ------
    InputError
        If the sizes do not fit, or f or h is not zero at the origin.

    Examples
    --------
    >>> from reobserve import PolynomialSystem
    >>> pendulum = (["w", "-sin(a) - w/10"], ["a"], ["a", "w"])
    >>> system = PolynomialSystem.from_expressions(*pendulum, degree=3)
    >>> print(system.states, system.F.tolist())
    2 [[0.0, 1.0], [-1.0, -0.1]]
    """

    dynamics: PolynomialMap = field(metadata=converter(as_kind, PolynomialMap))
    output: PolynomialMap = field(metadata=converter(as_kind, PolynomialMap))

    def __post_init__(self) -> None:
        super().__post_init__()
        n = self.dynamics.variables
        if self.dynamics.components != n:
            raise InputError(
                "dynamics", f"has {self.dynamics.components} components in {n} variables"
            )
        if self.output.variables != n:
            raise InputError("output", f"has {self.output.variables} variables, must have {n}")
        if self.dynamics.exact != self.output.exact:
            raise InputError("output", "must be exact if the dynamics are, and only then")
        for name, polynomials in (("dynamics", self.dynamics), ("output", self.output)):
            constant = polynomials.coefficients[:, 0]
            for component in np.flatnonzero(constant):
                raise InputError(
                    f"{name}.{component + 1}",
                    f"has the constant term {constant[component]}, must be zero at the origin; "
                    "shift the variables so that the equilibrium is there",
                )

    @classmethod
    def from_expressions(
        cls,
        dynamics: Sequence[Any],
        output: Sequence[Any],
        variables: Sequence[Any],
        degree: int,
    ) -> PolynomialSystem:
        """The system of expressions of sympy, or of text that it reads, expanded up to a degree.

        Parameters
        ----------
        dynamics, output
            f and h, n and p expressions.
        variables
            The n states: symbols, or their names.
        degree
            Of the polynomials.

        Raises
        ------
        InputError
            If one of them has no Taylor series at the origin, or is not zero there.
        """
        return cls(
            from_expressions("dynamics", dynamics, variables, degree),
            from_expressions("output", output, variables, degree),
        )

    @property
    def states(self) -> int:
        """The number of states n."""
        return self.dynamics.variables

    @property
    def outputs(self) -> int:
        """The number of outputs p."""
        return self.output.components

    @property
    def F(self) -> Coefficients:
        """df/dx at the origin, shape (n, n)."""
        return self.dynamics.matrix

    @property
    def H(self) -> Coefficients:
        """dh/dx at the origin, shape (p, n)."""
        return self.output.matrix
