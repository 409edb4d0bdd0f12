"""Stage latex: a caption or a table of the results as LaTeX."""

from __future__ import annotations

from pathlib import Path

from reobserve.drawing.latex_captions import caption_in_latex
from reobserve.errors import InputError
from reobserve.plain_data.files import SCORE, read_rows, read_text, write_text
from reobserve.plain_data.latex import booktabs, latex, latex_number
from reobserve.scoring.metrics import HEADER

_DIGITS = 3  # of a metric, which is judged by less


def run(source: Path, output: Path, digits: int | None = None) -> None:
    r"""Write the command ``\caption`` of a .rst, or the ``tabular`` of a .csv.

    The metrics of a figure have a column for each observer. Of other tables, cells are as they
    stand unless ``digits`` says how many are significant.

    Raises
    ------
    InputError
        If the file is neither, or damaged.
    """
    if source.suffix == ".rst":
        write_text(output, caption_in_latex(str(source), read_text(source)))
    elif source.suffix == ".csv":
        header, rows = read_rows(source)
        if not header:
            raise InputError(str(source), "is empty, must be a table with a header")
        if tuple(header) == HEADER:
            write_text(output, _by_observer(rows, digits or _DIGITS))
        else:
            write_text(output, _as_it_stands(header, rows, digits))
    else:
        raise InputError(str(source), "must be a .csv or a .rst file")


def _as_it_stands(header: list[str], rows: list[list[str]], digits: int | None) -> str:
    columns = "".join(
        "r" if all(SCORE.allows(row[k]) for row in rows if row[k]) else "l"
        for k in range(len(header))
    )
    cells = [[_cell(cell, digits) for cell in row] for row in rows]
    return booktabs([latex(name) for name in header], cells, columns)


def _by_observer(rows: list[list[str]], digits: int) -> str:
    """A row a metric, a column an observer; in words where the table has underscores."""
    found: dict[tuple[str, str], dict[str, str]] = {}
    for observer, metric, value, unit in rows:
        found.setdefault((metric, unit), {})[observer] = value
    observers = dict.fromkeys(observer for observer, *_ in rows)
    header = ["metric", *map(_words, observers), "unit"]
    cells = [
        [
            _words(metric),
            *(_cell(values[one], digits) if one in values else "" for one in observers),
            latex(unit),
        ]
        for (metric, unit), values in found.items()
    ]
    return booktabs(header, cells, f"l{'r' * len(observers)}l")


def _cell(text: str, digits: int | None) -> str:
    """A number with so many digits, all else as it stands."""
    return latex_number(float(text), digits) if digits and SCORE.allows(text) else latex(text)


def _words(name: str) -> str:
    return latex(name.replace("_", " "))
