"""Configuration files: which there are, and the checks of what is to be built."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from pathlib import Path

from reobserve.core.documents import Tree, check_plain, read_json, read_yaml
from reobserve.core.errors import InputError, nearest, shown
from reobserve.core.files import reason
from reobserve.core.validation import parse
from reobserve_papers.parameters.names import DEFAULT_STYLE, own_project


def known_papers(project: Path) -> list[str]:
    """The papers that have a parameter file."""
    folder = project / "config" / "papers"
    try:
        papers = sorted(path.stem for path in folder.glob("*.yaml"))
    except (OSError, ValueError) as error:  # ValueError: a path that the system cannot spell
        raise InputError(str(folder), f"cannot be read ({reason(error)})") from None
    from reobserve_papers.parameters.parameter_file import Name  # which most jobs do without

    for paper in papers:
        parse(Name, paper, "config.papers")
    return papers


def known_tasks(project: Path) -> list[str]:
    """The tasks of the bench: names of their files."""
    return sorted(path.stem for path in (project / "config" / "bench").glob("*.yaml"))


def named_papers(known: Sequence[str], papers: Sequence[str]) -> list[str]:
    """The papers that are named, or all that are known, or `InputError` if one is not."""
    refuse_unknown("paper", papers, known)
    return list(dict.fromkeys(papers or known))


def refuse_unknown(place: str, names: Iterable[str], known: Iterable[str]) -> None:
    """Raise `InputError` if one of the names is not known."""
    for name in names:
        if name not in known:
            raise InputError(place, f"there is no {shown(name)}{nearest(name, known)}")


def known_styles(project: Path) -> list[str]:
    """The styles of figures with a sheet, here or in this installation, and the default style."""
    folders = (one / "config" / "styles" for one in (project, own_project()))
    sheets = (path.stem for folder in folders for path in folder.glob("*.mplstyle"))
    return sorted({DEFAULT_STYLE, *sheets})


def check_config_files(*paths: str | Path) -> None:
    """Check what Snakemake's own reader would not: every key once, and plain values only."""
    for path in map(Path, paths):
        if path.suffix == ".json":
            read_json(path)
        else:
            read_yaml(path)


def take_truths(config: Tree) -> None:
    """Take the words true and false as YAML does: Snakemake's ``--config`` knows Python's only."""
    for key, value in config.items():
        if isinstance(value, str) and value in ("true", "false"):
            config[key] = value == "true"


def check_config(project: Path, config: Tree, papers: list[str]) -> None:
    """Check what `config/config.yaml` and the command line say is to be built."""
    from reobserve_papers.parameters.parameter_file import Configuration

    check_plain(config, "config")
    known = [*Configuration.model_fields, *papers]
    for key in config:
        if key not in known:
            raise InputError(f"config.{key}", f"unknown key{nearest(key, known)}")
    for key, value in config.items():
        if value is None:
            raise InputError(f"config.{key}", "is left empty; give it a value, or leave it out")
    parse(Configuration, config, "config")
    for key, there in (("papers", papers), ("bench", known_tasks(project))):
        refuse_unknown(f"config.{key}", config.get(key, ()), there)
    refuse_unknown("config.style", [config.get("style", DEFAULT_STYLE)], known_styles(project))
