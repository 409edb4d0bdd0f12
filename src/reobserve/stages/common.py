"""What the stages share: settings of a job, provenance, and the paper's own module."""

from __future__ import annotations

import importlib
from dataclasses import replace
from pathlib import Path
from typing import Any

from reobserve.errors import InputError
from reobserve.files import read_table
from reobserve.ledger import Ledger, digest
from reobserve.provenance import code_digest, versions
from reobserve.series import Series


def paper_module(paper: str, stage: str) -> Any:
    """The module ``reobserve.papers.<paper>.<stage>``."""
    return importlib.import_module(f"reobserve.papers.{paper}.{stage}")


def signed(series: Series, ledger: Ledger, stage: str, job: str, settings: Any) -> Series:
    """``series`` with its provenance: what made it, from which settings, by which code."""
    return replace(
        series,
        provenance={
            "paper": ledger.paper,
            "stage": stage,
            "job": job,
            "settings": settings,
            "settings_digest": digest(settings),
            "code_digest": code_digest(stage, ledger.paper),
            "packages": versions(),
        },
    )


def read_estimates(observers: list[str], paths: list[Path]) -> dict[str, Series]:
    """The estimates of a figure by observer, from the files in the same order.

    Raises
    ------
    InputError
        If there are more or fewer files than observers, or one cannot be read.
    """
    if len(paths) != len(observers):
        wanted = ", ".join(observers)
        raise InputError("--estimate-files", f"{len(paths)} given, must be one each for {wanted}")
    return {name: Series.read(path) for name, path in zip(observers, paths, strict=True)}


def read_study(paper: str, path: Path | None) -> list[dict[str, str]] | None:
    """The rows of a figure's study; None for a figure without one."""
    return None if path is None else read_table(path, paper_module(paper, "study").HEADER)
