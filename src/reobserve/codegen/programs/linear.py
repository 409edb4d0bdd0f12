"""Filters on linear models: constant gain, Kalman's, and the smooth variable structure filter."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np

from reobserve.codegen.expressions import Expression, Name, call
from reobserve.codegen.program import ONE, ZERO, Program
from reobserve.codegen.programs.rules import FilterRules
from reobserve.core.errors import InputError
from reobserve.core.matrices import as_row
from reobserve.observers.augmented_kalman import AugmentedKalmanFilter
from reobserve.observers.fixed_gain import FixedGainObserver
from reobserve.observers.gaussian_filter import GaussianFilter
from reobserve.observers.gaussian_state import KalmanState
from reobserve.observers.kalman import HALF_LOG_TWO_PI, ROUNDED, KalmanFilter
from reobserve.observers.smooth_variable_structure import SmoothVariableStructureFilter
from reobserve.systems.linear import LinearModel


@dataclass(frozen=True, eq=False)
class Matrices:
    """Matrices of a model as a program names them, of a bank those of one mode.

    Where the measurement is not C x + D u, ``expected`` is h(x, u), and C its Jacobian.
    """

    A: Name | None
    B: Name | None
    C: Name
    D: Name | None
    Q: Name | None
    R: Name | None
    expected: Name | None = None


def matrices(program: Program, model: LinearModel, *, noise: bool = True) -> Matrices:
    """The constants of a model."""
    arrays = model.arrays
    names = {
        name: program.constant(name, getattr(arrays, name))
        for name in ("A", "B", "C", "D", "Q", "R")
        if (noise or name not in "QR") and (name not in "BD" or getattr(arrays, name).any())
    }
    return Matrices(
        names["A"], names.get("B"), names["C"], names.get("D"), names.get("Q"), names.get("R")
    )


class Inputs:
    """The input of the row before, which for the first row is its own."""

    def __init__(self, program: Program, model: Any, state: Any) -> None:
        self.program, sample = program, state.sample
        self.started = program.counter("started", 0 if sample is None else 1)
        self.held: Name | None = None
        if model.inputs:
            last = np.zeros(model.inputs) if sample is None else sample[model.outputs :]
            self.held = program.remember("held", as_row("u", last)[0])

    @contextmanager
    def moves(self) -> Iterator[None]:
        """The step to a row that is not the first."""
        program = self.program
        with program.when(f"{self.started} == 1"):
            yield
        if self.held is not None:
            with program.when(f"{self.started} == 0"):
                program.let(self.held, program.u)
        program.line(f"{self.started} = 1;")

    def of_mode(self, mode: str) -> Name | None:
        """The input that is held for one of several models: the same for all."""
        return self.held

    def keep(self) -> None:
        """The input of this row, for the next."""
        if self.held is not None:
            self.program.let(self.held, self.program.u)


def fixed_gain(observer: FixedGainObserver, state: KalmanState) -> Program:
    """x <- A x + B u, x <- x + L (y - C x - D u)."""
    model = observer.model
    program = Program("Linear observer of constant gain", model.outputs, model.inputs)
    m = matrices(program, model, noise=False)
    if observer.gate is not None:
        problem = "of constant gain with a gate cannot be exported: the code has no covariance"
        raise InputError("observer", problem)
    rules = FilterRules(program, observer, state, model.outputs)
    L = program.constant("L", observer.gain)
    x = program.remember("x", state.posterior.mean)
    inputs = Inputs(program, model, state)
    with inputs.moves():
        program.let(x, predicted_mean(m, x, inputs.held))
        rules.wrap(x, rules.states)
    e, _ = innovation(program, m, x, rules)
    program.let(x, x + L @ e)
    rules.wrap(x, rules.states)
    estimate_innovation(program, e)
    program.estimate("state", x)
    inputs.keep()
    return program


def kalman(observer: KalmanFilter, state: KalmanState) -> Program:
    """The filter with its covariance."""
    return filter_program("Kalman filter", observer, state)


def augmented(observer: AugmentedKalmanFilter, state: KalmanState) -> Program:
    """The Kalman filter of the state and the unknown inputs, which it distinguishes."""
    title = "Kalman filter with unknown inputs"
    return filter_program(title, observer, state, split=observer.model.states)


def smooth(observer: SmoothVariableStructureFilter, state: KalmanState) -> Program:
    """The SVSF with its covariance."""
    title = "Smooth variable structure filter"
    return filter_program(
        title, observer, state, lambda program: switching_constants(program, [observer])
    )


class GainFunction(Protocol):
    """The gain of a filter: its constants, and how it is written."""

    def write(
        self, program: Program, m: Matrices, PC: Name, L: Name, e: Name, error: Name, K: Name
    ) -> None:
        """Write K, shape (n, p), from P C', the factor L of S, the innovation and e(k|k)."""


def filter_program(
    title: str,
    observer: GaussianFilter,
    state: KalmanState,
    gain: Callable[[Program], GainFunction] | None = None,
    split: int = 0,
) -> Program:
    """A filter with its covariance, and Kalman's gain unless ``gain`` states another."""
    model: LinearModel = observer.whole
    program, n = Program(title, model.outputs, model.inputs), model.states
    m = matrices(program, model)
    rules = FilterRules(program, observer, state, model.outputs)
    switching = None if gain is None else gain(program)
    x = program.remember("x", state.posterior.mean)
    P = program.remember("P", state.posterior.covariance)
    error = program.remember("error", state.posterior.error) if switching else None
    inputs = Inputs(program, model, state)
    with inputs.moves():
        program.let(x, predicted_mean(m, x, inputs.held))
        rules.wrap(x, rules.states)
        program.let(P, predicted_covariance(m, P), symmetric=True)
    e, log_likelihood = correct(program, m, x, P, switching, error, rules)
    rules.keep()
    estimate_innovation(program, e)
    variance = diagonal(program, P)
    program.estimate_part("state", x, 0, split or n)
    program.estimate_part("variance", variance, 0, split or n)
    if split:
        program.estimate_part("unknown_input", x, split, n)
        program.estimate_part("unknown_input_variance", variance, split, n)
    program.estimate("log_likelihood", log_likelihood)
    rules.estimate()
    inputs.keep()
    return program


def diagonal(program: Program, P: Name) -> Name:
    """The variances of a covariance."""
    variance = program.local("variances", P.shape[:1])
    with program.for_each("row", P.shape[0]) as row:
        program.let(variance[row], P[row, row])
    return variance


def predicted_mean(m: Matrices, x: Name, held: Name | None) -> Expression:
    """B u + A x, added in the order of the library."""
    assert m.A is not None
    return m.A @ x if held is None or m.B is None else m.B @ held + m.A @ x


def predicted_covariance(m: Matrices, P: Name) -> Expression:
    """A P A' + Q."""
    assert m.A is not None
    assert m.Q is not None
    return m.A @ P @ m.A.T + m.Q


def innovation(program: Program, m: Matrices, x: Name, rules: FilterRules) -> tuple[Name, Name]:
    """The innovation, zero where a measurement is missing, and ones where it is not."""
    p = program.measurements
    e = program.let(program.local("e", (p,)), _error(program, m, x))
    rules.wrap(e, rules.outputs)
    valid = program.local("valid", (p,))
    with program.for_each("row", p) as row:
        program.flag(valid[row], f"!isnan({program.y[row]})")
        with program.when(f"{valid[row]} < 0.5"):
            program.let(e[row], ZERO)
    return e, valid


def _error(program: Program, m: Matrices, x: Name) -> Expression:
    """y - D u - C x, or y - h(x, u)."""
    if m.expected is not None:
        return program.y - m.expected
    return program.y - m.C @ x if m.D is None else program.y - m.D @ program.u - m.C @ x


def estimate_innovation(program: Program, e: Name) -> None:
    """The innovation as an estimate, nan where it is missing."""
    out = program.let(program.local("innovation", e.shape), e)
    with program.for_each("row", program.measurements) as row, program.when("valid[row] < 0.5"):
        program.let(out[row], Name("NAN"))
    program.estimate("innovation", out)


@dataclass(frozen=True, eq=False)
class Switching:
    """The gain function of an SVSF: gamma, psi and C^+, or no such inverse where P weighs it."""

    rate: Name
    layer: Name
    inverse: Name | None

    def of(self, mode: str) -> Switching:
        """The gain function of one mode of a bank."""
        inverse = None if self.inverse is None else self.inverse[mode]
        return Switching(self.rate[mode], self.layer[mode], inverse)

    def write(
        self, program: Program, m: Matrices, PC: Name, L: Name, e: Name, error: Name, K: Name
    ) -> None:
        """Write K as `GainFunction` says."""
        _switching_gain(program, m, PC, e, error, self, K)


def switching_constants(
    program: Program, filters: list[SmoothVariableStructureFilter], *, bank: bool = False
) -> Switching:
    """Constants of the gain function, of a bank those of all filters, one behind the other."""

    def constant(name: str, values: list[Any]) -> Name:
        return program.constant(name, values if bank else values[0])

    rate = constant("convergence_rate", [mode.convergence_rate for mode in filters])
    layer = constant("layer", [mode.boundary_layer for mode in filters])
    if filters[0].inverse == "weighted":
        return Switching(rate, layer, None)
    inverses = [np.linalg.pinv(mode.model.arrays.C) for mode in filters]
    return Switching(rate, layer, constant("H_inverse", inverses))


def correct(
    program: Program,
    m: Matrices,
    x: Name,
    P: Name,
    switching: GainFunction | None,
    error: Name | None,
    rules: FilterRules,
) -> tuple[Name, Name]:
    """Correct mean and covariance in place, and return the innovation and its log-likelihood."""
    assert m.R is not None
    n, p = x.shape[0], program.measurements
    e, valid = innovation(program, m, x, rules)
    R = rules.noise_of(m.R)
    # S = C P C' + R
    PC = program.let(program.local("PC", (n, p)), P @ m.C.T)
    S = program.let(program.local("S", (p, p)), m.C @ PC + R)
    rules.apply_gate(e, valid, S)
    L = factor(program, S, valid)
    K = program.local("K", (n, p))
    if switching is None:
        program.solve_right(K, PC, L)  # K = P C' S^-1
    else:
        assert error is not None
        switching.write(program, m, PC, L, e, error, K)
    move(program, x, K, e, valid)
    rules.wrap(x, rules.states)
    # Joseph's form for any gain: T = (I - K C) P, then T (I - K C)' + K R K'.
    T = program.let(program.local("T", (n, n)), P - K @ PC.T)
    program.let(P, T - (T @ m.C.T - K @ R) @ K.T, symmetric=True)
    log_likelihood = log_likelihood_of(program, L, e, valid)
    rules.learn(L, valid, R)
    if error is not None:
        after = program.let(program.local("after", (p,)), _error(program, m, x))
        rules.wrap(after, rules.outputs)
        with program.for_each("row", p) as row, program.when("valid[row] > 0.5"):
            program.let(error[row], after[row])
    return e, log_likelihood


def factor(program: Program, S: Name, valid: Name) -> Name:
    """The Cholesky factor of S with a row and column of the identity for what is missing."""
    p = S.shape[0]
    with program.for_each("row", p) as row, program.when("valid[row] < 0.5"):
        with program.for_each("column", p) as column:
            program.let(S[row, column], ZERO)
            program.let(S[column, row], ZERO)
        program.let(S[row, row], ONE)
    L = program.local("L", (p, p))
    program.cholesky(L, S, ROUNDED)
    return L


def move(program: Program, x: Name, K: Name, e: Name, valid: Name) -> None:
    """x + K e, with zeros in the columns of K that belong to missing measurements."""
    n, p = K.shape
    with program.for_each("row", n) as row, program.for_each("column", p) as column:
        program.let(K[row, column], K[row, column] * valid[column])
    program.let(x, x + K @ e)


def _switching_gain(
    program: Program, m: Matrices, PC: Name, e: Name, error: Name, switching: Switching, K: Name
) -> None:
    """K = C^+ diag((|e| + gamma |e+|) / max(|e|, psi)), C^+ = P C' (C P C')^-1 where weighted."""
    n, p = K.shape
    if switching.inverse is not None:
        program.let(K, switching.inverse)
    else:
        G = program.let(program.local("G", (p, p)), m.C @ PC)
        root = program.local("root", (p, p))
        program.cholesky(root, G)
        program.solve_right(K, PC, root)
    share = program.local("share", (p,))
    with program.for_each("row", p) as row:
        size = call("fabs", e[row])
        above = size + switching.rate * call("fabs", error[row])
        program.let(share[row], above / call("fmax", size, switching.layer[row]))
    with program.for_each("row", n) as row, program.for_each("column", p) as column:
        program.let(K[row, column], K[row, column] * share[column])


def log_likelihood_of(program: Program, L: Name, e: Name, valid: Name) -> Name:
    """-|L^-1 e|^2 / 2 - sum of log L_ii - m/2 log 2 pi, over what was measured."""
    w, total = program.local("w", e.shape), program.local("log_likelihood")
    distance, roots, taken = map(program.local, ("distance", "roots", "taken"))
    program.solve_lower(w, L, e)
    for variable in (distance, roots, taken):
        program.let(variable, ZERO)
    with program.for_each("row", e.shape[0]) as row:
        program.let(distance, distance + w[row] * w[row])
        program.let(roots, roots + call("log", L[row, row]))
        program.let(taken, taken + valid[row])
    return program.let(total, ZERO - 0.5 * distance - roots - taken * HALF_LOG_TWO_PI)
