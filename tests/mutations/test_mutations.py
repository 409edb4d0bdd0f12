"""The tool that changes one line at a time: what it draws, what it changes, what it says."""

from __future__ import annotations

import ast
import subprocess
from fnmatch import fnmatch
from pathlib import Path

import pytest

from tests.mutations import fresh
from tests.mutations.trial import Mutation, Trials, kept

ROOT = Path(__file__).parents[2]

SOURCE = '''"""Words - and 1 more."""


def clipped(x: int, low=0.5) -> int:
    """Not 1 < 2."""
    if not x < low and all(x):
        raise ValueError(f"{x - 1}")
    return -abs(x) // 2
'''


def changed(line: int) -> set[str]:
    return {one.new.strip() for one in fresh.sites("it.py", SOURCE, "tests")[line]}


def test_the_changes_of_a_line_are_those_of_its_operators_and_numbers() -> None:
    assert changed(4) == {"def clipped(x: int, low=0.505) -> int:"}
    assert {text.splitlines()[0] for text in changed(6)} == {
        "if not x <= low and all(x):",
        "if not x > low and all(x):",
        "if (x < low) and all(x):",
        "if not x < low or all(x):",
        "if not x < low and any(x):",
        "if not (not x < low and all(x)):",
    }
    assert changed(7) == {"pass"}
    assert changed(8) == {
        "return (abs(x)) // 2",
        "return -(x) // 2",
        "return -abs(x) / 2",
        "return -abs(x) // 3",
    }
    assert set(fresh.sites("it.py", SOURCE, "tests")) == {4, 6, 7, 8}


def test_a_tolerance_changes_by_more_than_a_hundredth() -> None:
    (one,) = fresh.sites("it.py", "SLACK = 1e-12\n", "tests")[1]
    assert ast.literal_eval(one.new.partition("= ")[2]) == pytest.approx(1e-6)


def test_a_seed_draws_the_same_changes_of_different_lines_each_time() -> None:
    drawn = fresh.generate(ROOT, 40, 1)
    assert drawn == fresh.generate(ROOT, 60, 1)[:40]
    assert drawn != fresh.generate(ROOT, 40, 2)
    assert len({(one.file, one.line) for one in drawn}) == 40
    for one in drawn:
        text = (ROOT / one.file).read_text()
        after = one.applied(text)
        assert after != text
        ast.parse(after)
        assert one.tests.startswith("tests/")


def test_every_module_has_a_room_and_every_room_its_tests() -> None:
    files = [path.relative_to(ROOT).as_posix() for path in (ROOT / "src").rglob("*.py")]
    rooms = {fresh.room(file) for file in files}
    for pattern in fresh.rooms():
        fits = [file for file in [*files, "workflow/rules/common.smk"] if fnmatch(file, pattern)]
        assert fits, f"{pattern}: fits nothing"
    named = {word for room in rooms for word in room.split() if word.startswith("tests/")}
    assert [name for name in sorted(named) if not (ROOT / name).exists()] == []
    with pytest.raises(LookupError, match="has no room"):
        fresh.room("elsewhere.py")


def test_the_kept_changes_are_changes() -> None:
    mutations = kept()
    assert len(mutations) >= 90
    assert len({(one.file, one.old, one.new) for one in mutations}) == len(mutations)
    for one in mutations:
        assert one.old != one.new
        assert one.applied((ROOT / one.file).read_text(encoding="utf-8")), one
        for word in one.tests.split():
            file = ROOT / word.partition("::")[0]
            assert file.exists() or not word.startswith("tests/"), one.tests


def test_outcomes_are_told_apart(tmp_path: Path) -> None:
    project = tmp_path / "project"
    for folder in ("src", "tests"):
        (project / folder).mkdir(parents=True)
    (project / "src/thing.py").write_text("def twice(x):\n    return 2 * x\n\n\nUNUSED = 1\n")
    (project / "tests/test_thing.py").write_text(
        "from thing import twice\n\n\n"
        "def test_twice():\n    assert twice(3) == 6\n\n\n"
        "def test_wrong():\n    assert twice(3) == 7\n"
    )
    subprocess.run(["git", "init", "--quiet"], cwd=project, check=True)
    good, wrong = (f"tests/test_thing.py -k {word}" for word in ("twice", "wrong"))
    tried = {
        "caught": Mutation("src/thing.py", "2 * x", "2 + x", good),
        "survived": Mutation("src/thing.py", "UNUSED = 1", "UNUSED = 2", good),
        "equivalent": Mutation("src/thing.py", "2 * x", "x * 2", good, "a product commutes"),
        "stale": Mutation("src/thing.py", "3 * x", "x", good),
        "broken": Mutation("src/thing.py", "2 * x", "2 + x", wrong),
    }
    outcomes = dict(Trials(project, tmp_path / "copies").run(tried.values()))
    assert {name: outcomes[k].verdict for k, name in enumerate(tried)} == {n: n for n in tried}
    assert "test_thing.py::test_twice" in outcomes[0].said
    assert (tmp_path / "copies/0/src/thing.py").read_text() == (
        project / "src/thing.py"
    ).read_text()
    nothing = Mutation("src/thing.py", "2 * x", "x", "tests/test_thing.py -k nothing")
    ((_, outcome),) = Trials(project, tmp_path / "again").run([nothing])
    assert outcome.verdict == "broken", "no test is no proof"
