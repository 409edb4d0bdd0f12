"""Observers that take a step from the row before to each row."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from reobserve.codegen.program import Program, finite, leaves, report, reported
from reobserve.observers import adaptive, extended_state, high_gain, ilo, levant, normal_form
from reobserve.observers.contract import Observer
from reobserve.observers.fixed_step import Samples
from reobserve.observers.rigid_body_observer import RigidBodyRecord, RigidBodyRows
from reobserve.polynomials.evaluation_kernels import polynomials

Array = NDArray[Any]


class StepRows:
    """Measurements and inputs in a step: at the row before, in the middle and at the row.

    ``state`` has what the observer starts from, None for the first measurement.
    """

    def __init__(self, observer: Observer[Any], state: Any) -> None:
        p, m = observer.measurements, observer.inputs
        self.y, self.u, self.all = np.empty(p), np.empty(m), np.empty((3, p + m))
        self.measured, self.known = self.all[:, :p], self.all[:, p:]
        sample = None if state is None else state.sample
        last = np.zeros(p + m) if sample is None else sample
        self.started = np.array([int(sample is not None)])
        self.memory = {"y_before": last[:p].copy(), "u_before": last[p:].copy()}

    def program(
        self, title: str, move: Any, begin: Any, given: tuple[Any, ...], held: Mapping[str, Array],
        found: Mapping[str, Array], scratch: Mapping[str, Any], checked: tuple[Array, ...] = (),
        series: Any = None,
    ) -> Program:  # fmt: skip
        """The program whose memory ``held`` is moved from row to row, and begun at the first.

        ``series`` are the arguments of the kernel that finds estimates in it, if there is one.
        """
        estimates, copies = reported(found, tuple(scratch.values()))
        before = tuple(self.memory.values())
        # A record's kernel itself ends where its rows are not finite.
        checked = checked or (before if move is _along else (*before, *held.values()))
        return Program(
            title, _step,
            (self.y, self.u, self.started, *before, self.all, move, begin, given, checked, series,
             copies),
            self.y, self.u, {**held, **self.memory, "started": self.started}, estimates,
            leaves(rows=self.all, **scratch),
        )  # fmt: skip


def _step(
    y: Array, u: Array, started: Array, y_before: Array, u_before: Array, rows: Array, move: Any,
    begin: Any, given: Any, checked: Any, series: Any, copies: Any,
) -> int:  # fmt: skip
    p, good = len(y), True
    for i in range(p):
        rows[2, i] = y[i]
    if started[0] == 1:
        # What is measured goes in a straight line, what is known is held.
        for i in range(p):
            rows[0, i] = y_before[i]
            rows[1, i] = 0.5 * y_before[i] + 0.5 * y[i]
        for i in range(len(u)):
            rows[0, p + i] = rows[1, p + i] = rows[2, p + i] = u_before[i]
        good = move(*given)
    elif begin is not None:
        begin(rows[2], *given)
    for i in range(p):
        y_before[i] = y[i]
    for i in range(len(u)):
        u_before[i] = u[i]
    started[0] = 1
    good = good and finite(checked)
    if good:
        if series is not None:
            normal_form._evaluate_rows(*series)
        report(copies)
    return 0 if good else 1


def differentiator(
    observer: levant.LevantDifferentiator, state: levant.LevantState | None
) -> Program:
    """Levant's differentiator."""
    rows, order = StepRows(observer, state), observer.order
    begun = observer.init(np.zeros(order + 1)) if state is None else state
    z = begun.derivatives.copy()
    path = np.broadcast_to(z, (2, order + 1))  # a step reads no entry that it has written
    given = z, path, levant._run, (observer._law, rows.all[::2, 0], path)
    return rows.program(
        "Robust exact differentiator", _along, _from_first if state is None else None, given,
        {"derivatives": z}, {"derivatives": z}, {},
    )  # fmt: skip


def standard_high_gain(
    observer: high_gain.HighGainObserver, state: high_gain.HighGainState
) -> Program:
    """The standard high-gain observer."""
    rows, path = StepRows(observer, state), np.empty((2, observer.model.states))
    x, model = state.estimate.copy(), observer.model
    y, u = rows.all[:, 0], rows.all[:, 1]
    record = high_gain.HighGainRecord(y, y, u, u)
    given = x, path, high_gain._run, (
        model.drift, model.input_gain, model.parameters, observer.gain, observer.sampling_period,
        record, path,
    )  # fmt: skip
    return rows.program(
        "High-gain observer", _along, None, given, {"x": x}, {"state": x}, {"path": path}
    )


def identity(
    observer: normal_form.IdentityObserver, state: normal_form.NormalFormState | None
) -> Program:
    """The normal-form observer in identity form."""
    rows, begun = StepRows(observer, state), state or observer._start(np.zeros(0))
    x, n, law = begun.values.copy(), len(begun.values), observer._law
    path, work = np.empty((2, n)), observer._work(n)
    known = rows.all, rows.all
    given = x, path, normal_form._run_identity, (law, work, observer.sampling_period, *known, path)
    title = f"Normal-form observer of order {observer.order}"
    return rows.program(
        title, _along, None, given, {"x": x}, {"state": x}, {"path": path, "work": work}
    )


def transformed(
    observer: normal_form.TransformedObserver, state: normal_form.NormalFormState | None
) -> Program:
    """The normal-form observer in the coordinates of the normal form."""
    rows, begun = StepRows(observer, state), state or observer._start(np.zeros(0))
    z, n = begun.values.copy(), len(begun.values)
    injection, T = polynomials(observer.normal_form.injected), polynomials(observer.T)
    path, x = np.empty((2, n)), np.empty((1, n))
    work = np.empty(max(len(injection.parent), len(T.parent))), np.empty((3, n))
    run = (*observer._transition, injection, work, rows.all, rows.all, path)
    given = z, path, normal_form._run_transformed, run
    title = f"Normal-form observer of order {observer.order}, transformed"
    return rows.program(
        title, _along, None, given, {"z": z}, {"state": x[0], "coordinates": z},
        {"path": path, "monomials": work[0], "injected": work[1], "x": x},
        series=(T, work[0], z[None], x),
    )  # fmt: skip


def extended_state_observer(
    observer: extended_state.ExtendedStateObserver, state: extended_state.EsoState | None
) -> Program:
    """The extended state observer, sampled exactly."""
    rows, begun, weights = StepRows(observer, state), state or observer.init(), observer._weights
    z, system = np.concatenate([begun.filtered, begun.estimate]), observer.system
    path, known, p, n = np.empty((2, len(z))), np.empty(len(weights)), system.outputs, system.states
    y, u = (Samples(one, one) for one in (rows.measured, rows.known))
    given = z, known, extended_state._run, ((0.0,) * len(z), weights, known, y, u, path)
    ends = np.cumsum([p, n, p, system.Fa.shape[1], system.Fs.shape[1]]).tolist()
    found = {
        "state": z[ends[0] : ends[1]], "actuator_fault": z[ends[2] : ends[3]],
        "sensor_fault": z[ends[3] : ends[4]],
    }  # fmt: skip
    found = {name: values for name, values in found.items() if len(values)}
    return rows.program(
        "Extended state observer",
        _known_along,
        None,
        given,
        {"z": z},
        found,
        {"path": path, "known": known},
    )


def rigid_body(observer: Any, state: Any) -> Program:
    """Iterative learning observers, continuous and sampled, and the adaptive one."""
    learning = isinstance(observer, ilo.LearningObserver)
    rows, begun = StepRows(observer, state), observer.init(np.zeros(3)) if state is None else state
    w, held, y, u = begun.rate.copy(), begun.memory.copy(), rows.measured, rows.known
    found = RigidBodyRows(*np.empty((3, 2, 3)))
    front: tuple[Any, ...] = (observer._constants,)
    run: Any
    phase = np.array([begun.count % observer.delay if learning else 0])
    if isinstance(observer, ilo.SampledILO):
        run, name, title = ilo._run_sampled, "v", "Iterative learning observer, sampled"
        front = (*front, observer.delay)
    elif learning:
        run, name, title = ilo._run_continuous, "past", "Iterative learning observer, continuous"
    else:
        run, name, title = adaptive._run, "z", "Adaptive observer"
    given = (
        run, front, w, held, phase, observer.delay if learning else None,
        (RigidBodyRecord(y, y, u, u), found),
        (RigidBodyRecord(y[2:], y[2:], u[2:], u[2:]), RigidBodyRows(*(one[1:] for one in found))),
        state is None,
    )  # fmt: skip
    return rows.program(
        title, _turned, _first_turned, given, {"w": w, name: held, "phase": phase},
        {"rate": w, "fault": found.fault[1]}, {"found": found}, (w, found.fault[1]),
    )  # fmt: skip


def _along(z: Array, path: Array, run: Any, given: Any) -> bool:
    for i in range(len(z)):
        path[0, i] = z[i]
    good: bool = run(*given) == 2
    if good:
        for i in range(len(z)):
            z[i] = path[1, i]
    return good


def _from_first(y: Array, z: Array, path: Array, run: Any, given: Any) -> None:
    z[0] = y[0]


def _known_along(z: Array, known: Array, run: Any, given: Any) -> bool:
    for i in range(len(z)):
        known[i] = z[i]
    good: bool = run(*given) == 2
    for i in range(len(z)):
        z[i] = known[i]
    return good


def _turned(
    run: Any, front: Any, w: Array, held: Array, phase: Array, delay: int | None, step: Any,
    first: Any, fresh: bool,
) -> bool:  # fmt: skip
    if delay is None:
        good: bool = run(*front, w, held, *step) == 2
    else:
        good = run(*front, w, held, phase[0], *step) == 2
        phase[0] = phase[0] + 1 if phase[0] + 1 < delay else 0
    return good


def _first_turned(
    y: Array, run: Any, front: Any, w: Array, held: Array, phase: Array, delay: int | None,
    step: Any, first: Any, fresh: bool,
) -> None:  # fmt: skip
    if fresh:
        for i in range(3):
            w[i] = y[i]
    if delay is None:
        run(*front, w, held, *first)
    else:
        run(*front, w, held, phase[0], *first)
