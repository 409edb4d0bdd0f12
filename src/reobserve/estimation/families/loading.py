"""`reobserve.load_design`, which imports what it needs when it is called."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from reobserve.core.extras import package

if TYPE_CHECKING:
    from reobserve.estimation.observer_design import Design


def load_design(path: str | Path) -> Design:
    """Read the design in a file and certify it again: ``design.observer`` is ready to run.

    Parameters
    ----------
    path
        Of a file that `reobserve design` wrote.

    Raises
    ------
    InputError
        If the file is no design file, or of another schema; a key is missing, unknown or wrong;
        the certificate is not that of its system and gains, with the numbers; or packages are
        missing, with the command that installs them.

    Examples
    --------
    >>> from reobserve import load_design
    >>> from reobserve.cli.main import main
    >>> code = main("design luenberger --example model.yaml".split())
    model.yaml: a model; next: reobserve design luenberger model.yaml --out design.json
    >>> code = main("design luenberger model.yaml --out design.json".split())
    Luenberger observer
    poles: 0.606531, 0.496585, of the error from sample to sample
    spectral radius 0.606531: the slowest error falls to 37 % in 0.02 s
    design.json: certified; loading it certifies it again
    >>> print(load_design("design.json").observer.poles.round(3))
    [0.607 0.497]
    """
    package("pydantic", "read a design", extra="design")
    from reobserve.estimation.families import file

    return file.load_design(path)
