"""A table of equations: read, looked up and printed; each error is refused in one sentence."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
import yaml

import reobserve
from reobserve.cli.main import main
from reobserve.core.errors import InputError
from reobserve.replication.equations.sources import find_source
from reobserve.replication.equations.table import papers_with_equations, read_equations
from reobserve.replication.parameters.config import known_papers

from .citations import cited, places_in

ROOT = Path(__file__).parents[3]

IMM = "reobserve.observers.imm.IMM"
TEST = "tests/observers/test_imm.py::test_mixed_kalman_bank_depends_on_coordinates"
FIRST = {"number": "1", "statement": "It is\n  linear.", "implemented": [IMM], "tests": [TEST]}
LAST = {"number": "2", "statement": "A step.", "implemented": [], "tests": [], "note": "A step."}
OTHER = {**LAST, "number": "Theorem 1"}


def written(folder: Path, *equations: Any, **top: Any) -> Path:
    """A project in which the paper `toy` has this table."""
    path = folder / "config/equations/toy.yaml"
    path.parent.mkdir(parents=True, exist_ok=True)
    (folder / "config/papers").mkdir(exist_ok=True)
    tree = {"cited_as": "A & B 2001", "last": 2, "equations": list(equations), **top}
    path.write_text(yaml.safe_dump(tree))
    return folder


def test_equation_is_found_in_any_usual_notation(tmp_path: Path) -> None:
    table = read_equations(written(tmp_path, FIRST, OTHER, LAST), "toy")
    assert [one.place for one in table.equations] == ["(1)", "Theorem 1", "(2)"]
    for asked in ("1", "(1)", " 1 "):
        assert table.find(asked).implemented == (IMM,)
    assert table.find("theorem  1").number == "Theorem 1"
    with pytest.raises(InputError) as caught:
        table.find("(3)")
    assert str(caught.value) == "number: there is no '(3)'; there are: 1, Theorem 1, 2"


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"number": 1}, "equations.0.number: 1 must be a word"),
        ({"number": " "}, "equations.0.number: must not be empty"),
        ({"number": "01"}, "equations: (2) stands where (1) must: all, in their order"),
        ({"number": "2"}, "equations: (2) stands there twice"),
        ({"statement": ["x"]}, "equations.0.statement: ['x'] must be a word"),
        ({"statemet": "x"}, "equations.0.statemet: unknown key; did you mean 'statement'?"),
        ({"says": "x"}, "equations.0.says: is now statement"),
        ({"implemented": IMM}, f"equations.0.implemented: '{IMM}' must be a list of words"),
        (
            {"implemented": ["numpy.linalg.solve"]},
            "equations.0.implemented.0: 'numpy.linalg.solve' must be the dotted name of a class or "
            "function, as reobserve.observers.imm.IMM",
        ),
        (
            {"implemented": ["reobserve.observers._imm"]},
            "equations.0.implemented.0: 'reobserve.observers._imm' must be the dotted name of a "
            "class or function, as reobserve.observers.imm.IMM",
        ),
        (
            {"tests": ["tests/observers/test_imm.py"]},
            "equations.0.tests.0: 'tests/observers/test_imm.py' must be a test, as "
            "tests/observers/test_imm.py::test_it",
        ),
        ({"tests": []}, "equations.0.tests: is empty: name a test that shows (1)"),
        (
            {"implemented": []},
            "equations.0.note: is missing: say why nothing implements (1)",
        ),
        ({"note": 3}, "equations.0.note: 3 must be a word"),
    ],
)
def test_invalid_entry_is_reported_in_one_sentence(
    tmp_path: Path, change: dict[str, Any], said: str
) -> None:
    with pytest.raises(InputError) as caught:
        read_equations(written(tmp_path, {**FIRST, **change}, LAST), "toy")
    assert str(caught.value) == f"equations.toy.{said}"


@pytest.mark.parametrize(
    ("equations", "top", "said"),
    [
        ([LAST, FIRST], {}, ".equations: (2) stands where (1) must: all, in their order"),
        ([FIRST, OTHER, OTHER, LAST], {}, ".equations: Theorem 1 stands there twice"),
        ([FIRST], {}, ".equations: has 1 numbers, must have (1) to (2), as `last` says"),
        (
            [FIRST, LAST],
            {"last": 1},
            ".equations: has 2 numbers, must have (1) to (1), as `last` says",
        ),
        ([FIRST, LAST], {"last": "2"}, ".last: '2' must be a whole number"),
        ([FIRST, LAST], {"cited_as": ""}, ".cited_as: must not be empty"),
        ([FIRST, LAST], {"equation": []}, ".equation: unknown key; did you mean 'equations'?"),
        ([3], {}, ".equations.0: 3 must be a mapping of keys to values"),
    ],
)
def test_invalid_table_is_reported_in_one_sentence(
    tmp_path: Path, equations: list[Any], top: dict[str, Any], said: str
) -> None:
    with pytest.raises(InputError) as caught:
        read_equations(written(tmp_path, *equations, **top), "toy")
    assert str(caught.value) == f"equations.toy{said}"


def test_equation_is_printed_with_files_and_lines(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["equations", "imm", "(22)", "--project", str(ROOT)]) == 0
    head, *lines = capsys.readouterr().out.splitlines()
    assert head == "Gadsden et al. 2011, (22)"
    name = "reobserve.observers.imm_loop.combine"
    at = lines.index(f"implemented    {name}")
    file, _, line = lines[at + 1].strip().partition(":")
    assert (ROOT / file).read_text().splitlines()[int(line) - 1].startswith("def combine(")
    shown = [one.split("::")[1] for one in lines if one.startswith("shown by")]
    assert "test_three_models_with_three_outputs_agree_with_50_digits" in shown


def test_unimplemented_equation_states_the_reason(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = str(written(tmp_path, FIRST, OTHER, LAST))
    assert main(["equations", "toy", "Theorem", "1", "--project", folder]) == 0
    assert capsys.readouterr().out.splitlines() == [
        "A & B 2001, Theorem 1",
        "statement      A step.",
        "implemented    nowhere",
        "note           A step.",
    ]
    assert main(["equations", "toy", "--project", folder]) == 0
    assert capsys.readouterr().out.splitlines()[:4] == [
        "toy  A & B 2001: (1) to (2) and 1 other places, 1 of them implemented",
        "  (1)        observers.imm.IMM",
        "  Theorem 1  -",
        "  (2)        -",
    ]
    assert main(["equations", "--project", folder]) == 0
    assert capsys.readouterr().out.startswith("toy  A & B 2001: (1) to (2)")


@pytest.mark.parametrize(
    ("asked", "said"),
    [
        (["toi"], "paper: there is no 'toi'; did you mean 'toy'?"),
        (["toy", "3"], "number: there is no '3'; there are: 1, 2"),
        (["toy", "1"], f"'{IMM}x': there is no 'IMMx' in imm.py"),
    ],
)
def test_unknown_equation_is_reported_in_one_sentence(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], asked: list[str], said: str
) -> None:
    folder = written(tmp_path, {**FIRST, "implemented": [f"{IMM}x"]}, LAST)
    assert main(["equations", *asked, "--project", str(folder)]) == 1
    shown = capsys.readouterr()
    assert (shown.out, shown.err) == ("", f"reobserve: {said}\n")


def test_folder_without_tables_is_reported(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "config/papers").mkdir(parents=True)
    for asked in ([], ["ilo", "3"]):
        assert main(["equations", *asked, "--project", str(tmp_path)]) == 1
        assert capsys.readouterr().err == (
            f"reobserve: {tmp_path}/config/equations: has no table of equations; "
            "--project names another project\n"
        )


def test_unreadable_folder_is_reported(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def denied(*_: Any) -> None:
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr(Path, "glob", denied)
    for listed, folder in ((papers_with_equations, "equations"), (known_papers, "papers")):
        with pytest.raises(InputError) as error:
            listed(tmp_path)
        reported = f"{tmp_path / 'config' / folder}: cannot be read (Permission denied)"
        assert str(error.value) == reported


@pytest.mark.parametrize(
    "name",
    ["reobserve", "reobserve.observers", "reobserve.observers.imm", "reobserve.nothing.here",
     "reobserve.observers.imm._as_transition", "reobserve.observers.imm.as_floats"],
)  # fmt: skip
def test_non_public_definition_is_refused(name: str) -> None:
    with pytest.raises(InputError):
        find_source(name)


def test_method_is_found_in_its_class() -> None:
    source = find_source(f"{IMM}.init")
    assert source.file == Path(reobserve.__file__).parent / "observers/imm.py"
    assert source.docstring.startswith("The state before the first row of a record.")
    lines = source.file.read_text().splitlines()
    assert lines[source.line - 1].startswith("    def init(")


def test_citations_are_found_in_text() -> None:
    assert places_in("(1), x(0) and f (23); see (4) to (6)") == ["(1)", "(23)", "(4)", "(5)", "(6)"]
    assert places_in("Propositions 4.1, 4.2 and 5.1; Assumptions 1 to 3 and 7") == [
        "Proposition 4.1", "Proposition 4.2", "Proposition 5.1",
        "Assumption 1", "Assumption 2", "Assumption 3", "Assumption 7",
    ]  # fmt: skip
    assert places_in("Definition 2.1, 3, and Table VII") == ["Definition 2.1", "Table VII"]
    text = "It is so (A & B 2001, (9) to (11),\n  after (2) and Remark 3.1), as A & B 2001 say (4)."
    assert cited(text, "A & B 2001") == ["after (2)", "(9)", "(10)", "(11)", "Remark 3.1"]
    assert cited("A & B 2001, Remarks 3.1 and 3.2, Table I, (4)", "A & B 2001") == [
        "(4)", "Table I", "Remark 3.1", "Remark 3.2",
    ]  # fmt: skip
    assert cited("A & B 2001 compare, (3).", "A & B 2001") == []
