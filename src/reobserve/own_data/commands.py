"""What `reobserve estimate` does."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from reobserve.errors import InputError
from reobserve.own_data.account import as_json, as_table
from reobserve.own_data.estimation import Estimated, Estimation
from reobserve.own_data.reading import BLOCK, File
from reobserve.own_data.specification import Specification, read_specification
from reobserve.own_data.writing import check_name, write_results


def estimate_file(
    specification: Specification, data: Path, out: Path, *, block: int = BLOCK
) -> Estimation:
    """Estimates of a record in a file, written to another; what became of it is in the account.

    Raises
    ------
    InputError
        If the record, or a policy for it, does not allow it; nothing is written then.
    DivergenceError
        If the observer diverges.
    """
    check_name(out)
    columns = specification.columns
    file = File(data, columns.separator, columns.decimal, block)
    estimation = Estimation(specification, file.header(), str(data))
    write_results(
        out, estimation.titles, _blocks(estimation, file),
        lambda: as_json(estimation.account, {}),
    )  # fmt: skip
    return estimation


def _blocks(estimation: Estimation, file: File) -> Iterator[Estimated]:
    for raw in file.blocks(estimation.layout.titles):
        yield estimation.feed(raw)
    yield estimation.finish()
    if not estimation.account.estimates:
        raise InputError(str(file.path), "has no row from which the observer could start")
