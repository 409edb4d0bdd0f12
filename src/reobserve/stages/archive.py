"""Stage archive: a build, packed as an RO-Crate to deposit and cite."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from reobserve.evidence.archive import write_archive


def run(
    output: Path,
    project: Path,
    papers: Sequence[str] | None = None,
    formats: Sequence[str] | None = None,
) -> None:
    """Write it, and say what it holds.

    Raises
    ------
    InputError
        If the build is not whole, is not of what there is now, or cannot be written.
    """
    count = write_archive(project, output, papers, formats)
    print(f"{output}: {count} files, described in its ro-crate-metadata.json")
