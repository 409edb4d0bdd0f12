"""Gains with a certificate, and code of them."""

from __future__ import annotations

from pathlib import Path

from told import lacks, told

from reobserve import load_design

for kind, options in {"eso": ["--bound", "50"], "kalman": []}.items():
    told("design", kind, "--example", f"{kind}.yaml")
    told("design", kind, f"{kind}.yaml", *options, "--out", f"{kind}.json")
    told("export", f"{kind}.json", "--to", "latex", "--out", kind)
told("export", "kalman.json", "--to", "c", "--out", "code")
assert any(path.suffix == ".c" for path in Path("code").iterdir())
assert load_design("eso.json").observer.system.size

told("design", "normal-form", "--example", "pendulum.yaml")
lacks("symbolic", "design", "normal-form", "pendulum.yaml", "--out", "pendulum.json")
