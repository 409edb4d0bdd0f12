"""Rows of several quantities, and rows with cells more or fewer that nobody reads."""

from __future__ import annotations

import gzip
import json
import tempfile
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as parquet
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as some

from reobserve.core.errors import InputError
from reobserve.estimation.data_report import DataReport
from reobserve.estimation.dialect import Dialect
from reobserve.estimation.estimate import Estimation
from reobserve.estimation.estimate_command import estimate_file
from reobserve.estimation.file_format import FileFormat
from reobserve.estimation.record_file import File, lines_of
from reobserve.estimation.row_by_row import RowByRow
from reobserve.estimation.state_file import load_state, save_state
from reobserve.estimation.writing import header
from tests.reobserve.estimation.records import read_results
from tests.reobserve.estimation.test_file_format import PLAIN, VALUES, chosen, read, streamed

Where = dict[str, Any]
Row = list[str]

TITLES = "tyksz"  # t and y are read, k and s choose rows
WORDS = ("a", "b", "c d", "", "1", "é")


def left_out_by(row: Row, where: Where) -> str:
    """The column that leaves a row out, or nothing."""
    for name, stated in sorted(where.items()):
        texts = stated["not"] if isinstance(stated, dict) else stated
        cells = row[TITLES.index(name) :][:1]
        found = [
            cell.strip(' "') in (texts if isinstance(texts, list) else [texts]) for cell in cells
        ]
        if found == [isinstance(stated, dict)]:
            return name
    return ""


def read_plainly(
    rows: list[Row], where: Where, ended: bool
) -> tuple[list[list[float]], dict[str, int], str]:
    """Numbers of t and y, the rows that columns left out, and what a refusal says, if any."""
    numbers, left_out, begun = list[list[float]](), dict[str, int](), False
    for line, row in enumerate(rows, 2):
        name = left_out_by(row, where)
        if name:
            left_out[f"by {name}"] = left_out.get(f"by {name}", 0) + 1
            continue
        whole = len(row) >= 5 and not any(map(str.strip, row[5:]))
        cut_off = len(row) < 5 and line == len(rows) + 1 and not ended
        lacks = cut_off or len(row) <= max(map(TITLES.index, ("y", *where)))
        if not whole and (lacks or not begun or any(cell.isdigit() for cell in row[5:])):
            return numbers, left_out, f"line {line} has {len(row)} cells, the header has 5"
        begun = begun or whole
        numbers.append([float(row[0]), float(row[1] or "nan")])
    return numbers, left_out, "takes no row of" if left_out and not numbers else ""


CONDITIONS = some.dictionaries(
    some.sampled_from("ks"),
    some.one_of(
        some.sampled_from(WORDS),
        some.lists(some.sampled_from(WORDS), min_size=1, max_size=3),
        some.sampled_from(WORDS).map(lambda word: {"not": word}),
        some.lists(some.sampled_from(WORDS), min_size=1).map(lambda words: {"not": words}),
    ),
)


@some.composite
def tables(draw: some.DrawFn) -> list[Row]:
    """Rows of which some are short, and some have cells beyond the header's."""
    word = some.sampled_from((*WORDS, '"a"', " b "))
    ends = some.one_of(some.just(["x"]), some.lists(word, max_size=3))
    begins = some.tuples(some.sampled_from(("1.5", "-2", "")), word, word)
    return [
        [repr(0.1 * k), *draw(begins), *draw(ends)][: draw(some.sampled_from((9, 9, 4, 3)))]
        for k in range(draw(some.integers(1, 12)))
    ]


@settings(max_examples=150)
@given(tables(), CONDITIONS, some.sampled_from((8, 40, 2**20)), some.booleans())
@example(
    [["0", "1", "a", "", "x"], ["1", "2", "b"], ["2", "3", "a", "", "x", "note"]], {}, 20, True
)
@example([["0", "1", "a", "", "x"], ["1", "2", "b", "", "x", "5"]], {}, 20, False)
@example([["0", "1", "a", "", "x"], ["1", "2"]], {}, 2**20, False)
@example([["0", "1", "a", "b"]], {"k": "a"}, 20, True)
def test_both_ways_to_read_text_are_the_plain_one(
    rows: list[Row], where: Where, block: int, ended: bool
) -> None:
    text = ",".join(TITLES) + "\n" + "\n".join(map(",".join, rows)) + "\n" * ended
    numbers, left_out, refused = read_plainly(rows, where, ended)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "r.csv"
        path.write_text(text, encoding="utf-8")
        file = File(path, Dialect(file=FileFormat(where=where)), block)
        found, report, said = list[list[float]](), DataReport(), ""
        try:
            for values in file.blocks(["t", "y"], None, report):
                found += values.tolist()
        except InputError as error:
            said = str(error)
        alone = DataReport()
        line_by_line = file.rows(file.head(), ["t", "y"], None, alone)
        read_on, other = list[list[float]](), ""
        try:
            for line in lines_of(text.partition("\n")[2]):
                read_on += [numbers for numbers, _ in line_by_line.read(line)]
            line_by_line.choice.check_some()
        except InputError as error:
            other = str(error)
    assert said == other
    assert refused in said
    assert bool(refused) == bool(said)
    np.testing.assert_array_equal(np.array(read_on), np.array(numbers))
    if not refused:
        np.testing.assert_array_equal(np.array(found), np.array(numbers))
        assert report.left_out == alone.left_out == left_out


def mixed(between: str = "{t},x,99,\n") -> str:
    """The record of the other tests, with the rows of another quantity between its own."""
    rows = "".join(
        f"{row.partition(',')[0]},y,{row.partition(',')[2]},on\n"
        + between.format(t=row.partition(",")[0])
        for row in PLAIN.splitlines()
    )
    return "t,what,y,state\n" + rows


@pytest.mark.parametrize("where", [
    {"what": "y"}, {"what": ["y", "z"]}, {"what": {"not": "x"}}, {"state": {"not": ["", "off"]}},
    {"what": "y", "state": "on"},
])  # fmt: skip
@pytest.mark.parametrize("name", ["r.csv", "r.csv.gz"])
def test_rows_of_one_quantity_are_taken(where: Where, name: str, tmp_path: Path) -> None:
    text = mixed()
    content = gzip.compress(text.encode()) if name.endswith("gz") else text
    found, report = read(chosen({"where": where}), content, tmp_path, name)
    assert found == VALUES
    assert report["left_out"] == {f"by {next(iter(where))}": 30}
    if name.endswith("csv"):
        assert read(chosen({"where": where}), text.encode("utf-16"), tmp_path)[0] == VALUES


def test_other_rows_need_no_cells_that_are_read(tmp_path: Path) -> None:
    text = mixed("open,x\n\n#,#,#,#,#,5\n")
    found, report = read(chosen({"where": {"what": "y"}, "comment": "#"}), text, tmp_path)
    assert found == VALUES
    assert report["left_out"] == {"by what": 30, "comments": 30}


def test_parquet_has_the_same_choice_and_counts_rows_of_the_file(tmp_path: Path) -> None:
    times = np.repeat(0.1 * np.arange(30), 2)
    table = {
        "t": times,
        "y": np.ravel([VALUES, 30 * [99.0]], order="F"),
        "n": np.tile([1, 2], 30),
        "what": pa.array(30 * ["y", None]).dictionary_encode(),
        "d": np.tile([True, False], 30),
    }
    path = tmp_path / "r.parquet"
    parquet.write_table(pa.table(table), path, row_group_size=7)
    for where in ({"n": "1"}, {"what": "y"}, {"what": {"not": ""}}, {"n": "1", "d": "True"}):
        for block in (100, 2**22):
            out, report = tmp_path / "e.csv", tmp_path / "r.json"
            estimate_file(chosen({"where": where}), path, out, report=report, block=block)
            assert np.round(read_results(out)[0]["x"], 9).tolist() == VALUES
            assert json.loads(report.read_text())["left_out"] == {f"by {next(iter(where))}": 30}
    table["t"][20] = 0.95  # 21st row of the file, 11th of those that are taken
    parquet.write_table(pa.table(table), path, row_group_size=7)
    with pytest.raises(InputError, match=r"jitter: 0.01 is exceeded in row 21 of .*r\.parquet"):
        estimate_file(chosen({"where": {"n": "1"}}), path, tmp_path / "e.csv")


@pytest.mark.parametrize("repeated", ["refuse", "last"])  # the last one waits for the next row
@pytest.mark.parametrize(
    ("time", "said"), [("0.8", "line 22: the timestamp goes"), ("1.05", "is exceeded in line 22 ")]
)
def test_refusal_of_a_row_has_its_line_in_files_and_streams(
    repeated: str, time: str, said: str, tmp_path: Path
) -> None:
    text = mixed().replace("1.0,y,", f"{time},y,")
    specification = chosen({"where": {"what": "y"}})
    object.__setattr__(specification.sampling, "repeated", repeated)
    (tmp_path / "r.csv").write_text(text)
    with pytest.raises(InputError, match=said):
        estimate_file(specification, tmp_path / "r.csv", tmp_path / "e.csv")
    with pytest.raises(InputError, match=said):
        streamed(specification, text.encode())


def test_resumed_stream_takes_the_same_rows(tmp_path: Path) -> None:
    specification = chosen({"where": {"what": "y"}})
    titles, *lines = mixed("{t},x,99,,note\n").splitlines(keepends=True)
    whole = streamed(specification, mixed("{t},x,99,,note\n").encode())
    for stop in (1, 5, 40, 41):
        found = header(Estimation(specification, titles.strip().split(","), "r").titles)
        for begin, end in ((0, stop), (stop, len(lines))):
            made = Estimation(specification, titles.strip().split(","), "standard input")
            rows = RowByRow(made, titles.strip().split(","))
            if begin:
                load_state(tmp_path / "s.json", made, "x")
            found += "".join(map(rows.read, lines[begin:end]))
            rows.settle()
            save_state(tmp_path / "s.json", made, "x", None)
        assert found + rows.finish() == whole


@pytest.mark.parametrize(
    ("where", "said"),
    [
        ({"wat": "y"}, "file.where.wat: {} has no column 'wat'; did you mean 'what'?"),
        ({"what": "yy"}, "file.where.what: 'yy' takes no row of {}; did you mean 'y'?"),
        ({"what": ["q", "r"]}, "file.where.what: 'q' or 'r' takes no row of {}; there are: y, x"),
        ({"t": {"not": []}}, "file.where.t: {'not': []} must be a text (a number in quotes), a li"),
        ({"what": 1}, "file.where.what: 1 must be a text (a number in quotes), a list of texts, o"),
        ({"what": {"is": "y"}}, "file.where.what: {'is': 'y'} must be a text"),
    ],
)
def test_choice_of_no_row_is_refused(where: Where, said: str, tmp_path: Path) -> None:
    path = tmp_path / "r.csv"
    path.write_text(mixed())
    for place, run in (
        (str(path), lambda: estimate_file(chosen({"where": where}), path, tmp_path / "e.csv")),
        ("standard input", lambda: streamed(chosen({"where": where}), mixed().encode())),
    ):
        with pytest.raises(InputError) as error:
            run()
        assert str(error.value).startswith(
            said.replace("of {}", f"of {place}").replace("{} has", f"{place} has")
        )
