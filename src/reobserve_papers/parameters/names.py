"""Names that a checkout gives to its files, and that a paper gives to its modules."""

from __future__ import annotations

import sys
from importlib.util import find_spec
from pathlib import Path

CONVENTIONS = "config/conventions.yaml"  # by which claims are decided
DEFAULT_STYLE = "default"

_PACKAGE = Path(__file__).parents[1]


def own_project() -> Path:
    """The checkout that this package is in, or what was installed with it of a checkout."""
    checkout = _PACKAGE.parents[1]
    return checkout if (checkout / "config" / "papers").is_dir() else _PACKAGE / "project"


def workflow_path() -> str:
    """The Snakefile of this installation, for the ``module`` of another one."""
    return str(own_project() / "workflow" / "Snakefile")


def add_sources(project: Path) -> None:
    """Let modules in the ``src`` of a project be imported: those of its own papers."""
    folder = str((project / "src").absolute())
    if Path(folder).is_dir() and folder not in sys.path:
        sys.path.insert(0, folder)


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


def style_sheet(project: Path, name: str) -> str:
    """The path of a style sheet: the project's own, or one of this installation."""
    return _shared(project, f"config/styles/{name}.mplstyle")


def caption_template(project: Path, paper: str, name: str, general: str) -> str:
    """The path of a caption's template: the figure's or table's own, or the ``general`` one."""
    own = f"workflow/report/{paper}/{name}.rst"
    return own if (project / own).is_file() else _shared(project, f"workflow/report/{general}.rst")


def shared_texts(project: Path) -> Path:
    """The folder of texts that all papers share: the project's, or that of this installation."""
    return project / Path(_shared(project, "workflow/report/figure_diff.js")).parent


def _shared(project: Path, path: str) -> str:
    return path if (project / path).exists() else str(own_project() / path)
