"""Interacting multiple models against the same bank in C, in filterpy, in numpy and one by one."""

from __future__ import annotations

import ctypes
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from benchmarks.compiled import TUNED, compile_c, pointer
from benchmarks.filter_peers import CalledFilter, Found, OwnFilter, by_filterpy, by_numpy
from benchmarks.filter_problem import CONVERGENCE_RATE, LAYER, TRANSITION, banks, models, record
from benchmarks.report import Check, Row, Section
from benchmarks.timing import medians
from reobserve.core.value import for_loop
from reobserve.observers.imm import IMM, Bank, Posteriors, new_bank_rows, new_bank_work, run_bank

Array = NDArray[np.float64]
Peer = Callable[[], Found]

STEPS, MANY = 10_000, 100_000
# The aims. C keeps the sizes of these matrices in its code, ours reads the number of modes and the
# rows of their matrices at run time.
_SHARE_OF_C, _TIMES_FILTERPY = {"kalman": 0.5, "switching": 0.45}, 500.0
_TOLERANCE = 1e-9
_LABELS = {"kalman": "KF-IMM", "switching": "SVSF-IMM"}
# What a C programmer would say: contraction is then up to the compiler.
_FLAGS = (("-O3",), ("-O3", TUNED))


def run(quick: bool) -> Section:
    """All benchmarks of the interacting multiple model."""
    repeats = 5 if quick else 21
    section = Section(
        "Interacting multiple models: 3 modes, 4 states, 1 input, 1 output; times are of one step",
        f"median of {repeats} rounds, peers in turns; speed is the peer's time over ours",
    )
    libraries = {}
    for flags in _FLAGS:
        c = compile_c("imm.c", (flags,))
        if c is None:
            section.notes.append(f"no C compiler takes {' '.join(flags)}: that C is skipped")
        else:
            libraries[f"C {' '.join(flags)}"] = c.library
    for kind, steps in (("kalman", STEPS), ("kalman", MANY), ("switching", MANY)):
        _against_c(section, libraries, kind, steps, repeats)
    _against_python(section, STEPS // 10 if quick else STEPS, repeats)
    return section


def _run(bank: IMM, z: Array, u: Array) -> Found:
    """From a step before the first row, over which the first control is held."""
    start = bank.init(np.zeros(4), 1.0, u=u[0])
    done = bank.run(z, u[1:], start=start)
    return done["state"], done["probability"]


def _against_c(
    section: Section, libraries: dict[str, ctypes.CDLL], kind: str, steps: int, repeats: int
) -> None:
    bank = banks()[kind]
    z, u, _ = record(steps)
    label = f"{_LABELS[kind]}, {steps:,} steps"
    peers = {name: _c_call(library, kind, bank, z, u) for name, library in libraries.items()}
    agreeing = _agreeing(section, label, _run(bank, z, u), peers)
    jobs: dict[str, Callable[[], object]] = {
        "run": lambda: _run(bank, z, u),
        "loop": _loop(bank, z, u),
        **agreeing,
    }
    times = {name: time / steps for name, time in medians(jobs, repeats).items()}
    for name in agreeing:
        aim = None if TUNED in name else _SHARE_OF_C[kind]
        section.rows += [
            Row(f"{label}: run, checks included", times["run"], name, times[name], aim=aim),
            Row(f"{label}: compiled loop alone", times["loop"], name, times[name], aim=aim),
        ]
    section.notes.append(_rates(label, times))


def _loop(bank: IMM, z: Array, u: Array) -> Callable[[], int]:
    """The compiled loop alone: no checks, and no allocation but of a few small arrays."""
    gain = bank._linear[0].method.function
    matrices = bank._model, bank._parameters, for_loop(bank.transition)
    compiled = Bank(*matrices, bank.mixing)
    held = u[:, None]
    rows = new_bank_rows(len(z), 3, 4, 1)

    def call() -> int:
        covariances = np.tile(np.eye(4), (3, 1, 1))
        posteriors = Posteriors(
            np.zeros((3, 4)), covariances, np.zeros((3, 1)), np.log(np.full(3, 1.0 / 3.0)),
            np.ones(1), np.zeros(1),
        )  # fmt: skip
        work = new_bank_work(posteriors, compiled.mixing)
        return run_bank(compiled, gain, posteriors, z, held, False, work, rows)

    return call


def _c_call(library: ctypes.CDLL, kind: str, bank: IMM, z: Array, u: Array) -> Peer:
    rows: list[Any] = []
    for model in models():
        inverse = np.linalg.pinv(model.arrays.C)
        rows += [
            *(part.ravel() for part in model.arrays),
            inverse.ravel(),
            [LAYER, CONVERGENCE_RATE],
        ]
    constants = np.concatenate([*rows, np.ravel(bank.transition)])
    first = np.concatenate(
        [np.zeros(12), np.tile(np.eye(4).ravel(), 3), np.zeros(3), np.full(3, 1.0 / 3.0)]
    )
    found, function, steps = new_bank_rows(len(z), 3, 4, 1), library[kind], ctypes.c_long(len(z))
    function.restype = ctypes.c_long
    places = [pointer(array) for array in found[:4]]

    def call() -> Found:
        posteriors = first.copy()
        function(pointer(constants), pointer(posteriors), pointer(z), pointer(u), steps, *places)
        return found.state, found.probability

    return call


def _against_python(section: Section, steps: int, repeats: int) -> None:
    """Short runs of what is slow; what they compute is compared over the whole record."""
    bank, modes = banks()["kalman"], models()
    z, u, truth = record(STEPS)
    own = IMM([OwnFilter(model) for model in modes], TRANSITION)
    called = IMM([CalledFilter(one) for one in bank._linear], TRANSITION)

    def peers(rows: int) -> dict[str, Peer]:
        return {
            "filterpy": lambda: by_filterpy(modes, TRANSITION, z[:rows], u[: rows + 1]),
            "numpy": lambda: by_numpy(modes, TRANSITION, z[:rows], u[: rows + 1]),
            "own filters, one by one": lambda: _run(own, z[:rows], u[: rows + 1]),
            "our filters, one by one": lambda: _run(called, z[:rows], u[: rows + 1]),
        }

    done = _run(bank, z, u)
    label, short = f"{_LABELS['kalman']}, {STEPS:,} steps", STEPS // 40
    whole = (done[0][:steps], done[1][:steps])
    agreeing = _agreeing(section, f"{_LABELS['kalman']}, {steps:,} steps", whole, peers(steps))
    brief = peers(short)
    jobs: dict[str, Callable[[], object]] = {
        "run": lambda: _run(bank, z, u),
        **{name: brief[name] for name in agreeing},
    }
    ran = {"run": STEPS, **dict.fromkeys(agreeing, short)}
    times = {name: time / ran[name] for name, time in medians(jobs, repeats).items()}
    for name in agreeing:
        aim = _TIMES_FILTERPY if name == "filterpy" else None
        section.rows.append(
            Row(f"{label}: run, checks included", times["run"], name, times[name], aim=aim)
        )
    right = np.mean(np.argmax(done[1], axis=1) == truth)
    section.notes += [
        _rates(label, times),
        f"filterpy, numpy and filters one by one ran {short} of the steps; own filters are in "
        "numpy, as a user might write them, ours are in a wrapper that hides what they are",
        f"the most probable mode is the true one in {right:.0%} of the steps",
    ]


def _agreeing(section: Section, label: str, ours: Found, peers: dict[str, Peer]) -> dict[str, Peer]:
    """Check what the peers compute; those that compute something else are not measured."""
    agreeing = {}
    for name, peer in peers.items():
        checks = [
            Check(f"{label}, {name}, {what}", float(np.max(np.abs(one - other))), _TOLERANCE)
            for what, one, other in zip(("states", "probabilities"), ours, peer(), strict=True)
        ]
        section.checks += checks
        if all(check.agrees for check in checks):
            agreeing[name] = peer
        else:
            section.notes.append(f"{label}: {name} computes something else and is not measured")
    return agreeing


def _rates(label: str, times: dict[str, float]) -> str:
    listed = ", ".join(f"{name} {1.0 / time:,.3g}" for name, time in times.items())
    return f"{label}, steps per second: {listed}"
