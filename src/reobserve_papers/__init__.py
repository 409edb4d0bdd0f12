"""Papers on observers, replicated: plants, parameters, figures, claims, and the pipeline for them.

`replicate` recomputes one figure; the command `reobserve-papers` and the workflow do the rest.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from reobserve_papers.steps.one_figure import replicate

__all__ = ["replicate"]


def __getattr__(name: str) -> Any:
    if name == "replicate":  # named by text: what imports the package does not import all of it
        return import_module(f"{__name__}.steps.one_figure").replicate
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
