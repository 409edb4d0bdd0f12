"""Command latex: a caption or a table of the results as LaTeX."""

from __future__ import annotations

from pathlib import Path

from reobserve.core.errors import InputError
from reobserve.core.files import SCORE, read_rows, read_text, write_text
from reobserve_papers.metrics.metrics import HEADER, read_metrics
from reobserve_papers.plotting.latex_captions import caption_in_latex
from reobserve_papers.plotting.latex_text import booktabs, latex, latex_digits, latex_number
from reobserve_papers.report.embedded_files import by_observer

_DIGITS = 3  # of a metric, which needs fewer digits


def run(source: Path, output: Path, digits: int | None = None) -> None:
    r"""Write the command ``\caption`` of a .rst, or the ``tabular`` of a .csv.

    The metrics of a figure have a column for each observer. Of other tables, cells are as they
    stand unless ``digits`` says how many are significant.
    """
    if source.suffix == ".rst":
        write_text(output, caption_in_latex(str(source), read_text(source)))
    elif source.suffix == ".csv":
        write_text(output, _table(source, digits))
    else:
        raise InputError(str(source), "must be a .csv or a .rst file")


def _table(source: Path, digits: int | None) -> str:
    header, rows = read_rows(source)
    if not header:
        raise InputError(str(source), "is empty, must be a table with a header")
    if tuple(header) == HEADER:
        metrics = read_metrics(source)
        header, rows = by_observer(metrics, lambda value: latex_number(value, digits or _DIGITS))
        # Words, where names have underscores; numbers are LaTeX already.
        cells = [[_words(row[0]), *row[1:-1], latex(row[-1])] for row in rows]
        columns = f"l{'r' * (len(header) - 2)}l"
        return booktabs([_words(name) for name in header], cells, columns)
    numeric = [all(SCORE.allows(row[k]) for row in rows if row[k]) for k in range(len(header))]
    cells = [[_cell(cell, digits) for cell in row] for row in rows]
    return booktabs(
        [latex(name) for name in header], cells, "".join("r" if right else "l" for right in numeric)
    )


def _cell(text: str, digits: int | None) -> str:
    """A number with so many digits, or with its own, and all else as it stands."""
    if not SCORE.allows(text) or not text:
        return latex(text)
    return latex_number(float(text), digits) if digits else latex_digits(text)


def _words(name: str) -> str:
    return latex(name.replace("_", " "))
