"""The command `reobserve estimate`."""

from __future__ import annotations

import contextlib
import io
import json
import os
import sys
from collections import deque
from collections.abc import Iterator
from functools import partial
from itertools import chain
from pathlib import Path
from typing import Any

import numpy as np

from reobserve.core.errors import InputError, shown
from reobserve.core.files import check_not_read, check_replaceable, write_text
from reobserve.core.progress import progress
from reobserve.estimation import state_file
from reobserve.estimation.data_report import DataReport, as_json
from reobserve.estimation.diagnostics import FirstRows, diagnostics
from reobserve.estimation.dialect import Dialect, read_head
from reobserve.estimation.estimate import Estimated, Estimation
from reobserve.estimation.estimates_plot import Plot, check_plot
from reobserve.estimation.record_file import BLOCK, File, Tell
from reobserve.estimation.refusals import Refusals
from reobserve.estimation.report_table import as_table
from reobserve.estimation.row_by_row import RowByRow
from reobserve.estimation.sampling_grid import RESAMPLING, UnevenError, least_jitter
from reobserve.estimation.specification import Specification, read_specification
from reobserve.estimation.streaming import Lines, Stop, open_file
from reobserve.estimation.writing import check_digits, check_name, header, write_results

_put = partial(print, end="", flush=True)


def run(
    specification: Path | None,
    data: Path | None,
    out: Path | None,
    plot: Path | None,
    report: Path | None,
    stream: bool,
    follow: bool,
    idle: float,
    state: Path | None,
    warm: bool,
    example: str | None,
    record: Path | None,
    check: bool = False,
    suggest: Path | None = None,
    digits: int | None = None,
) -> None:
    """The sub-command, with the options as they were typed."""
    if suggest is not None:
        return print_suggestion(suggest, specification)
    if example is not None:
        if specification is not None or data is not None:
            raise InputError("--example", "takes no specification and no data")
        return write_example(example, out, record)
    if specification is None:
        raise InputError("SPEC", "is missing; `reobserve estimate --example kalman` writes one")
    if record is not None:
        raise InputError("--data", "belongs to --example, which writes a record there")
    if check:
        return print_check(specification, data, out)
    check_digits(digits, out)
    chosen = read_specification(specification)
    written = [path for path in (out, plot, report, state) if path is not None]
    check_not_read(written, chosen.files)
    if stream or follow:
        if plot is not None or out is not None:
            option = "--plot" if plot is not None else "--out"
            raise InputError(option, "is for whole records; a stream goes to standard output")
        if follow == (data is None):
            problem = "needs a file to follow" if follow else "reads standard input, and no file"
            raise InputError("--follow" if follow else "--stream", problem)
        digest = state_file.identity(specification, chosen.files)
        return estimate_stream(
            chosen, data, idle=idle, state=state, digest=digest, report=report, warm=warm,
            digits=digits,
        )  # fmt: skip
    if state is not None:
        raise InputError("--state", "is for --stream and --follow")
    if warm and data is None:
        Estimation(chosen, _expected(chosen), "the record")
        print("reobserve: ready", file=sys.stderr)
        return None
    if data is None or out is None:
        name = "DATA" if data is None else "--out"
        raise InputError(name, "is missing: reobserve estimate SPEC.yaml DATA.csv --out RESULT.csv")
    made = estimate_file(chosen, data, out, plot=plot, report=report, digits=digits)
    print(as_table(made.report, chosen.sampling.period), file=sys.stderr)
    return None


def print_check(specification: Path, data: Path | None, out: Path | None = None) -> None:
    """Run an observer over a record and write nothing, for what would refuse it."""
    if data is None or out is not None:
        raise InputError("--check", "reads a specification and a record, and writes nothing")
    chosen = read_specification(specification)
    report = estimate_file(chosen, data, None).report
    print(f"{data} is accepted\n{as_table(report, chosen.sampling.period)}")


def print_suggestion(data: Path, specification: Path | None = None) -> None:
    """Print a specification for a record."""
    if specification is not None:
        problem = "takes one record and no specification; --check SPEC DATA reads both"
        raise InputError("--suggest", problem)
    from reobserve.estimation.suggestion import suggest

    print(suggest(data).text(str(data)))


def estimate_file(
    specification: Specification,
    data: Path,
    out: Path | None,
    *,
    plot: Path | None = None,
    report: Path | None = None,
    block: int = BLOCK,
    digits: int | None = None,
) -> Estimation:
    """Estimate a record in a file and write another, with what became of it in the report.

    Text has as many significant ``digits``, or the shortest that read back to the same numbers.
    Without a name ``out`` nothing is written. One error has all that refuses the record.
    """
    if out is not None:
        check_name(out)
    if plot is not None:
        check_plot(plot)
    written = [path.absolute() for path in (out, plot, report) if path is not None]
    for path in written:
        check_replaceable(path)
        if written.count(path) > 1 or path == data.absolute():
            raise InputError(str(path), "is named twice; each file needs a name of its own")
    file = File(data, Dialect.of(specification), block)
    estimation = Estimation(specification, file.header(), str(data), Refusals(noting=True))
    curves = estimation.curves = None if plot is None else Plot(estimation)

    def about() -> dict[str, Any]:
        return as_json(estimation.report, {"record": data.name})

    with progress(f"{data.name}: {{:.0%}} read") as tell:
        blocks = estimated(estimation, file, tell)
        if out is not None:
            write_results(out, estimation.titles, blocks, about, estimation.report, digits)
        deque(blocks, maxlen=0)
    if curves is not None and plot is not None:
        curves.save(plot)
    if report is not None:
        write_text(report, json.dumps(about(), indent=1) + "\n")
    return estimation


def _over_all(
    estimation: Estimation, file: File, error: UnevenError
) -> tuple[InputError, float | None]:
    """The error on jitter by what the whole record says, and the jitter that would accept it."""
    layout, period = estimation.layout, estimation.specification.sampling.period
    report = DataReport()
    report.refusals = Refusals(noting=True)  # which the run lists
    blocks = file.blocks(layout.titles[:1], layout.clock, report)
    least, interval = least_jitter((layout.times(block, report) for block in blocks), period)
    if interval is None:
        return UnevenError(error.finding, error.row, least, "the record"), least
    problem = (
        f"{period:g} s disagrees with the timestamps of {file.path} ({RESAMPLING}), which go on by "
        f"{interval:.6g} s on average"
    )
    return InputError("sampling.period", problem), None


def estimated(estimation: Estimation, file: File, tell: Tell | None = None) -> Iterator[Estimated]:
    """The results of a record, some rows at a time, with diagnostics after the last.

    Where refusals are noted, it raises all of them after the last row.
    """
    first_rows, refusals = FirstRows(), estimation.report.refusals
    estimation.first_rows, refusals.survey = first_rows, partial(_over_all, estimation, file)
    try:
        layout, report = estimation.layout, estimation.report
        for raw in chain(file.blocks(layout.titles, layout.clock, report, tell), [None]):
            block = estimation.finish() if raw is None else estimation.feed(raw)
            if not refusals.found:
                yield block
    except InputError as error:  # after which nothing can be read
        refusals.refuse(("",), error)
    if refusals.found:
        raise refusals.error(file.lines_at, estimation.can_skip, file.word)
    if not estimation.report.estimates:
        held = [one.column for one in estimation.layout.columns if one.missing == "hold"]
        empty = [name for name in held if name not in estimation.report.levels]
        hint = f"; {', '.join(empty)} never has a value" if empty else ""
        raise InputError(str(file.path), f"has no row from which the observer could start{hint}")
    for sentence in diagnostics(estimation, first_rows):
        estimation.report.warn(sentence)


def estimate_stream(
    specification: Specification,
    data: Path | None,
    *,
    idle: float = 0.0,
    state: Path | None = None,
    digest: str = "",
    report: Path | None = None,
    warm: bool = False,
    digits: int | None = None,
) -> None:
    """Estimates of lines as they come, one flushed line each, on standard output."""
    if specification.smooth:
        problem = "true is for whole records, as each estimate takes the rows after it, too; with "
        raise InputError("smooth", f"{problem}--stream and --follow it must be false")
    if isinstance(sys.stdout, io.TextIOWrapper):
        sys.stdout.reconfigure(encoding="utf-8")  # as in files
    place = "standard input" if data is None else str(data)
    resumed = state is not None and state.exists()
    if warm:
        Estimation(specification, _expected(specification), place)
        print("reobserve: ready", file=sys.stderr, flush=True)
    stop, dialect = Stop(), Dialect.of(specification)
    stream: Any = sys.stdin.buffer if data is None else open_file(data)
    lines = Lines(stream, stop, place, 0.0 if data is None else idle, dialect, data)
    with stop.listening(), contextlib.closing(lines) if data else contextlib.nullcontext():
        coming = iter(lines)
        head = read_head(coming, dialect, place)
        ahead = [] if head.first is None else [head.first]
        estimation = Estimation(specification, head.titles, place)
        rows = RowByRow(estimation, head, digits)
        if resumed and state is not None:
            offset, line = state_file.load_state(state, estimation, digest)
            if data is not None and offset is not None:
                rows.rows.line += len(ahead)
                ahead.clear()
                _pass_over(coming, lines, rows, offset, line)
        else:
            _put(header(estimation.titles))
        _read(chain(ahead, coming), lines, rows)
        if state is not None:
            rows.settle()
            offset = None if data is None else lines.offset
            state_file.save_state(state, estimation, digest, offset, lines.last)
        else:
            _put(rows.finish())
    if report is not None:
        content = as_json(estimation.report, {"record": place})
        write_text(report, json.dumps(content, indent=1) + "\n")
    print(as_table(estimation.report, specification.sampling.period), file=sys.stderr)


def _pass_over(coming: Iterator[str], lines: Lines, rows: RowByRow, offset: int, line: str) -> None:
    """Pass over the lines before a byte of a file, if the last of them is that of a digest."""
    short = os.fstat(lines.stream.fileno()).st_size < offset
    while not short and lines.offset < offset and next(coming, None) is not None:
        rows.rows.line += 1
    if short or (line and state_file.digest_of(lines.last) != line):
        problem = (
            f"was replaced, as less or another line is before byte {offset} than was read; remove "
            "the state file to restart, or give the header and the rest of the old file to "
            "--stream first"
        )
        raise InputError(lines.place, problem)


def _read(coming: Iterator[str], lines: Lines, rows: RowByRow) -> None:
    """Put out the results of lines, and of those of the files that replace theirs."""
    while True:
        for line in coming:
            _put(rows.read(line))
        if lines.path is None or not lines.replaced:
            return rows.rows.finish()
        rows.cut_off(lines.rest, lines.replaced)
        print(f"reobserve: {lines.place} was {lines.replaced}", file=sys.stderr, flush=True)
        lines.close()
        lines.begin(open_file(lines.path))
        coming = rows.go_on(iter(lines))


def _expected(specification: Specification) -> list[str]:
    """A header as the specification asks for it."""
    columns = specification.columns
    return [*columns.time.columns, *(column.column for column in columns.read)]


def write_example(name: str, out: Path | None, record: Path | None) -> None:
    """Write a specification, to standard output if no file is named, and a record for it.

    With the name ``list``, print the names of all examples.
    """
    from reobserve.estimation.families.examples import examples, simulated, specification_text

    if name == "list" and out is None and record is None:
        print(*examples(), sep="\n")
        return
    text = specification_text(name)
    if record is not None and record.suffix != ".csv":
        raise InputError(str(record), "must end with .csv")
    if out is not None and out.suffix != ".yaml":
        raise InputError(str(out), f"{shown(out.name)} must end with .yaml")
    for path in (out, record):
        if path is not None and path.exists():
            raise InputError(str(path), "is there already, and is not replaced")
    if record is not None:
        columns, stream = simulated(name).record(), io.StringIO()
        np.savetxt(stream, np.column_stack([*columns.values()]), "%.9g", ",")
        write_text(record, header([*columns]) + stream.getvalue())
    if out is None:
        print(text, end="")
    else:
        write_text(out, text)
