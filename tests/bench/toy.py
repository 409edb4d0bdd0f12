"""A task in its own folder: the level of a noisy signal, of which a share is known."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import yaml

from reobserve.bench.task import Task

MODULE = '''
from dataclasses import dataclass
import numpy as np
from reobserve.bench.task import Record
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
    return Record(period * np.arange(11.0), np.zeros((11, 0)), truth + off, truth)

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
