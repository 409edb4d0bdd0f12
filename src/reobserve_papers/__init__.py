"""Papers on observers, replicated: plants, parameters, figures, claims, and the pipeline for them.

`replicate` recomputes one figure; the command `reobserve-papers` and the workflow do the rest.
`workflow_path` is where another Snakefile finds that workflow, to take its rules.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from reobserve_papers.parameters.names import workflow_path
    from reobserve_papers.steps.one_figure import replicate

__all__ = ["replicate", "workflow_path"]

# Named by text: what imports the package does not import all of it.
_MODULES = {"replicate": "steps.one_figure", "workflow_path": "parameters.names"}


def __getattr__(name: str) -> Any:
    if name in _MODULES:
        return getattr(import_module(f"{__name__}.{_MODULES[name]}"), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
