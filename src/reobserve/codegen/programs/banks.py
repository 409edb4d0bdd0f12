"""Banks of filters: interacting multiple models, banks for faults, grids of values or delays."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from reobserve.codegen.program import Program, leaves, report, reported
from reobserve.core.errors import InputError
from reobserve.core.value import for_loop
from reobserve.observers.grid_filter import GridFilter, write_parameter
from reobserve.observers.imm import IMM, ImmState, run_bank

Array = NDArray[Any]

TITLES = {
    "IMM": "Interacting multiple model",
    "FaultBank": "Bank of Kalman filters for faults that jump or drift",
    "GridFilter": "Kalman filters on a grid",
}


def bank_program(observer: IMM, state: ImmState) -> Program:
    """A bank from a state on."""
    if not observer._linear:
        raise InputError(
            "observer", "cannot be exported: its filters must all be Kalman filters, or all SVSFs "
            "of one inverse",
        )  # fmt: skip
    bank, gain, after, y, _, _, work, rows = observer._new_row().arguments
    work = work._replace(of_filter=work.of_filter._replace(panel=None))  # as small models have it
    parts = state.means, state.covariances, state.errors, state.log_probabilities
    for part, values in zip(after, parts, strict=False):
        part[...] = values
    if state.noise is not None:
        after.noise[...] = state.noise
    sample, p = state.sample, observer.inputs
    after.begun[0] = state.count + (sample is not None)
    late = getattr(observer, "periods_late", None)
    # Inputs of the rows before, of which there are more than one where they are late, then u.
    past = np.zeros((2 if late is None else int(late.max()) + 3, p))
    fed = past[:, None] if late is None else np.empty((2, len(late), 2 * p))
    if sample is not None:
        past[:-1] = sample[observer.measurements :]
        past[:-2] = past[:-2] if state.past is None else state.past
    u, started = np.empty(p), np.array([int(sample is not None)])
    found = {name: values[0, ...] for name, values in observer._by_name(rows).items()}
    parameter: Any = None
    if isinstance(observer, GridFilter):
        parameter = for_loop(observer.grid), np.empty(1), np.empty(1)
        found["parameter"], found["parameter_variance"] = (part[0, ...] for part in parameter[1:])
    estimates, copies = reported(found, (rows, parameter))
    memory = {**after._asdict(), "inputs": past, "started": started}
    return Program(
        TITLES[type(observer).__name__], _step,
        (y, u, past, started, late, fed, bank, gain, after, work, rows, parameter, copies),
        y, u, memory, estimates, leaves(work=work, rows=rows, fed=fed),
    )  # fmt: skip


def _step(
    y: Array, u: Array, past: Array, started: Array, late: Array | None, fed: Array, bank: Any,
    gain: Any, posteriors: Any, work: Any, rows: Any, parameter: Any, copies: Any,
) -> int:  # fmt: skip
    last = len(past) - 1
    for i in range(len(u)):
        past[last, i] = u[i]
    if late is not None:
        if started[0] == 0:
            for row in range(last):
                for i in range(len(u)):
                    past[row, i] = u[i]
        _feed(late, past, fed)
    good = run_bank(bank, gain, posteriors, y, fed, started[0] == 0, work, rows)
    posteriors.begun[0] += 1.0
    started[0] = 1
    for row in range(last):
        for i in range(len(u)):
            past[row, i] = past[row + 1, i]
    if parameter is not None:
        grid, mean, spread = parameter
        write_parameter(rows.probability, grid, mean, spread)
    report(copies)
    return 0 if good == 1 else 1


def _feed(late: Array, past: Array, fed: Array) -> None:
    """Write the inputs of each filter, u(k-d) and u(k-d-1), for the row before and this one."""
    p, deepest = past.shape[1], len(past) - 2
    for row in range(2):
        for j in range(len(late)):
            for i in range(p):
                fed[row, j, i] = past[deepest + row - late[j], i]
                fed[row, j, p + i] = past[deepest - 1 + row - late[j], i]
