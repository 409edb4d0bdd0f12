"""Stage archive: a build, packed as an RO-Crate to deposit and cite."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from reobserve_papers.report.research_object import write_archive


def run(products: Sequence[str], output: Path, project: Path) -> None:
    """Write the crate of a build's products, and print how many files it holds."""
    count = write_archive(project, output, products)
    print(f"{output}: {count} files, described in its ro-crate-metadata.json")
