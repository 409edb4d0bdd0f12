"""No command overwrites a file that it reads, or one of another kind than it writes."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from reobserve.core.errors import InputError

# Options that name what a command writes; all other paths but the project's are read.
_WRITTEN = ("output", "outputs", "out", "caption", "plot", "report", "record", "state")


def check_outputs(options: dict[str, Any]) -> None:
    """Refuse a command line on which a file is both read and written.

    Where the options have ``begins``, an output replaces a file only that begins with one of these.
    """
    begins = options.pop("begins", None)
    written = [path for name in _WRITTEN for path in _paths(options, name)]
    if not written:
        return
    # With numpy, which looking around spares.
    from reobserve.core.files import check_not_read, read_bytes

    names = options.keys() - {*_WRITTEN, "project"}
    check_not_read(written, [path for name in names for path in _paths(options, name)])
    if "project" in options:  # whose configuration is read
        config = options["project"] / "config"
        for path in written:
            check_not_read([path], [path] if _below(path, config) else [])
    if begins and written[0].is_file():
        content = read_bytes(written[0], None)
        if content and not content.startswith(begins):
            problem = "is no file that this command writes, and so it is not replaced"
            raise InputError(str(written[0]), problem)


def _paths(options: Mapping[str, Any], name: str) -> Iterator[Path]:
    value = options.get(name)
    for path in value if isinstance(value, list) else [value]:
        if isinstance(path, Path):
            yield path
        elif name == "products":  # of an archive, below the project
            yield options["project"] / path


def _below(path: Path, folder: Path) -> bool:
    try:
        return folder.resolve() in path.resolve().parents
    except (OSError, ValueError):  # no path at all
        return False
