"""The interacting multiple model: a bank of Kalman filters, or of SVSFs of one kind."""

from __future__ import annotations

import numpy as np

from reobserve.codegen.expressions import Name, Number, call, outer
from reobserve.codegen.program import ONE, ZERO, Program
from reobserve.codegen.programs import linear
from reobserve.codegen.programs.linear import Matrices
from reobserve.core.errors import InputError
from reobserve.observers.gaussian_filter import GaussianFilter
from reobserve.observers.imm import IMM
from reobserve.observers.imm_loop import LEAST
from reobserve.observers.imm_state import ImmState
from reobserve.observers.kalman import KalmanFilter
from reobserve.observers.smooth_variable_structure import SmoothVariableStructureFilter

_LEAST = -1e300  # what stands for the logarithm of zero


def bank(observer: IMM, state: ImmState) -> Program:
    """One step of all filters, and of the probabilities of their modes."""
    filters = _filters(observer)
    first, r = filters[0].model, len(filters)
    n, p = first.states, first.outputs
    program = Program("Interacting multiple model", first.outputs, first.inputs)
    models = _models(program, filters)
    svsf = [one for one in filters if isinstance(one, SmoothVariableStructureFilter)]
    switching = linear.switching_constants(program, svsf, bank=True) if svsf else None
    chain = program.constant("Chain", observer.transition)
    means = program.remember("means", state.means)
    covariances = program.remember("covariances", state.covariances)
    errors = program.remember("errors", state.errors) if svsf else None
    logarithms = np.maximum(state.log_probabilities, _LEAST)
    log_mu = program.remember("log_mu", logarithms)
    inputs = linear.Inputs(program, first, state)
    predicted = program.let(program.local("log_predicted", (r,)), log_mu)
    with inputs.moves():
        weights = _mixing(program, chain, log_mu, predicted)
        if observer.mixing:
            _interact(program, weights, means, covariances)
        with program.for_each("mode", r) as j:
            m = _mode(models, j)
            program.let(means[j], linear.predicted_mean(m, means[j], inputs.held))
            program.let(
                covariances[j], linear.predicted_covariance(m, covariances[j]), symmetric=True
            )
    likelihoods = program.local("likelihoods", (r,))
    innovations = program.local("innovations", (r, p))
    with program.for_each("mode", r) as j:
        e, log_likelihood = linear.correct(
            program, _mode(models, j), means[j], covariances[j],
            None if switching is None else switching.of(j), None if errors is None else errors[j],
        )  # fmt: skip
        program.let(likelihoods[j], log_likelihood)
        program.let(innovations[j], e)
        with program.for_each("row", p) as row, program.when("valid[row] < 0.5"):
            program.let(innovations[j, row], Name("NAN"))
    whole = _update(program, predicted, likelihoods, log_mu)
    mu = program.local("mu", (r,))
    with program.for_each("mode", r) as j:
        program.let(mu[j], call("exp", log_mu[j]))
    x, P = program.local("x", (n,)), program.local("P", (n, n))
    _combine(program, mu, means, covariances, x, P)
    program.estimate("state", x)
    program.estimate("variance", linear.diagonal(program, P))
    program.estimate("covariance", P)
    program.estimate("probability", mu)
    program.estimate("innovation", innovations)
    program.estimate("log_likelihood", whole)
    inputs.keep()
    return program


def _filters(observer: IMM) -> list[GaussianFilter]:
    kinds = KalmanFilter | SmoothVariableStructureFilter
    found = [one for one in observer.filters if isinstance(one, kinds)]
    alike = {(type(one), getattr(one, "inverse", "")) for one in found}
    if len(found) < len(observer.filters) or len(alike) > 1:
        raise InputError(
            "observer", "cannot be exported: its filters must all be Kalman filters, or all SVSFs "
            "of one inverse",
        )  # fmt: skip
    return list(found)


def _models(program: Program, filters: list[GaussianFilter]) -> dict[str, Name]:
    """The matrices of all modes, one behind the other, without B or D where all are zero."""
    stacks = {
        name: np.array([getattr(one.model.arrays, name) for one in filters])
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


def _interact(program: Program, weights: Name, means: Name, covariances: Name) -> None:
    """Mixed means and covariances, in the place of the filters' own."""
    r, n = means.shape
    mixed, mixed_covariances = program.local("mixed", (r, n)), program.local("mixed_P", (r, n, n))
    with program.for_each("mode", r) as j:
        _combine(program, weights, means, covariances, mixed[j], mixed_covariances[j], j)
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
    program: Program, weights: Name, means: Name, covariances: Name, x: Name, P: Name, *to: str
) -> None:
    """The mean and the covariance of a mixture: of the modes, or of what is mixed ``to`` one."""
    apart = program.local("apart", x.shape)
    # x = sum of w_i x_i
    program.let(x, Number(0.0, x.shape))
    with program.for_each("other", means.shape[0]) as i:
        program.let(x, x + weights[(i, *to)] * means[i])
    # P = sum of w_i (P_i + (x_i - x) (x_i - x)')
    program.let(P, Number(0.0, P.shape))
    with program.for_each("other", means.shape[0]) as i:
        program.let(apart, means[i] - x)
        program.let(P, P + weights[(i, *to)] * (covariances[i] + outer(apart, apart)))
