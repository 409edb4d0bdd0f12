"""A task in its own folder: the level of a noisy signal, of which a share is known."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import yaml

from reobserve.tuning.results import Results
from reobserve.tuning.task import Task
from reobserve.tuning.tuned_file import Cost, Repeat, TunedMethod, TunedOn

MODULE = '''
from dataclasses import dataclass
import numpy as np
from reobserve.tuning.task import TaskRecord
from reobserve.core.errors import DivergenceError

@dataclass(frozen=True)
class Plant:
    noise: float
    level: float = 1.0

def simulate(plant, condition, seed, period):
    """Constant truth; the measurement is off by the same random number in all rows."""
    draw = np.random.default_rng(seed)
    truth = np.full((11, 1), plant.level)
    off = condition.noise * plant.noise * draw.normal() + condition.model
    return TaskRecord(period * np.arange(11.0), np.zeros((11, 0)), truth + off, truth)

def share(plant, s, period, noise):
    """Measured times a share; its error is |share (1 + off) - 1|."""
    return lambda record: s["share"] * record.measurements

def reported(plant, s, period, noise):
    """The best share in the mean: 1 / (1 + noise^2)."""
    return lambda record: s["trust"] / (1 + noise**2) * record.measurements

def fragile(plant, s, period, noise):
    def run(record):
        if record.measurements[0, 0] > 1.5:
            raise DivergenceError("fragile", 0.0)
        return s["share"] * record.measurements
    return run

METHODS = {"share": share, "reported": reported, "fragile": fragile}
'''
SHARE = {"range": [0.1, 10.0], "unit": "1", "why": "a decade on each side"}


def method(**keys: Any) -> dict[str, Any]:
    ranges = {"share": dict(SHARE)}
    return {"label": "L", "needs": "k", "guarantees": "g", "ranges": ranges, **keys}


def stated() -> dict[str, Any]:
    return {
        "title": "toy", "estimates": "level", "period": 0.1, "scored_from": 0.0, "budget": 40,
        "plant": {"noise": 0.1, "level": 1.0},
        "conditions": {
            "nominal": {"title": "as tuned"},
            "noise": {"title": "more noise", "noise": 5.0},
            "high": {"title": "a high level", "plant": {"level": 2.0}},
        },
        "training": {
            "nominal": {"title": "tuned", "conditions": ["nominal"], "repeats": 3},
            "noise": {"title": "re-tuned", "conditions": ["noise"]},
        },
        "methods": {
            "share": method(),
            "reported": method(given_noise=True, ranges={"trust": dict(SHARE)}),
        },
        "table": ["nominal", "noise"], "shown": ["share"],
        "seeds": {"training": 8, "step": 16, "most": 64},
    }  # fmt: skip


def write(folder: Path, tree: dict[str, Any]) -> Path:
    (folder / "toy.py").write_text(MODULE)
    path = folder / "toy.yaml"
    path.write_text(yaml.safe_dump(tree, sort_keys=False))
    return path


def toy(folder: Path, **changed: Any) -> Task:
    return Task.read(write(folder, {**stated(), **changed}))


def cell(condition: str, method: str, training: str = "nominal", **keys: Any) -> dict[str, Any]:
    return {
        "condition": condition, "method": method, "training": training, "given_noise": "no",
        "seeds": 16.0, "error": 0.2, "low": 0.1, "high": 0.3, "first": keys.get("error", 0.2),
        "ratio": 1.0, "ratio_low": 1.0,
        "ratio_high": 1.0, "within": "yes", "failed": 0.0, "lag": 0.012, "quantile": 0.5,
        "missed": np.nan, "nees": np.nan,
        "repeat_low": 0.1, "repeat_high": 0.3, **keys,
    }  # fmt: skip


def stated_results(folder: Path) -> Results:
    """Results with stated numbers, of no tuning."""
    tree = stated()
    own = {"settings": {"share": 1.0}, "source": "p. 1"}
    tree["methods"] = {"share": method(label="Share", paper=own),
                       "reported": method(label="Given", given_noise=True)}  # fmt: skip
    tree["conditions"]["wrong"] = {"title": "wrong", "model": 0.1}
    tree["shown"] = ["share", "reported"]
    cells = [
        cell("nominal", "share", error=0.25, ratio=1.25, within="no"),
        cell("nominal", "reported", within="undecided"),
        cell("nominal", "share", "paper", error=2.5, ratio=12.5, within="no", failed=0.25),
        cell("noise", "share", error=0.75),
        cell("noise", "share", "noise", error=0.65),
        cell("noise", "reported", error=0.55),
        cell("noise", "reported", given_noise="yes", error=0.45),
        cell("noise", "reported", "noise", given_noise="yes", error=0.35),
        cell("high", "share", error=0.15),
        cell("wrong", "share", error=0.85),
    ]
    repeats = [
        Repeat(
            {"share": 1.0},
            0.0,
            {"share": "high"},
            dict(zip(("10", "25", "40"), errors, strict=True)),
        )
        for errors in ((0.5, 0.3, 0.2), (0.4, 0.21, 0.2), (0.6, 0.2, 0.2))
    ]
    tuned = TunedMethod({"nominal": TunedOn("", repeats)}, Cost(1.5, 0.25))
    task = Task.read(write(folder, tree))
    return Results(task, cells, {"share": tuned, "reported": tuned})
