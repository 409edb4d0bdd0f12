"""The interacting multiple model: a bank of Kalman filters, or of SVSFs of one kind."""

from __future__ import annotations

import numpy as np

from reobserve.codegen.expressions import Name, Number, Outer, call
from reobserve.codegen.programs import linear
from reobserve.codegen.programs.linear import Matrices, Switching
from reobserve.codegen.statements import ONE, ZERO, Program
from reobserve.core.errors import InputError
from reobserve.observers.imm import IMM, State
from reobserve.observers.imm_loop import LEAST
from reobserve.observers.kalman import KalmanFilter
from reobserve.observers.linear_filter import LinearFilter
from reobserve.observers.smooth_variable_structure import SmoothVariableStructureFilter

_LEAST = -1e300  # what stands for the logarithm of zero


def bank(observer: IMM, state: State) -> Program:
    """One step of all filters, and of the probabilities of their modes."""
    filters = _filters(observer)
    first, r = filters[0].model, len(filters)
    n, p = first.states, first.outputs
    program = Program("Interacting multiple model", first.outputs, first.inputs)
    models, law = _constants(program, filters)
    chain = program.constant("Chain", observer.transition, r"\Pi", gain=True)
    means = program.remember("means", state.means, r"\hat x")
    spreads = program.remember("spreads", state.covariances, "P")
    errors = None
    if law is not None:
        errors = program.remember("errors", state.errors, "e^+")
    logarithms = np.maximum(state.log_probabilities, _LEAST)
    chances = program.remember("log_chance", logarithms, r"\log\mu")
    held = linear.remember_inputs(program, first, state)
    foretold = program.local("log_foretold", (r,), r"\log c")
    program.let(foretold, chances)
    j: str
    with program.when("started == 1", "k > 0"):
        weights = _mixing(program, chain, chances, foretold)
        if observer.mixing:
            _interact(program, weights, means, spreads)
        with program.for_each("mode", r) as j:
            m = _mode(models, j)
            program.let(means[j], linear.move(m, means[j], held))
            program.let(spreads[j], linear.spread(m, spreads[j]), symmetric=True)
    linear.start(program)
    told = program.local("told", (r,), r"\ell")
    innovations = program.local("innovations", (r, p), "e_j")
    with program.for_each("mode", r) as j:
        own = None if errors is None else errors[j]
        x, P = means[j], spreads[j]
        linear.correct(program, _mode(models, j), x, P, _own_law(law, j), own)
        program.let(told[j], Name("log_likelihood"))
        with program.hidden():
            program.let(innovations[j], Name("e", (p,)))
            with program.for_each("row", p), program.when("seen[row] < 0.5"):
                program.let(innovations[j, "row"], Name("NAN"))
    whole = _update(program, foretold, told, chances)
    mu = program.local("mu", (r,), r"\mu")
    with program.for_each("mode", r) as j:
        program.let(mu[j], call("exp", chances[j]))
    x, P = _combined(program, mu, means, spreads, n)
    program.estimate("state", x)
    program.estimate("variance", linear.diagonal(program, P, n))
    program.estimate("covariance", P)
    program.estimate("probability", mu)
    program.estimate("innovation", innovations)
    program.estimate("log_likelihood", whole)
    linear.remember_row(program, held)
    return program


def _filters(observer: IMM) -> list[LinearFilter]:
    kinds = KalmanFilter | SmoothVariableStructureFilter
    found = [one for one in observer.filters if isinstance(one, kinds)]
    laws = {(type(one), getattr(one, "inverse", "")) for one in found}
    if len(found) < len(observer.filters) or len(laws) > 1:
        raise InputError(
            "observer", "cannot be exported: its filters must all be Kalman filters, or all SVSFs "
            "of one inverse",
        )  # fmt: skip
    return list(found)


def _constants(program: Program, filters: list[LinearFilter]) -> tuple[Matrices, Switching | None]:
    """The matrices of all modes, one behind the other, and the laws of SVSFs."""
    stacks = {
        name: np.array([getattr(one.model.arrays, name) for one in filters])
        for name in ("A", "B", "C", "D", "Q", "R")
    }
    names = {
        name: program.constant(name, stack)
        for name, stack in stacks.items()
        if name not in "BD" or stack.any()
    }
    models = Matrices(
        names["A"], names.get("B"), names["C"], names.get("D"), names["Q"], names["R"]
    )
    switching = [one for one in filters if isinstance(one, SmoothVariableStructureFilter)]
    if not switching:
        return models, None
    memory = program.constant("memory_rate", [s.memory for s in switching], r"\gamma", gain=True)
    layer = program.constant("layer", [s.boundary_layer for s in switching], r"\psi", gain=True)
    if switching[0].inverse == "weighted":
        return models, Switching(memory, layer, None)
    inverses = np.array([np.linalg.pinv(s.model.arrays.C) for s in switching])
    return models, Switching(memory, layer, program.constant("C_inverse", inverses, "C^+"))


def _mode(models: Matrices, j: str) -> Matrices:
    parts = (models.A, models.B, models.C, models.D, models.Q, models.R)
    A, B, C, D, Q, R = (None if part is None else part[j] for part in parts)
    assert A is not None
    assert C is not None
    return Matrices(A, B, C, D, Q, R)


def _own_law(law: Switching | None, j: str) -> Switching | None:
    if law is None:
        return None
    inverse = None if law.inverse is None else law.inverse[j]
    return Switching(law.memory[j], law.layer[j], inverse)


def _mixing(program: Program, chain: Name, chances: Name, foretold: Name) -> Name:
    """Weights mu(i|j), j along columns, and log c_j; a mode that none reaches keeps to itself."""
    r = chances.shape[0]
    weights = program.local("weights", (r, r), r"\omega")
    total = program.local("total_chance", (), "c")
    with program.for_each("mode", r) as j:
        program.let(total, ZERO)
        with program.for_each("other", r) as i:
            program.let(weights[i, j], chain[i, j] * call("exp", chances[i]))
            program.let(total, total + weights[i, j])
        with program.when(f"total_chance > {LEAST!r}", r"c_j > 0") as otherwise:
            program.let(foretold[j], call("log", total))
        with program.otherwise(otherwise), program.hidden():
            _unlikely(program, chain, chances, foretold, weights)
        with program.for_each("other", r) as i:
            program.let(weights[i, j], weights[i, j] / total)
    return weights


def _unlikely(program: Program, chain: Name, chances: Name, foretold: Name, weights: Name) -> None:
    """The same for a mode so unlikely that its probability is no number: by the largest."""
    r = chances.shape[0]
    total = Name("total_chance")
    greatest = program.local("greatest", (), "g")
    program.let(greatest, Number(_LEAST))
    with program.for_each("other", r) as i, program.when("Chain[other][mode] > 0.0"):
        program.let(weights[i, "mode"], call("log", chain[i, "mode"]) + chances[i])
        program.let(greatest, call("fmax", greatest, weights[i, "mode"]))
    program.let(total, ZERO)
    with program.for_each("other", r) as i:
        with program.when("Chain[other][mode] > 0.0") as none:
            program.let(weights[i, "mode"], call("exp", weights[i, "mode"] - greatest))
        with program.otherwise(none):
            program.let(weights[i, "mode"], ZERO)
        with program.when(f"greatest <= {_LEAST!r}"):
            program.let(weights[i, "mode"], ZERO)
        program.let(total, total + weights[i, "mode"])
    with program.when(f"greatest <= {_LEAST!r}"):
        program.let(weights["mode", "mode"], ONE)
        program.let(total, ONE)
    program.let(foretold["mode"], call("fmax", greatest + call("log", total), _LEAST))


def _interact(program: Program, weights: Name, means: Name, spreads: Name) -> None:
    """Mixed means and covariances, in the place of the filters' own."""
    r, n = means.shape
    mixed = program.local("mixed", (r, n), r"\bar x")
    spread = program.local("mixed_spread", (r, n, n), r"\bar P")
    apart = program.local("apart", (n,), r"\delta")
    with program.for_each("mode", r) as j:
        program.let(mixed[j], Number(0.0, (n,)))
        with program.for_each("other", r) as i:
            program.let(mixed[j], mixed[j] + weights[i, j] * means[i])
        program.let(spread[j], Number(0.0, (n, n)))
        with program.for_each("other", r) as i:
            program.let(apart, means[i] - mixed[j])
            more = weights[i, j] * (spreads[i] + Outer(apart, apart))
            program.let(spread[j], spread[j] + more)
    with program.for_each("mode", r) as j:
        program.let(means[j], mixed[j])
        program.let(spreads[j], spread[j])


def _update(program: Program, foretold: Name, told: Name, chances: Name) -> Name:
    """Probabilities after the measurement; its log-likelihood over all modes."""
    r = chances.shape[0]
    greatest = program.local("greatest", (), r"g")
    total = program.local("total_chance", ())
    whole = program.local("whole", (), r"\ell")
    with program.hidden():
        program.let(greatest, Number(_LEAST))
    program.let(total, ZERO)
    program.notes.append(r"$g$ starts from $-\infty$.")
    with program.for_each("mode", r) as j:
        program.let(chances[j], foretold[j] + told[j])
        program.let(greatest, call("fmax", greatest, chances[j]))
    with program.for_each("mode", r) as j:
        program.let(total, total + call("exp", chances[j] - greatest))
    program.let(whole, greatest + call("log", total))
    with program.for_each("mode", r) as j:
        program.let(chances[j], chances[j] - whole)
        with program.hidden():
            program.let(chances[j], call("fmax", chances[j], _LEAST))
    with program.hidden():  # over a row that says nothing there is no likelihood
        program.let(greatest, ZERO)
        with program.for_each("row", program.measurements):
            program.let(greatest, greatest + Name("seen")["row"])
        with program.when("greatest < 0.5"):
            program.let(whole, ZERO)
    return whole


def _combined(program: Program, mu: Name, means: Name, spreads: Name, n: int) -> tuple[Name, Name]:
    r = mu.shape[0]
    x, P = program.local("x", (n,), r"\hat x"), program.local("P", (n, n))
    apart = Name("apart", (n,))
    program.locals["apart"] = (n,)
    program.symbols.setdefault("apart", r"\delta")
    program.let(x, Number(0.0, (n,)))
    with program.for_each("mode", r) as j:
        program.let(x, x + mu[j] * means[j])
    program.let(P, Number(0.0, (n, n)))
    with program.for_each("mode", r) as j:
        program.let(apart, means[j] - x)
        program.let(P, P + mu[j] * (spreads[j] + Outer(apart, apart)))
    return x, P
