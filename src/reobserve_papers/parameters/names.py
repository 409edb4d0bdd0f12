"""Names that a checkout gives to its files, and that a paper gives to its modules."""

from __future__ import annotations

from importlib.util import find_spec
from pathlib import Path

DEFAULT_STYLE = "default"


def paper_part(package: str, part: str) -> str:
    """The module of a part of a paper, whose package may be one module with all parts."""
    try:
        spec = find_spec(package)
    except ModuleNotFoundError:
        spec = None
    whole = spec is not None and spec.submodule_search_locations is None
    return package if whole else f"{package}.{part}"


def stored_parameters(paper: str) -> str:
    """The path, in a project, of a paper's parameters with the overrides of the last build."""
    return f"results/{paper}/parameters.json"


def claims_path(paper: str) -> str:
    """The path of a paper's claims, in a project."""
    return f"config/claims/{paper}.yaml"


def samples_path(paper: str) -> str:
    """The path of the cached Monte Carlo samples of a paper's claims, in a project."""
    return f"config/samples/{paper}.json"


def style_sheet(name: str) -> str:
    """The path of a style sheet, in a project."""
    return f"config/styles/{name}.mplstyle"


def caption_template(project: Path, paper: str, name: str, general: str) -> str:
    """The path of a caption's template: the figure's or table's own, or the ``general`` one."""
    own = f"workflow/report/{paper}/{name}.rst"
    return own if (project / own).is_file() else f"workflow/report/{general}.rst"
