"""Refusals of recorded data: all that is wrong, and nothing else, is listed with its lines."""

from __future__ import annotations

import gzip
import re
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as parquet
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from reobserve.cli.main import main
from reobserve.core.documents import dumped
from reobserve.core.errors import InputError
from reobserve.core.validation import parse
from reobserve.estimation.estimate_command import estimate_file
from reobserve.estimation.specification import Specification
from tests.reobserve.estimation.records import streamed

KALMAN: dict[str, Any] = {
    "kind": "kalman", "time": "discrete", "A": [[1.0]], "C": [[1.0], [1.0]], "Q": [0.01],
    "R": [1.0, 1.0], "initial_state": [0.0], "initial_covariance": 10.0,
}  # fmt: skip
LEVANT: dict[str, Any] = {"kind": "levant", "gains": {"order": 1, "L": 1.0}}
COUNT = 90


def tree(observer: dict[str, Any] | None = None, **sections: Any) -> dict[str, Any]:
    """A specification of an observer of the columns y and z, one row a second by the column t."""
    measured = [{"column": "y"}, {"column": "z"}][: 2 if observer is None else 1]
    columns = {"time": {"column": "t"}, "measurements": measured, **sections.pop("columns", {})}
    sampling = {"period": 1.0, **sections.pop("sampling", {})}
    made = {"observer": observer or KALMAN, "columns": columns, "sampling": sampling}
    return {**made, **sections}


def said(stated: dict[str, Any], data: Path, **options: Any) -> list[tuple[str, list[str]]]:
    """The sentences on all that is refused, and the notes below each; there is no output."""
    out = data.with_name("e.csv")
    with pytest.raises(InputError) as error:
        estimate_file(parse(Specification, stated), data, out, **options)
    assert not out.exists()
    problems = getattr(error.value, "problems", [error.value])
    return [(str(one), getattr(one, "__notes__", [])) for one in problems]


def places(sentence: str, notes: list[str]) -> tuple[int, list[int]]:
    """How often something is refused, and the lines that are named."""
    counted = [re.fullmatch(r"(?:(\d+) times, first )?(?:in|before) lines? ([\d, ]+)", note) for
               note in notes]  # fmt: skip
    for match in filter(None, counted):
        lines = list(map(int, match[2].split(", ")))
        return int(match[1] or len(lines)), lines
    line = re.search(r"line (\d+)", sentence)
    return 1, [] if line is None else [int(line[1])]


def written(folder: Path, *lines: str, end: str = "\n") -> Path:
    path = folder / "r.csv"
    path.write_text("\n".join(lines) + end, encoding="utf-8")
    return path


def plain(count: int = COUNT) -> list[list[str]]:
    return [[f"{k}.0", f"{1.0 + 0.1 * (k % 5):.1f}", f"{2.0 - 0.1 * (k % 7):.1f}"] for k in
            range(count)]  # fmt: skip


SENTENCES = {
    "cell": r"column 'y' is 'OFF', must be a number",
    "digits": r"column 'z' is '1\.2\.3', must be a number",
    "infinite": r"line \d+ is inf, must be a number",
    "time": r"column 't' is 'x', must be a number",
    "short": r"has 2 cells, the header has 3; if ",
    "repeated": "the timestamp stands still",
    "back": "the timestamp goes back",
    "empty": r": z missing at ",
    "lost": r": y, z missing at ",
    "gap": r": y, z missing from .* longer than sampling\.gap, 10 s",
    "jitter": r"^sampling\.jitter: 0\.01 is exceeded",
    "tail": r"has 2 cells, the header has 3; it has no line end",
}


def planted(faults: list[tuple[int, str]], tail: bool) -> tuple[list[str], dict[str, list[int]]]:
    """The lines of a record with faults at rows, and the lines of each kind of fault."""
    lines, wrong, rows, skipped = ["t,y,z"], dict[str, list[int]](), plain(), 0
    kinds = dict(faults)
    kinds |= {k + j: "empty" for k, kind in faults for j in range(12) if kind == "sensor"}
    for k, cells in enumerate(rows):
        kind, line = kinds.get(k, ""), len(lines) + 1
        if skipped > 0:
            skipped -= 1
            continue
        column, text = {
            "cell": (1, "OFF"), "digits": (2, "1.2.3"), "infinite": (1, "inf"), "time": (0, "x"),
            "empty": (2, ""), "jitter": (0, f"{k}.2"),
        }.get(kind, (0, cells[0]))  # fmt: skip
        cells[column] = text
        if kind in ("lost", "gap"):
            wrong.setdefault("lost", []).append(line)
            skipped = 14 if kind == "gap" else 0
            if kind == "gap":
                wrong.setdefault("gap", []).append(line)
            continue
        lines.append(",".join(cells[:2] if kind == "short" else cells))
        if kind in ("repeated", "back"):
            lines.append(f"{k if kind == 'repeated' else k - 4}.0,7.0,7.0")
            line += 1
        if kind:
            wrong.setdefault(kind, []).append(line)
    if tail:
        lines.append(f"{COUNT}.0,1.0")
        wrong["tail"] = [len(lines)]
    return lines, wrong


def spaced(draws: list[tuple[int, str]]) -> list[tuple[int, str]]:
    """Faults at rows that do not touch one another; the first and the last rows are not lost."""
    at, faults = 0, []
    for step, kind in draws:
        at += step
        if kind in ("lost", "gap", "jitter") and at == 0:
            at = 1
        long = 15 if kind in ("gap", "sensor") else 0
        if at + long > COUNT - 4:
            break
        faults.append((at, kind))
        at += long + 4
    return faults


ONE = sorted(set(SENTENCES) - {"tail", "gap"})
KINDS = [*ONE, "gap", "sensor"]
ALL = [(1, kind) for kind in ONE]


@settings(max_examples=40)
@given(
    draws=st.lists(st.tuples(st.integers(0, 9), st.sampled_from(KINDS)), min_size=1, max_size=14),
    tail=st.booleans(),
    block=st.sampled_from([40, 300, 2**20]),
)
@example(draws=[*ALL, (2, "gap"), ALL[0]], tail=True, block=2**20)
@example(draws=[(3, "sensor"), (0, "gap"), (1, "jitter")], tail=True, block=40)
def test_all_and_only_the_planted_faults_are_listed(
    draws: list[tuple[int, str]], tail: bool, block: int, tmp_path_factory: pytest.TempPathFactory
) -> None:
    folder = tmp_path_factory.mktemp("planted")
    lines, wrong = planted(spaced(draws), tail)
    data = written(folder, *lines, end="" if tail else "\n")
    if not wrong:
        return
    found = dict[str, tuple[int, list[int]]]()
    listed = said(tree(), data, block=block)
    for sentence, notes in listed:
        (kind,) = (name for name, form in SENTENCES.items() if re.search(form, sentence))
        assert kind not in found
        found[kind] = places(sentence, notes)
    if "jitter" in wrong:  # of which the first row says it
        wrong["jitter"] = wrong["jitter"][:1]
    assert found == {kind: (len(at), at[:3]) for kind, at in wrong.items()}
    assert [at[0] for _, at in found.values()] == sorted(at[0] for _, at in found.values())
    assert listed == said(tree(), data, block=2**20)


def test_check_lists_the_same_as_a_run_and_writes_nothing(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    data = written(tmp_path, *planted(spaced(ALL), True)[0], end="")
    (stated := tmp_path / "s.yaml").write_text(dumped(tree()), encoding="utf-8")
    before = sorted(tmp_path.iterdir())
    reports = []
    for more in (["--check"], ["--out", str(tmp_path / "e.csv")]):
        assert main(["estimate", str(stated), str(data), *more]) == 1
        reports.append(capsys.readouterr())
    assert reports[0] == reports[1]
    assert sorted(tmp_path.iterdir()) == before
    lines = reports[0].err.splitlines()
    assert sum(line.startswith("reobserve: ") for line in lines) == len(ALL) + 1
    assert "  sampling.repeated: last leaves out all but the last row of a timestamp" in lines
    written(tmp_path, "t,y,z", *map(",".join, plain()))
    assert main(["estimate", str(stated), str(data), "--check"]) == 0
    assert re.search(r"is accepted\n(.|\n)*estimates +90: 90 measured", capsys.readouterr().out)


ACCEPTED = ["cell", "empty", "sensor", "gap", "jitter", "lost", "repeated"]


@settings(max_examples=30)
@given(
    draws=st.lists(
        st.tuples(
            st.integers(0, 9),
            st.sampled_from(["cell", "empty", "gap", "jitter", "lost", "repeated"]),
        ),
        max_size=9,
    ),
    at_gap=st.sampled_from(["coast", "restart"]),
    grid=st.sampled_from([("first", "refuse"), ("last", "refuse"), ("spread", "linear")]),
)
def test_record_that_is_accepted_gives_what_its_stream_gives(
    draws: list[tuple[int, str]], at_gap: str, grid: tuple[str, str],
    tmp_path_factory: pytest.TempPathFactory,
) -> None:  # fmt: skip
    folder = tmp_path_factory.mktemp("accepted")
    data = written(folder, *planted(spaced(draws), True)[0])
    sampling = {"jitter": 0.2, "missing": "skip", "at_gap": at_gap}
    sampling = {**sampling, "repeated": grid[0], "uneven": grid[1]}
    stated = tree(sampling=sampling, file={"missing_values": ["OFF"], "tail": "drop"})
    chosen = parse(Specification, stated)
    for block in (60, 2**20):
        estimate_file(chosen, data, folder / "e.csv", block=block)
        assert (folder / "e.csv").read_text(encoding="utf-8") == streamed(chosen, data)


def test_stream_raises_the_first_refusal_of_a_file(tmp_path: Path) -> None:
    data = written(tmp_path, *planted(spaced(ALL), False)[0])
    first = said(tree(), data)[0][0]
    with pytest.raises(InputError) as error:
        streamed(parse(Specification, tree()), data)
    assert str(error.value) == first


def rows(times: Any) -> list[str]:
    return ["t,y,z", *(f"{time},1.0,2.0" for time in times)]


STEPS = np.random.default_rng(1).uniform(0.2, 1.8, 500)
UNIT = {"time": {"column": "t", "unit": "iso8601"}}
FORMAT = {"time": {"column": "t", "format": "%d.%m.%Y %H:%M:%S"}}
WHOLE: dict[str, tuple[dict[str, Any], list[str], str, int]] = {
    "period": ({}, rows(10.0 * k for k in range(80)), r"sampling\.period: 1 s disagrees", 1),
    "mean": ({}, rows(1.003 * np.arange(900)), r"sampling\.period: 1 s .* 1\.003 s on av", 1),
    "few": ({}, rows(10.0 * k for k in range(9)), r"sampling\.period: 1 s disagrees", 1),
    "jitter": ({}, rows(STEPS.cumsum()), "no jitter below 0.5", 1),
    "dates": (
        {"columns": FORMAT}, rows(f"2024-03-01 10:{k // 60:02d}:{k % 60:02d}" for k in range(80)),
        r"line 2 of column 't' is '2024-03-01 10:00:00', must be a date", 80,
    ),
    "zone": (
        {"columns": UNIT, "sampling": {"period": 1800.0}},
        rows(f"2024-03-31T{k // 2:02d}:{30 * (k % 2):02d}" for k in range(24) if k not in (4, 5)),
        r"columns\.time\.zone: is missing: line 6 of", 1,
    ),
    "counter": (
        {"columns": {"time": {"column": "t", "wrap": 70.0}}}, rows(range(80)),
        r"columns\.time\.wrap: 70 must be above 70, as line 72", 10,
    ),
    "begins again": ({}, rows(k % 60 for k in range(100)), "line 62: the timestamp goes back", 40),
    "decimal": (
        {"columns": {"delimiter": ";", "measurements": [{"column": "y"}, {"column": "z"}]}},
        ["t;y;z", *(f"{k};1,{k % 3};2.0" for k in range(80))],
        r"column 'y' is '1,0', must be a number; state columns\.decimal", 80,
    ),
    "tail": (
        {"file": {"tail": "drop"}}, [*rows(range(30)), "29", *rows(range(30, 60))[1:]],
        "line 32 has 1 cell,", 1,
    ),
    "header": (
        {}, [*rows(range(30)), *rows(range(30, 60))], "file.repeated_header: skip it is left", 1
    ),
    "merge": (
        {"sampling": {"repeated": "merge"}}, [*rows(range(30)), "29,1.5,2.0", "29,1.5,"],
        r"^y: line 32 has 1\.5 and .* same timestamp, 1", 2,
    ),
    "no times": ({}, ["t,y,z", *[",1.0,2.0"] * 5, *rows(range(50))[1:]], "has no timestamp", 5),
    "coast": (
        {"sampling": {"at_gap": "coast", "missing": "skip"}}, rows([*range(30), 5e6, 5e6 + 1]),
        r"coast would fill", 1,
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", WHOLE)
@pytest.mark.parametrize("block", [200, 2**22])
def test_fault_of_a_whole_record_is_one_refusal(name: str, block: int, tmp_path: Path) -> None:
    """What follows from it, rows that seem lost among that, is not refused besides."""
    sections, lines, form, count = WHOLE[name]
    ((sentence, notes),) = said(tree(**sections), written(tmp_path, *lines), block=block)
    assert re.search(form, sentence)
    assert places(sentence, notes)[0] == count


@pytest.mark.parametrize("name", ["period", "mean", "few", "jitter"])
def test_fault_of_a_whole_record_is_refused_beside_that_of_a_row(name: str, tmp_path: Path) -> None:
    sections, lines, form, _ = WHOLE[name]
    spoiled = [line.replace(",1.0", ",OFF") if k == 4 else line for k, line in enumerate(lines)]
    listed = said(tree(**sections), written(tmp_path, *spoiled))
    for wanted, (sentence, _) in zip((SENTENCES["cell"], form), listed[::-1], strict=True):
        assert re.search(wanted, sentence)


def test_many_texts_are_listed_to_a_limit(tmp_path: Path) -> None:
    lines = ["t,y,z", *(f"{k},x{k},2.0" for k in range(400))]
    listed = said(tree(), written(tmp_path, *lines))
    assert len(listed) == 21
    assert listed[-1][0].endswith("is refused 81 more")


def test_observers_that_cannot_predict_are_not_offered_to_skip(tmp_path: Path) -> None:
    lines = rows(k for k in range(60) if not 30 <= k < 45)
    notes = [note for _, notes in said(tree(LEVANT), written(tmp_path, *lines)) for note in notes]
    assert any(note.startswith("sampling.at_gap: restart") for note in notes)
    assert not any("skip" in note or "coast" in note for note in notes)


def test_all_columns_that_are_not_found_are_listed(tmp_path: Path) -> None:
    listed = said(tree(), written(tmp_path, "time,y,c", "0,1,2"))
    assert [sentence.partition(":")[0] for sentence, _ in listed] == [
        "columns.measurements.1.column", "columns.time.column",
    ]  # fmt: skip


def test_parquet_names_rows(tmp_path: Path) -> None:
    times = [f"2024-03-01T10:00:{k:02d}" for k in range(60)]
    times[20] = "soon"
    y = [np.inf if k in (7, 9) else None if k == 30 else 1.0 for k in range(60)]
    path = tmp_path / "r.parquet"
    parquet.write_table(pa.table({"t": times, "y": y, "z": [1.0] * 60}), path)
    listed = said(tree(columns=UNIT), path)
    assert [re.split("[,;] |: ", sentence)[1] for sentence, _ in listed] == [
        "row 8 is inf", "row 21 of column 't' is 'soon'", "y missing at 2024-03-01T10:00:30"
    ]  # fmt: skip
    assert [notes[:1] for _, notes in listed][::2] == [
        ["2 times, first in rows 8, 10"], ["in row 31"],
    ]  # fmt: skip


def test_record_that_ends_within_its_gzip_is_refused_with_what_was_before(tmp_path: Path) -> None:
    path, packed = tmp_path / "r.csv.gz", BytesIO()
    lines = rows(np.arange(200_000))
    lines[9] = "8,OFF,2.0"
    with gzip.GzipFile(fileobj=packed, mode="wb", mtime=0) as stream:
        stream.write("\n".join(lines).encode())
    path.write_bytes(packed.getvalue()[:-2000])
    sentences = [sentence for sentence, _ in said(tree(), path, block=2**16)]
    assert len(sentences) == 2
    assert any("cannot be read" in sentence for sentence in sentences)
