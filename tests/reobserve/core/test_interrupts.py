"""Loops that a signal interrupts."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from threading import Thread
from typing import Any

import numpy as np
import pytest

from reobserve import KalmanFilter, LinearModel, rts_smoother
from reobserve.core.interrupts import FIRST, next_poll

# Sends SIGINT to itself in runs that take seconds, and prints how long it took to end them.
SCRIPT = """
import os, signal, threading, time
import numpy as np
from reobserve import ExtendedKalmanFilter, KalmanFilter, LinearModel, NonlinearModel

signal.signal(signal.SIGINT, signal.default_int_handler)  # shells ignore it in background jobs
n = 36
chain = KalmanFilter(LinearModel(0.9 * np.eye(n), C=np.eye(1, n), Q=1e-4, R=1e-2))
ode = NonlinearModel.from_ode(
    ["w", "-sin(a)"], ["a"], Q=1e-4, R=1e-2, state_names=["a", "w"], sampling_period=0.01,
    substeps=2000,
)
y = np.zeros((40_000, 1))
runs = {
    "one": (chain, y, n), "many": (chain, np.zeros((4, 12_000, 1)), n),
    "extended": (ExtendedKalmanFilter(ode), y, 2),
}
for name, (filter, rows, size) in runs.items():
    state = filter.init(np.zeros(size), 1.0)
    filter.run(rows[..., :3, :], start=state)
    sent = []

    def send():
        sent.append(time.monotonic())
        os.kill(os.getpid(), signal.SIGINT)

    threading.Timer(0.2, send).start()
    try:
        filter.run(rows, start=state)
        late = "never"
    except KeyboardInterrupt:
        late = time.monotonic() - sent[0]
    print(name, late, flush=True)
"""


@pytest.fixture(autouse=True)
def interrupted() -> Iterator[None]:
    """The handler of Python, where a shell has ignored the signal in a background job."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


@pytest.mark.nightly
def test_interrupt_ends_long_runs_within_a_second() -> None:
    found = subprocess.run(
        [sys.executable, "-c", SCRIPT], capture_output=True, text=True, check=True
    )
    late = dict(line.split() for line in found.stdout.splitlines())
    assert set(late) == {"one", "many", "extended"}
    assert all(float(one) < 1.0 for one in late.values()), late


def _filter() -> tuple[KalmanFilter, Any, Any]:
    rng = np.random.default_rng(1)
    model = LinearModel([[1.0, 0.1], [0.0, 0.9]], C=[[1.0, 0.0]], Q=1e-4, R=1e-2)
    kalman = KalmanFilter(model)
    return kalman, rng.standard_normal((400_000, 1)), kalman.init([0.0, 0.0], 1.0)


def test_handler_that_raises_nothing_changes_no_bit() -> None:
    kalman, y, state = _filter()
    called = []
    before = signal.signal(signal.SIGALRM, lambda *_: called.append(time.monotonic()))
    try:
        signal.setitimer(signal.ITIMER_REAL, 0.005, 0.005)
        disturbed = kalman.run(y, start=state)
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        signal.signal(signal.SIGALRM, before)
    left = kalman.run(y[:300], start=state)
    right = kalman.run(y[300:], start=left.end)
    assert called
    assert np.array_equal(disturbed["state"][300:], right["state"])
    assert np.array_equal(disturbed["covariance"][300:], right["covariance"])


def _interrupt() -> None:
    os.kill(os.getpid(), signal.SIGINT)
    time.sleep(5)


def test_interrupt_leaves_other_threads_alone() -> None:
    kalman, y, state = _filter()
    wanted, found = kalman.run(y, start=state), []
    thread = Thread(target=lambda: found.append(kalman.run(y, start=state)))
    thread.start()
    with pytest.raises(KeyboardInterrupt):
        _interrupt()
    thread.join()
    assert np.array_equal(found[0]["state"], wanted["state"])


def test_smoother_looks(monkeypatch: pytest.MonkeyPatch) -> None:
    kalman, y, state = _filter()
    run, rows = kalman.run(y[: 2 * FIRST], start=state), []

    def looked(row: int) -> int:
        rows.append(row)
        return row + FIRST

    monkeypatch.setattr("reobserve.core.interrupts.next_poll", looked)
    rts_smoother(run)
    assert rows == [FIRST]


@pytest.mark.parametrize("seconds", [1e-6, 1e-3, 1.0])
def test_looks_come_every_tenth_of_a_second(
    seconds: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    row = FIRST
    clock = [0.0]
    monkeypatch.setattr("reobserve.core.interrupts.time.monotonic", lambda: clock[0])
    for _ in range(6):
        after = next_poll(row)
        clock[0] += (after - row) * seconds
        row, apart = after, (after - row) * seconds
    assert apart <= max(0.11, 2 * seconds)
    assert next_poll(FIRST) == 2 * FIRST  # a loop of its own
