"""Rules of filters beside their model, in C: angles, outliers, and an R that is estimated."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from reobserve.codegen.expressions import Name, call
from reobserve.codegen.program import ZERO, Program
from reobserve.observers.kalman import BEGUN

Array = NDArray[np.float64]

# S or e may be left out of, or widened, by the gate; see `kalman.gate`.
_GATE = """\
for (int32_t i = 0; i < {m}; ++i) {{
    const double deviations = {e}[i] / sqrt({S}[i][i]);
    {outlier}[i] = 0.0;
    if ({valid}[i] > 0.5 && fabs(deviations) > {gate}) {{
        {outlier}[i] = deviations;
        {act}
    }}
}}
"""
_SKIP = "{e}[i] = 0.0;\n        {valid}[i] = 0.0;"
_INFLATE = (
    "const double wider = ({e}[i] / {gate}) * ({e}[i] / {gate});\n"
    "        {noise}[i][i] += wider - {S}[i][i];\n        {S}[i][i] = wider;"
)

# What a row says of the variances of R, by L w = R_o; see `kalman.learn_noise`.
_LEARN = """\
for (int32_t o = 0; o < {m}; ++o) {{
    double known = 0.0;
    double unknown = 0.0;
    {change}[o] = 0.0;
    if ({valid}[o] > 0.5{regular}) {{
        for (int32_t q = 0; q < {m}; ++q) {{
            double total = ({valid}[q] > 0.5) ? {noise}[q][o] : 0.0;
            for (int32_t i = 0; i < q; ++i) {{
                total -= {L}[q][i] * {column}[i];
            }}
            {column}[q] = total / {L}[q][q];
            known += {column}[q] * {w}[q];
            unknown += {column}[q] * {column}[q];
        }}
        {change}[o] = {weight} * (known * known - unknown);
    }}
}}
"""


class FilterRules:
    """The rules of an observer as a program has them, and their parts of its memory."""

    def __init__(self, program: Program, observer: Any, state: Any, outputs: int) -> None:
        self.program, rules, p = program, observer._rules, outputs
        self.states, self.outputs = rules.state_periods, rules.output_periods
        self.gate, self.inflates = rules.gate, rules.inflates
        self.forgetting = rules.forgetting
        self.outlier = program.local("outlier", (p,))
        self.noise = program.local("noise", (p, p))
        self.change = program.local("noise_change", (p,))
        if self.forgetting:
            self.variances = program.remember("noise_variance", state.noise)
            begun = state.count + (state.sample is not None)
            self.rows = program.counter("rows", begun)

    def wrap(self, values: Name, periods: Array) -> None:
        """Move angles to within half a period around zero."""
        for place, period in enumerate(periods.tolist()):
            if period:
                angle = values[place]
                turns = call("floor", angle / period + 0.5)
                self.program.let(angle, angle - period * turns)

    def reset(self, row: str) -> None:
        """Begin a row that may be missing without an outlier and without a change of R."""
        if np.isfinite(self.gate):
            self.program.let(self.outlier[row], ZERO)
        if self.forgetting:
            self.program.let(self.change[row], ZERO)

    def noise_of(self, R: Name) -> Name:
        """R as it is used at a row."""
        program, noise, p = self.program, self.noise, R.shape[0]
        if not (self.forgetting or (self.inflates and np.isfinite(self.gate))):
            return R
        program.let(noise, R)
        if self.forgetting:
            for o in range(p):
                for q in range(p):
                    if o == q:
                        program.let(noise[o, o], self.variances[o])
                    else:
                        ratio = self.variances[o] / R[o, o] * (self.variances[q] / R[q, q])
                        program.let(noise[o, q], R[o, q] * call("sqrt", ratio))
        return noise

    def apply_gate(self, e: Name, valid: Name, S: Name) -> None:
        """Leave out what is beyond the gate, or widen its variance."""
        if not np.isfinite(self.gate):
            return
        act = (_INFLATE if self.inflates else _SKIP).format(
            e=e, valid=valid, S=S, gate=self.gate, noise=self.noise
        )
        self.program.code(
            self.outlier, _GATE, m=e.shape[0], outlier=self.outlier, act=Name(act), e=e,
            valid=valid, S=S, gate=self.gate,
        )  # fmt: skip

    def learn(self, L: Name, valid: Name, noise: Name) -> None:
        """Write what the row says of R, after its log-likelihood has written L^-1 e to ``w``."""
        if not self.forgetting:
            return
        program, p = self.program, L.shape[0]
        weight = program.local("weight_of_row")
        program.let(weight, call("fmax", self.forgetting, 1.0 / (self.rows + BEGUN)))
        column = program.local("noise_column", (p,))
        program.let(column, column * 0.0)
        gated = np.isfinite(self.gate) and self.inflates
        program.code(
            self.change, _LEARN, m=p, change=self.change, valid=valid, noise=noise, L=L,
            column=column, w=Name("w"), weight=weight,
            regular=Name(f" && {self.outlier}[o] == 0.0" if gated else ""),
        )  # fmt: skip

    def keep(self) -> None:
        """Add the row to the variances of R."""
        if self.forgetting:
            self.program.let(self.variances, self.variances + self.change)

    def estimate(self) -> None:
        """Report outliers and the variances of R, and count the row."""
        if np.isfinite(self.gate):
            self.program.estimate("outlier", self.outlier)
        if self.forgetting:
            self.program.estimate("noise_variance", self.variances)
            # beyond which the weight is that of the memory
            with self.program.when(f"{self.rows} < {math.ceil(1.0 / self.forgetting)}"):
                self.program.advance(self.rows)
