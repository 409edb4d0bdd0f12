"""`reobserve.load_design`, which imports what it needs when it is called."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from reobserve.core.extras import package

if TYPE_CHECKING:
    from reobserve.estimation.families.design import Design


def load_design(path: str | Path) -> Design:
    """Read the design in a file and certify it again: ``design.observer`` is ready to run.

    Raises
    ------
    InputError
        If the file is no design file, or of another schema; a key is missing, unknown or wrong;
        the certificate is not that of its system and gains, with the numbers; or packages are
        missing, with the command that installs them.
    """
    package("pydantic", "read a design", extra="design")
    from reobserve.estimation.families import file

    return file.load_design(path)
