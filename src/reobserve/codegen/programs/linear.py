"""Filters on linear models: constant gain, Kalman's, and the smooth variable structure filter."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from reobserve.codegen.expressions import Expression, Name, call
from reobserve.codegen.programs.sampling import tell_part
from reobserve.codegen.statements import ONE, ZERO, Program
from reobserve.core.matrices import as_row
from reobserve.observers.augmented_kalman import AugmentedKalmanFilter
from reobserve.observers.contract import ObserverState
from reobserve.observers.fixed_gain import FixedGainObserver
from reobserve.observers.kalman import KalmanFilter
from reobserve.observers.linear_filter import State
from reobserve.observers.smooth_variable_structure import SmoothVariableStructureFilter
from reobserve.systems.linear import LinearModel

_HALF_LOG_TWO_PI = 0.5 * float(np.log(2.0 * np.pi))


@dataclass(frozen=True, eq=False)
class Matrices:
    """Those of a model as a program names them; for a bank, of one mode."""

    A: Name
    B: Name | None
    C: Name
    D: Name | None
    Q: Name | None
    R: Name | None


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


def fixed_gain(observer: FixedGainObserver, state: State) -> Program:
    """x <- A x + B u, x <- x + L (y - C x - D u)."""
    model = observer.model
    program = Program("Linear observer of constant gain", model.outputs, model.inputs)
    m = matrices(program, model, noise=False)
    L = program.constant("L", observer.gain, gain=True)
    x = program.remember("x", state.belief.mean, r"\hat x")
    held = remember_inputs(program, model, state)
    with program.when("started == 1", "k > 0"):
        program.let(x, move(m, x, held))
    start(program)
    e, _ = foretell_error(program, m, x)
    program.let(x, x + L @ e)
    tell_innovation(program, e)
    program.estimate("state", x)
    remember_row(program, held)
    return program


def kalman(observer: KalmanFilter, state: State) -> Program:
    """The filter with its covariance."""
    program = Program("Kalman filter", observer.model.outputs, observer.model.inputs)
    _filter(program, observer.model, state, None)
    return program


def augmented(observer: AugmentedKalmanFilter, state: State) -> Program:
    """The Kalman filter of the state and the unknown inputs, which are told apart."""
    whole, n = observer._kalman, observer.model.states
    title = "Kalman filter with unknown inputs"
    program = Program(title, whole.model.outputs, whole.model.inputs)
    _filter(program, whole.model, state, None, split=n)
    return program


def smooth(observer: SmoothVariableStructureFilter, state: State) -> Program:
    """The SVSF with its covariance."""
    model = observer.model
    program = Program("Smooth variable structure filter", model.outputs, model.inputs)
    _filter(program, model, state, observer)
    return program


def _filter(
    program: Program,
    model: LinearModel,
    state: State,
    switching: SmoothVariableStructureFilter | None,
    split: int = 0,
) -> None:
    m = matrices(program, model)
    law = None if switching is None else switching_constants(program, switching)
    x = program.remember("x", state.belief.mean, r"\hat x")
    P = program.remember("P", state.belief.covariance)
    error = program.remember("error", state.belief.error, "e^+") if law else None
    held = remember_inputs(program, model, state)
    with program.when("started == 1", "k > 0"):
        program.let(x, move(m, x, held))
        program.let(P, spread(m, P), symmetric=True)
    start(program)
    seen_error = correct(program, m, x, P, law, error)
    tell_innovation(program, seen_error)
    variance = diagonal(program, P, model.states)
    if split:
        for prefix, first, last in (("", 0, split), ("unknown_input", split, model.states)):
            tell_part(program, prefix or "state", x, first, last)
            tell_part(program, f"{prefix}_variance".lstrip("_"), variance, first, last)
    else:
        program.estimate("state", x)
        program.estimate("variance", variance)
    program.estimate("log_likelihood", Name("log_likelihood"))
    remember_row(program, held)


def diagonal(program: Program, P: Name, size: int) -> Name:
    """The variances of a covariance."""
    variance = program.local("spread_of", (size,), r"\operatorname{diag} P")
    with program.hidden(), program.for_each("row", size) as row:
        program.let(variance[row], P[row, row])
    return variance


def move(m: Matrices, x: Name, held: Name | None) -> Expression:
    """A x + B u."""
    return m.A @ x if held is None or m.B is None else m.A @ x + m.B @ held


def spread(m: Matrices, P: Name) -> Expression:
    """A P A' + Q."""
    assert m.Q is not None
    return m.A @ P @ m.A.T + m.Q


def remember_inputs(program: Program, model: LinearModel, state: ObserverState) -> Name | None:
    """The counter that tells the first row, and the input of the row before."""
    program.counter("started", 0 if state.sample is None else 1)
    if not model.inputs:
        return None
    last = np.zeros(model.inputs) if state.sample is None else state.sample[model.outputs :]
    return program.remember("held", as_row("u", last)[0], "u_{k-1}")


def start(program: Program) -> None:
    """Remember that a row was taken."""
    with program.hidden():
        program.set_counter(Name("started"), 1)


def remember_row(program: Program, held: Name | None) -> None:
    """The input of this row, for the next."""
    if held is not None:
        with program.hidden():
            program.let(held, program.u)


def foretell_error(program: Program, m: Matrices, x: Name) -> tuple[Name, Name]:
    """The innovation, zero where a measurement is missing, and ones where it is not."""
    p = program.measurements
    e = program.local("e", (p,))
    program.let(e, _error(program, m, x))
    seen = program.local("seen", (p,))
    with program.hidden(), program.for_each("row", p) as row:
        program.let(seen[row], ONE)
        with program.when(f"isnan(e[{row}])"):
            program.let(seen[row], ZERO)
            program.let(e[row], ZERO)
    program.notes.append("A measurement that is missing, nan, corrects nothing.")
    return e, seen


def _error(program: Program, m: Matrices, x: Name) -> Expression:
    error = program.y - m.C @ x
    return error if m.D is None else error - m.D @ program.u


def tell_innovation(program: Program, e: Name) -> None:
    """The innovation as an estimate, nan where it is missing."""
    told = program.local("innovation", (program.measurements,), "e")
    with program.hidden():
        program.let(told, e)
        with program.for_each("row", program.measurements), program.when("seen[row] < 0.5"):
            program.let(told["row"], Name("NAN"))
    program.estimate("innovation", told)


@dataclass(frozen=True, eq=False)
class Switching:
    """The law of an SVSF: gamma, psi and C^+, or no such inverse where P weighs it."""

    memory: Name
    layer: Name
    inverse: Name | None


def switching_constants(program: Program, observer: SmoothVariableStructureFilter) -> Switching:
    """Its constants."""
    memory = program.constant("memory_rate", observer.memory, r"\gamma", gain=True)
    layer = program.constant("layer", observer.boundary_layer, r"\psi", gain=True)
    if observer.inverse == "weighted":
        return Switching(memory, layer, None)
    inverse = np.linalg.pinv(observer.model.arrays.C)
    return Switching(memory, layer, program.constant("C_inverse", inverse, "C^+"))


def correct(
    program: Program,
    m: Matrices,
    x: Name,
    P: Name,
    law: Switching | None,
    error: Name | None,
) -> Name:
    """Correct mean and covariance in place; return the innovation."""
    assert m.R is not None
    n, p = x.shape[0], program.measurements
    e, seen = foretell_error(program, m, x)
    PC = program.let(program.local("PC", (n, p), "PC^T"), P @ m.C.T)
    S = program.let(program.local("S", (p, p)), m.C @ PC + m.R)
    with program.hidden(), program.for_each("row", p), program.when("seen[row] < 0.5"):
        with program.for_each("column", p):
            program.let(S["row", "column"], ZERO)
            program.let(S["column", "row"], ZERO)
        program.let(S["row", "row"], ONE)
    L, K = program.local("L", (p, p)), program.local("K", (n, p))
    program.cholesky(L, S)
    if law is None:
        program.solve_right(K, PC, L)
    else:
        assert error is not None
        _switching_gain(program, m, PC, e, error, law, K)
    with program.hidden(), program.for_each("row", n), program.for_each("column", p):
        program.let(K["row", "column"], K["row", "column"] * seen["column"])
    program.let(x, x + K @ e)
    # Joseph's form for any gain: T = (I - K C) P, then T (I - K C)' + K R K'.
    T = program.let(program.local("T", (n, n)), P - K @ PC.T)
    program.let(P, T - (T @ m.C.T - K @ m.R) @ K.T, symmetric=True)
    _likelihood(program, L, e, seen)
    if error is not None:
        after = program.let(program.local("after", (p,), "e^+"), _error(program, m, x))
        with program.hidden(), program.for_each("row", p), program.when("seen[row] > 0.5"):
            program.let(error["row"], after["row"])
    return e


def _switching_gain(
    program: Program, m: Matrices, PC: Name, e: Name, error: Name, law: Switching, K: Name
) -> None:
    n, p = K.shape
    if law.inverse is not None:
        program.let(K, law.inverse)
    else:
        G = program.let(program.local("G", (p, p)), m.C @ PC)
        root = program.local("root", (p, p))
        program.cholesky(root, G)
        program.solve_right(K, PC, root)
    share = program.local("share", (p,))
    with program.for_each("row", p) as row:
        size = call("fabs", e[row])
        above = size + law.memory * call("fabs", error[row])
        program.let(share[row], above / call("fmax", size, law.layer[row]))
    with program.for_each("row", n) as row, program.for_each("column", p) as column:
        program.let(K[row, column], K[row, column] * share[column])


def _likelihood(program: Program, L: Name, e: Name, seen: Name) -> None:
    p = e.shape[0]
    w = program.local("w", (p,), r"w")
    told = program.local("log_likelihood", (), r"\ell")
    program.notes.append(
        r"$\ell = -\tfrac12 \lvert L^{-1} e \rvert^2 - \sum_i \log L_{ii} - \tfrac m2 \log 2\pi$"
    )
    with program.hidden():
        program.solve_lower(w, L, e)
        program.let(told, ZERO)
        with program.for_each("row", p) as row:
            one = -0.5 * (w[row] * w[row]) - call("log", L[row, row])
            program.let(told, told + one - _HALF_LOG_TWO_PI * seen[row])
