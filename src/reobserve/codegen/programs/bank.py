"""The interacting multiple model: a bank of Kalman filters, or of SVSFs of one kind."""

from __future__ import annotations

import numpy as np

from reobserve.codegen.expressions import Name, Number, call, outer
from reobserve.codegen.program import ONE, ZERO, Program
from reobserve.codegen.programs import linear
from reobserve.codegen.programs.bank_parts import DelayedInputs, gate_of_bank
from reobserve.codegen.programs.linear import Matrices
from reobserve.codegen.programs.rules import FilterRules
from reobserve.core.errors import InputError
from reobserve.observers.fault_bank import FaultBank
from reobserve.observers.gaussian_filter import GaussianFilter
from reobserve.observers.grid_filter import GridFilter
from reobserve.observers.imm import IMM, LEAST, ImmState
from reobserve.observers.kalman import KalmanFilter
from reobserve.observers.smooth_variable_structure import SmoothVariableStructureFilter

_LEAST = -1e300  # what stands for the logarithm of zero


def bank(observer: IMM, state: ImmState) -> Program:
    """One step of all filters, and of the probabilities of their modes."""
    program = Program("Interacting multiple model", observer.measurements, observer.inputs)
    x, P, mu = _step(program, observer, state)
    program.estimate("state", x)
    program.estimate("variance", linear.diagonal(program, P))
    _report(program, P, mu)
    return program


def fault_bank(observer: FaultBank, state: ImmState) -> Program:
    """The same of a bank for faults, which it tells from the state."""
    title = "Bank of Kalman filters for faults that jump or drift"
    program = Program(title, observer.measurements, observer.inputs)
    x, P, mu = _step(program, observer, state)
    (n, q), variances = observer.fault_matrix.shape, linear.diagonal(program, P)
    for name, since, until in (("", 0, n), ("fault", n, n + q), ("fault_rate", n + q, n + 2 * q)):
        program.estimate_part(name or "state", x, since, until)
        program.estimate_part(f"{name}_variance" if name else "variance", variances, since, until)
    covariance = program.local("state_covariance", (n, n))
    with program.for_each("row", n) as row, program.for_each("column", n) as column:
        program.let(covariance[row, column], P[row, column])
    _report(program, covariance, mu)
    return program


def grid(observer: GridFilter, state: ImmState) -> Program:
    """The same of a grid, with the mean and the variance of its parameter."""
    program = Program("Kalman filters on a grid", observer.measurements, observer.inputs)
    x, P, mu = _step(program, observer, state)
    program.estimate("state", x)
    program.estimate("variance", linear.diagonal(program, P))
    _report(program, P, mu)
    nodes = program.constant("nodes", observer.grid)
    mean, spread = program.local("parameter"), program.local("parameter_variance")
    program.let(mean, ZERO)
    program.let(spread, ZERO)
    with program.for_each("mode", len(observer.grid)) as j:
        program.let(mean, mean + mu[j] * nodes[j])
    with program.for_each("mode", len(observer.grid)) as j:
        program.let(spread, spread + mu[j] * ((nodes[j] - mean) * (nodes[j] - mean)))
    program.estimate("parameter", mean)
    program.estimate("parameter_variance", spread)
    return program


def _report(program: Program, P: Name, mu: Name) -> None:
    """Estimates that all banks have."""
    program.estimate("covariance", P)
    program.estimate("probability", mu)
    program.estimate("innovation", Name("innovations", (*mu.shape, program.measurements)))
    program.estimate("log_likelihood", Name("whole"))


def _step(program: Program, observer: IMM, state: ImmState) -> tuple[Name, Name, Name]:
    """The step of a bank: the mixture's mean and covariance, and the probabilities."""
    filters = _filters(observer)
    first, r = filters[0].model, len(filters)
    n, p = first.states, first.outputs
    rules = FilterRules(program, observer, state, p)
    models = _models(program, filters)
    svsf = [mode for mode in filters if isinstance(mode, SmoothVariableStructureFilter)]
    switching = linear.switching_constants(program, svsf, bank=True) if svsf else None
    chain = program.constant("Chain", observer.transition)
    means = program.remember("means", state.means)
    covariances = program.remember("covariances", state.covariances)
    errors = program.remember("errors", state.errors) if svsf else None
    logarithms = np.maximum(state.log_probabilities, _LEAST)
    log_mu = program.remember("log_mu", logarithms)
    inputs = (
        DelayedInputs(program, observer, state)
        if isinstance(observer, GridFilter) and observer.periods_late is not None
        else linear.Inputs(program, first, state)
    )
    predicted = program.let(program.local("log_predicted", (r,)), log_mu)
    with inputs.moves():
        weights = _mixing(program, chain, log_mu, predicted)
        if observer.mixing:
            _interact(program, weights, means, covariances, rules)
        with program.for_each("mode", r) as j:
            m = _mode(models, j)
            program.let(means[j], linear.predicted_mean(m, means[j], inputs.of_mode(j)))
            rules.wrap(means[j], rules.states)
            program.let(
                covariances[j], linear.predicted_covariance(m, covariances[j]), symmetric=True
            )
    likelihoods = program.local("likelihoods", (r,))
    innovations = program.local("innovations", (r, p))
    changes = program.local("noise_changes", (r, p))
    if observer.gate is not None:
        gate_of_bank(program, observer.gate, models, means, covariances, rules)
    with program.for_each("mode", r) as j:
        e, log_likelihood = linear.correct(
            program, _mode(models, j), means[j], covariances[j],
            None if switching is None else switching.of(j), None if errors is None else errors[j],
            rules,
        )  # fmt: skip
        if rules.forgetting:
            program.let(changes[j], rules.change)
        program.let(likelihoods[j], log_likelihood)
        program.let(innovations[j], e)
        with program.for_each("row", p) as row, program.when("valid[row] < 0.5"):
            program.let(innovations[j, row], Name("NAN"))
    _update(program, predicted, likelihoods, log_mu)
    mu = program.local("mu", (r,))
    with program.for_each("mode", r) as j:
        program.let(mu[j], call("exp", log_mu[j]))
    _learn(program, rules, mu, changes)
    rules.keep()
    x, P = program.local("x", (n,)), program.local("P", (n, n))
    _combine(program, mu, means, covariances, x, P, rules)
    if observer.gate is not None:
        program.estimate("outlier", rules.outlier)
    rules.estimate()
    inputs.keep()
    return x, P, mu


def _learn(program: Program, rules: FilterRules, mu: Name, changes: Name) -> None:
    """The change of R, the mean of those of the modes."""
    if rules.forgetting:
        program.let(rules.change, rules.change * 0.0)
        with program.for_each("mode", mu.shape[0]) as j:
            program.let(rules.change, rules.change + mu[j] * changes[j])
        with program.for_each("row", program.measurements) as row, program.when("valid[row] < 0.5"):
            program.let(rules.change[row], ZERO)


def _filters(observer: IMM) -> list[GaussianFilter]:
    kinds = KalmanFilter | SmoothVariableStructureFilter
    filters = [mode for mode in observer.filters if isinstance(mode, kinds)]
    alike = {(type(mode), getattr(mode, "inverse", "")) for mode in filters}
    if len(filters) < len(observer.filters) or len(alike) > 1:
        raise InputError(
            "observer", "cannot be exported: its filters must all be Kalman filters, or all SVSFs "
            "of one inverse",
        )  # fmt: skip
    return list(filters)


def _models(program: Program, filters: list[GaussianFilter]) -> dict[str, Name]:
    """The matrices of all modes, one behind the other, without B or D where all are zero."""
    stacks = {
        name: np.array([getattr(mode.model.arrays, name) for mode in filters])
        for name in ("A", "B", "C", "D", "Q", "R")
    }
    return {
        name: program.constant(name, stack)
        for name, stack in stacks.items()
        if name not in "BD" or stack.any()
    }


def _mode(models: dict[str, Name], j: str) -> Matrices:
    own = {name: whole[j] for name, whole in models.items()}
    return Matrices(own["A"], own.get("B"), own["C"], own.get("D"), own["Q"], own["R"])


def _mixing(program: Program, chain: Name, log_mu: Name, predicted: Name) -> Name:
    """Weights mu(i|j), j along columns, and log c_j. A mode that none reaches keeps to itself."""
    r = log_mu.shape[0]
    weights = program.local("weights", (r, r))
    total = program.local("total_probability")
    with program.for_each("mode", r) as j:
        # c_j = sum over i of Pi_ij mu_i
        program.let(total, ZERO)
        with program.for_each("other", r) as i:
            program.let(weights[i, j], chain[i, j] * call("exp", log_mu[i]))
            program.let(total, total + weights[i, j])
        with program.when(f"{total} > {LEAST!r}"):
            program.let(predicted[j], call("log", total))
        with program.otherwise():
            _unlikely(program, chain, log_mu, predicted, weights, total)
        with program.for_each("other", r) as i:
            program.let(weights[i, j], weights[i, j] / total)
    return weights


def _unlikely(
    program: Program, chain: Name, log_mu: Name, predicted: Name, weights: Name, total: Name
) -> None:
    """The same for a mode so unlikely that its probability is no number: by the largest."""
    r, j = log_mu.shape[0], "mode"
    largest = program.let(program.local("largest"), Number(_LEAST))
    with program.for_each("other", r) as i, program.when(f"{chain[i, j]} > 0.0"):
        program.let(weights[i, j], call("log", chain[i, j]) + log_mu[i])
        program.let(largest, call("fmax", largest, weights[i, j]))
    program.let(total, ZERO)
    with program.for_each("other", r) as i:
        with program.when(f"{chain[i, j]} > 0.0 && {largest} > {_LEAST!r}"):
            program.let(weights[i, j], call("exp", weights[i, j] - largest))
        with program.otherwise():
            program.let(weights[i, j], ZERO)
        program.let(total, total + weights[i, j])
    with program.when(f"{largest} <= {_LEAST!r}"):
        program.let(weights[j, j], ONE)
        program.let(total, ONE)
    program.let(predicted[j], call("fmax", largest + call("log", total), _LEAST))


def _interact(
    program: Program, weights: Name, means: Name, covariances: Name, rules: FilterRules
) -> None:
    """Mixed means and covariances, in the place of the filters' own."""
    r, n = means.shape
    mixed, mixed_covariances = program.local("mixed", (r, n)), program.local("mixed_P", (r, n, n))
    with program.for_each("mode", r) as j:
        _combine(program, weights, means, covariances, mixed[j], mixed_covariances[j], rules, j)
    program.let(means, mixed)
    program.let(covariances, mixed_covariances)


def _update(program: Program, predicted: Name, likelihoods: Name, log_mu: Name) -> Name:
    """The probabilities after the measurement, and its log-likelihood over all modes."""
    r = log_mu.shape[0]
    largest = program.let(program.local("largest"), Number(_LEAST))
    total = program.let(program.local("total_probability"), ZERO)
    whole = program.local("whole")
    with program.for_each("mode", r) as j:
        program.let(log_mu[j], predicted[j] + likelihoods[j])
        program.let(largest, call("fmax", largest, log_mu[j]))
    with program.for_each("mode", r) as j:
        program.let(total, total + call("exp", log_mu[j] - largest))
    program.let(whole, largest + call("log", total))
    with program.for_each("mode", r) as j:
        program.let(log_mu[j], call("fmax", log_mu[j] - whole, _LEAST))
    # over a row without measurements there is no likelihood
    valid = program.let(program.local("measured"), ZERO)
    with program.for_each("row", program.measurements) as row:
        program.let(valid, valid + Name("valid")[row])
    with program.when(f"{valid} < 0.5"):
        program.let(whole, ZERO)
    return whole


def _combine(
    program: Program, weights: Name, means: Name, covariances: Name, x: Name, P: Name,
    rules: FilterRules, *to: str,
) -> None:  # fmt: skip
    """The mean and the covariance of a mixture: of the modes, or of what is mixed ``to`` one."""
    apart = program.local("apart", x.shape)
    # x = sum of w_i x_i
    program.let(x, Number(0.0, x.shape))
    with program.for_each("other", means.shape[0]) as i:
        program.let(x, x + weights[(i, *to)] * means[i])
    angles = np.flatnonzero(rules.states).tolist()
    if angles:  # around the most probable one
        program.line("int32_t likely = 0;")
        larger = f"{weights[('other', *to)]} > {weights[('likely', *to)]}"
        with program.for_each("other", means.shape[0]) as i, program.when(larger):
            program.line(f"likely = {i};")
    for a in angles:
        period, turned = float(rules.states[a]), program.local("turned")
        program.let(x[a], ZERO)
        with program.for_each("other", means.shape[0]) as i:
            program.let(turned, means[i, a] - means["likely", a])
            program.let(turned, turned - period * call("floor", turned / period + 0.5))
            program.let(x[a], x[a] + weights[(i, *to)] * turned)
        program.let(x[a], means["likely", a] + x[a])
        program.let(x[a], x[a] - period * call("floor", x[a] / period + 0.5))
    # P = sum of w_i (P_i + (x_i - x) (x_i - x)')
    program.let(P, Number(0.0, P.shape))
    with program.for_each("other", means.shape[0]) as i:
        program.let(apart, means[i] - x)
        rules.wrap(apart, rules.states)
        program.let(P, P + weights[(i, *to)] * (covariances[i] + outer(apart, apart)))
