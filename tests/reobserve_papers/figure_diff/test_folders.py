"""`figdiff` and `accept` on two folders of a script that knows nothing of this project."""

from __future__ import annotations

import json
import re
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from PIL import Image

from reobserve.core.files import read_text, write_text
from reobserve_papers.cli.main import main
from reobserve_papers.figure_diff.folders import COMPARED, Tolerances, compare_folders

Capture = pytest.CaptureFixture[str]
COMPARE = ["figdiff", "--reference", "ref", "--results", "out"]
TABLE = "name,time,rms\nfast,0.5,1.25\nslow,1.0,-2e-3\n"
TREE = {"gain": 2.0, "poles": [-1.0, -2.5], "runs": [{"seed": 3}, {"seed": 4}], "solver": "qr"}


def picture(path: Path, colour: int = 0, size: int = 40) -> None:
    shown = np.full((size, 40, 3), 255, dtype=np.uint8)
    shown[10:20, 5:35] = (colour, 0, 120)
    Image.fromarray(shown).save(path)


@pytest.fixture(autouse=True)
def folders(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("CI", "")
    for folder in map(Path, ("ref", "out")):
        (folder / "runs").mkdir(parents=True)
        write_text(folder / "runs/scores.csv", TABLE)
        write_text(folder / "summary.json", json.dumps(TREE))
        picture(folder / "fig1.png")
        write_text(folder / "notes.txt", str(folder))  # which is not compared


def table(old: str, new: str) -> Callable[[], object]:
    return lambda: write_text("out/runs/scores.csv", TABLE.replace(old, new))


def tree(**changes: object) -> Callable[[], object]:
    return lambda: write_text("out/summary.json", json.dumps({**TREE, **changes}))


def write(name: str, content: bytes) -> Callable[[], object]:
    return lambda: Path(name).write_bytes(content)


CHANGED = {
    "number": (table("1.25", "1.26"), "scores.csv, column rms in line 2: golden 1.25, found 1.26"),
    "sign": (table("-2e-3", "2e-3"), "column rms in line 3"),
    "nan": (table("1.25", "nan"), "column rms in line 2: golden 1.25, found nan"),
    "infinity": (table("1.25", "inf"), "column rms in line 2: golden 1.25, found inf"),
    "empty cell": (table("1.25", ""), "column rms in line 2: golden 1.25, found nothing"),
    "word": (table("slow", "slower"), "column name in line 3: golden slow, found slower"),
    "word for a number": (table("1.25", "high"), "column rms in line 2: golden 1.25, found high"),
    "row less": (table("slow,1.0,-2e-3\n", ""), "column rms: golden 3 values, found 2 values"),
    "row more": (table("slow", "a,1,2\nslow"), "golden 3 values, found 4 values"),
    "column renamed": (table("rms", "RMS"), "column RMS: golden none, found 3 values"),
    "columns exchanged": (table("name,time", "time,name"), "column time"),
    "ragged": (table("1.0,-2e-3", "1.0"), "line 3 has not 3 cells"),
    "no table": (write("out/runs/scores.csv", b"\xff\xfe\x00"), "is not UTF-8"),
    "key changed": (tree(gain=2.1), "summary.json, gain: golden 2, found 2.1"),
    "key more": (tree(more=1), "summary.json, more: golden none, found a number"),
    "item": (tree(poles=[-1.0, -2.6]), "summary.json, poles in item 1: golden -2.5, found -2.6"),
    "length": (tree(poles=[-1.0]), "summary.json, poles: golden 2 values, found 1 value"),
    "nested": (tree(runs=[{"seed": 3}, {"seed": 5}]), "runs.seed in item 1: golden 4, found 5"),
    "not a number": (tree(gain=float("nan")), "summary.json.gain: nan must be a finite number"),
    "no JSON": (write("out/summary.json", b'{"gain": 2'), "summary.json: is not JSON"),
    "colour": (lambda: picture(Path("out/fig1.png"), 90), "fig1.png: moved\n    - RMS "),
    "size": (lambda: picture(Path("out/fig1.png"), 0, 41), "40 x 41 pixels, the reference figure"),
    "no picture": (write("out/fig1.png", b"PNG"), "fig1.png: is damaged or is no image"),
    "missing": (lambda: Path("out/summary.json").unlink(), "summary.json: it is missing"),
    "new": (write("out/fig2.csv", b"a\n1\n"), "fig2.csv: there is no accepted file"),
    "new but damaged": (write("out/fig2.csv", b"a\n1,2\n"), "fig2.csv: line 2 has not 1 cells"),
}


@pytest.mark.parametrize("change", CHANGED)
def test_each_change_is_named_fails_and_can_be_accepted(change: str, capsys: Capture) -> None:
    assert main(COMPARE) == 0
    assert capsys.readouterr().out == "3 files: 3 agree\n"
    make, said = CHANGED[change]
    make()
    assert main(COMPARE) == 1
    printed = capsys.readouterr()
    assert said in printed.out
    assert "1 does not agree with what was accepted; see figdiff/index.html" in printed.err
    assert read_text("figdiff/summary.md") == printed.out
    page = read_text("figdiff/index.html")
    assert '<span class="verdict">' in page
    if change in ("colour", "number", "item"):
        accept = [
            "accept",
            "--reference",
            "ref",
            "--results",
            "out",
            "--reason",
            "a new gain is in",
        ]
        assert main(accept) == 0
        assert capsys.readouterr().out.endswith(": moved\n")
        assert read_text("ref/REASONS.md").endswith(": a new gain is in (1 file moved)\n")
        assert main(COMPARE) == 0


@given(st.floats(allow_nan=False, allow_infinity=False), st.floats(-9, 0), st.booleans())
def test_tolerance_separates_numbers_that_agree(value: float, power: float, above: bool) -> None:
    relative = 10**power
    moved = value + (1.5 if above else 0.5) * (1e-12 + relative * abs(value))
    for folder, number in (("ref", value), ("out", moved)):
        write_text(f"{folder}/runs/scores.csv", f"x\n{number!r}\n")
    (item,) = compare_folders(Path("ref/runs"), Path("out/runs"), Tolerances(relative=relative))
    resolved = abs(moved - value) > 1e-15 * abs(value)  # where half a step rounds to none
    assert item.verdict == ("moved" if above and resolved else "agrees")


def test_tolerances_are_stated_for_all_files_and_for_some(capsys: Capture) -> None:
    table("1.25", "1.26")()
    tree(gain=2.001)()
    picture(Path("out/fig1.png"), 2)
    write_text(
        "allowed.yaml",
        "relative: 1e-2\nfiles:\n  fig*.png: {picture: 5}\n  summary.json: {relative: 1e-6}\n",
    )
    assert main([*COMPARE, "--tolerances", "allowed.yaml"]) == 1
    said = capsys.readouterr().out
    assert said.startswith("3 files: 1 moved, 2 agree\n- summary.json: moved\n")
    write_text("allowed.yaml", "relativ: 1e-2\n")
    assert main([*COMPARE, "--tolerances", "allowed.yaml"]) == 1
    assert "allowed.yaml" in capsys.readouterr().err


def test_folders_that_are_not_there_and_empty_ones_are_refused(capsys: Capture) -> None:
    assert main(["figdiff"]) == 1
    said = "--reference: there is no folder tests/reference, nor config/papers, the papers of a"
    assert said in capsys.readouterr().err
    Path("empty").mkdir()
    assert main(["figdiff", "--reference", "ref", "--results", "empty"]) == 1
    assert "empty: has no files to compare: *.csv, *.json, *.png" in capsys.readouterr().err


ACCEPT = ["accept", *COMPARE[1:], "--reason", "a new gain is in"]


def content() -> dict[str, bytes]:
    return {str(path): path.read_bytes() for path in Path().rglob("*") if path.is_file()}


@pytest.mark.parametrize(
    ("spoil", "said"),
    [
        (lambda: Path("out").rename("old") and Path("out").symlink_to("ref"), "beside ref"),
        (lambda: Path("out").rename("ref/out") and Path("out").symlink_to("ref/out"), "beside ref"),
        (lambda: Path("out").rename("old") and Path("out").mkdir(), "out: has no files to compare"),
        (write("out/summary.json", b'{"gain": NaN}'), "nothing is accepted: out/summary.json"),
        (write("out/runs/scores.csv", b"a,b\n1\n"), "nothing is accepted: out/runs/scores.csv"),
        (write("out/fig1.png", b"PNG"), "nothing is accepted: out/fig1.png"),
        *[
            (write(f"out/new{kind}", b"\x89\xff"), f"nothing is accepted: out/new{kind}")
            for kind in COMPARED
        ],
    ],
)
def test_nothing_is_accepted_that_would_lose_files(
    spoil: Callable[[], object], said: str, capsys: Capture
) -> None:
    spoil()
    before = content()
    assert main(ACCEPT) == 1
    assert said in capsys.readouterr().err
    assert content() == before


def test_accepted_files_that_are_gone_are_removed_last(capsys: Capture) -> None:
    Path("out/summary.json").unlink()
    write_text("out/new.csv", "a\n1\n")
    Path("out/fig1.png").unlink()
    Path("out/fig1.png").symlink_to("../ref/fig1.png")
    assert main(ACCEPT) == 0
    assert main(COMPARE) == 0
    assert sorted(path.name for path in Path("ref").glob("*.*")) == [
        "REASONS.md", "fig1.png", "new.csv", "notes.txt",
    ]  # fmt: skip


@pytest.mark.parametrize(
    ("accepted", "new"),
    [
        ({"a.b": 1, "a": {"b": 2}}, {"a.b": 7, "a": {"b": 2}}),
        ({"a": [{"b": 1}], "a.b": [5]}, {"a": [{"b": 9}], "a.b": [5]}),
        ({"": {"b": 1}, "b": 3}, {"": {"b": 2}, "b": 3}),
        (None, "None"), (True, "True"), (True, 1), (1, "1"), ([], "[]"), ({}, []), ([[1]], [1]),
        ([1, 2], [1, 3]), (1, 2), ([None], [0]), ({"a": []}, {}),
    ],
)  # fmt: skip
def test_different_trees_do_not_agree(accepted: object, new: object) -> None:
    for folder, tree in (("ref", accepted), ("out", new)):
        write_text(f"{folder}/runs/tree.json", json.dumps(tree))
    items = compare_folders(Path("ref/runs"), Path("out/runs"), Tolerances())
    assert {item.name: item.verdict for item in items}["tree.json"] == "moved"


@pytest.mark.parametrize("name", ["runs/scores.csv", "summary.json"])
def test_byte_order_mark_is_no_difference(name: str) -> None:
    Path("out", name).write_bytes(b"\xef\xbb\xbf" + Path("ref", name).read_bytes())
    items = compare_folders(Path("ref"), Path("out"), Tolerances())
    assert {item.verdict for item in items} == {"agrees"}


@given(st.integers(0, 120), st.binary(max_size=9), st.booleans())
def test_damaged_picture_is_named_without_an_address(at: int, put: bytes, cut: bool) -> None:
    content = Path("ref/fig1.png").read_bytes()
    Path("out/fig1.png").write_bytes(content[:at] + put + content[at + len(put) :] * (not cut))
    item = compare_folders(Path("ref"), Path("out"), Tolerances())[0]
    assert not re.search(r"0x|BytesIO", "".join(item.problems))


@pytest.mark.parametrize("files", range(1, 4))
def test_counts_have_their_plural(files: int, capsys: Capture) -> None:
    """Values of a list, rows and files, one to three."""
    for folder in ("ref", "out"):
        for number in range(files):
            write_text(f"{folder}/one/{number}.json", json.dumps([folder] * (number + 1)))
    assert main(["figdiff", "--reference", "ref/one", "--results", "out/one"]) == 1
    tree(poles=[0] * files, runs=[])()
    main(COMPARE)
    printed = capsys.readouterr()
    said = printed.out + printed.err
    assert not re.search(r"\b1 (more )?(files|values|numbers|do)\b", said)
    assert not re.search(r"\b[2-9] (more )?(file|value|number|does)\b", said)
    assert f"{files} file{'s' * (files > 1)}: " in printed.out


def test_picture_of_more_bits_is_no_picture_that_agrees(capsys: Capture) -> None:
    for folder, grey in (("ref", 30000), ("out", 60000)):
        Image.fromarray(np.full((9, 9), grey, dtype=np.uint16)).save(f"{folder}/fig1.png")
    assert main(COMPARE) == 1
    assert "more than 8 bits a channel" in capsys.readouterr().out


def test_parts_and_tolerances_are_refused_where_they_mean_nothing(capsys: Capture) -> None:
    assert main([*COMPARE, "ilo/fig1"]) == 1
    assert "ilo/fig1: is for papers of a project" in capsys.readouterr().err
    write_text("config/papers/ilo.yaml", "")
    Path("ref/ilo").mkdir()
    assert main([*COMPARE, "--tolerances", "nowhere.yaml"]) == 1
    assert "--tolerances: is for folders of other files" in capsys.readouterr().err
