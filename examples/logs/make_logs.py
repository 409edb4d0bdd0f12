"""Write three logs with a fault each: `python make_logs.py [FOLDER]`.

bias.csv      a motor whose speed sensor reads 1.5 rad/s too much from 8 s on
thruster.csv  a satellite of which a thruster is stuck open from 6.4 s on, with 0.3 N m about z
leak.csv      a tank that loses 0.12 l/s from 600 s on, about a level of 2 m and a flow of 4 l/s
"""

from __future__ import annotations

import sys
from datetime import UTC, datetime, timedelta
from pathlib import Path

import numpy as np

SEED = 7


def rk4(field, x, time, steps=10):
    """The states at the times, with the input of ``field(t, x, k)`` held over each period k."""
    rows = [np.asarray(x, dtype=float)]
    for k in range(len(time) - 1):
        h, x = (time[k + 1] - time[k]) / steps, rows[-1]
        for i in range(steps):
            t = time[k] + i * h
            k1 = field(t, x, k)
            k2 = field(t + h / 2, x + h / 2 * k1, k)
            k3 = field(t + h / 2, x + h / 2 * k2, k)
            k4 = field(t + h, x + h * k3, k)
            x = x + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
        rows.append(x)
    return np.array(rows)


def bias(random):
    """Speed [rpm], current [mA] and voltage [V]; dates that are stamped up to 0.3 periods late."""
    time = 0.01 * np.arange(1501)
    volts = 6.0 + 3.0 * np.sign(np.sin(1.3 * time)) + np.sign(np.sin(4.1 * time))
    A, B = np.array([[-10.0, 40.0], [-0.4, -20.0]]), np.array([0.0, 20.0])
    x = rk4(lambda t, x, k: A @ x + B * volts[k], [0.0, 0.0], time)
    speed = x[:, 0] + np.where(time >= 8.0, 1.5, 0.0) + random.normal(0, 0.03, len(time))
    current = x[:, 1] + random.normal(0, 0.01, len(time))
    begin = datetime(2026, 3, 2, 14, 5, 0, tzinfo=UTC)
    late = 0.003 * random.random(len(time))
    yield "time,speed [rpm],current [mA],voltage [V]"
    for k, t in enumerate(time + late):
        date = (begin + timedelta(seconds=t)).isoformat(timespec="microseconds")
        yield f"{date},{60 / (2 * np.pi) * speed[k]:.3f},{1000 * current[k]:.1f},{volts[k]:g}"


def thruster(random):
    """Rates [deg/s] and the torques [mN m] that are commanded."""
    time = 0.02 * np.arange(751)
    inertia = np.diag([36.0, 17.0, 26.0])
    inertia[0, 1] = inertia[1, 0] = 1.5
    torque = 0.2 * np.column_stack([np.sin(0.5 * time), np.cos(0.3 * time), np.sin(0.2 * time)])

    def field(t, w, k):
        stuck = np.array([0.0, 0.0, 0.3 if time[k] >= 6.4 else 0.0])
        return np.linalg.solve(inertia, torque[k] + stuck - np.cross(w, inertia @ w))

    rates = np.rad2deg(rk4(field, [0.05, -0.03, 0.04], time)) + random.normal(0, 0.002, (751, 3))
    yield "t [s],wx,wy,wz,Tx,Ty,Tz"
    for k, t in enumerate(time):
        yield ",".join([f"{t:.2f}", *(f"{w:.5f}" for w in rates[k]),
                        *(f"{1000 * T:.3f}" for T in torque[k])])  # fmt: skip


def leak(random):
    """Level [m] and inflow [l/s] once a second, as a German spreadsheet writes them."""
    time = np.arange(1501.0)
    inflow = 4.0 + 0.3 * np.sign(np.sin(0.011 * time))

    def field(t, h, k):
        lost = 0.12 if time[k] >= 600 else 0.0
        return (inflow[k] - 4.0 * np.sqrt(h / 2.0) - lost) / 800.0  # [l] a metre

    level = rk4(field, [2.0], time)[:, 0] + random.normal(0, 0.002, len(time))
    begin = datetime(2026, 3, 2, 14, 5, 0)
    yield "sep=;"
    yield "Zeit;Füllhöhe;Zufluss"
    for k, t in enumerate(time):
        date = (begin + timedelta(seconds=t)).strftime("%d.%m.%Y %H:%M:%S")
        yield f"{date};{level[k]:.4f};{inflow[k]:.2f}".replace(".", ",").replace(",03,", ".03.")


def main(folder: Path) -> None:
    """Write all three."""
    for log, encoding in ((bias, "utf-8"), (thruster, "utf-8"), (leak, "cp1252")):
        lines = log(np.random.default_rng(SEED))
        text = "\n".join(lines) + "\n"
        (folder / f"{log.__name__}.csv").write_bytes(text.encode(encoding))


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else Path(__file__).parent)
