"""The functions behind a call are those that it enters, on any Python that is supported."""

from __future__ import annotations

import runpy
from pathlib import Path

import pytest

from tests import walks

SAMPLE = '''
import functools

def outer(n):
    """Nested functions count, comprehensions do not."""

    def inner(k):
        # no line of code
        return (k +
                1)

    return [inner(k) for k in range(n)]

@functools.cache
def decorated():
    return (lambda: 2)()

def not_called():
    return 0

class Body:
    size = 1

    def method(self):
        return sum(self.size for _ in range(3))

outer(2), outer(3), decorated(), Body().method()
'''


@pytest.fixture
def seen(tmp_path: Path) -> walks.Walk:
    file = tmp_path / "sample.py"
    file.write_text(SAMPLE)
    return walks.walk(lambda: runpy.run_path(str(file)), tmp_path)


def test_functions_and_class_bodies_are_counted_once(seen: walks.Walk, tmp_path: Path) -> None:
    names = {name for _, _, name in seen}
    assert names == {"outer", "inner", "decorated", "Body", "method"}
    assert walks.sizes(seen) == [5, 1, 6]
    assert not walks.walk(lambda: runpy.run_path(str(tmp_path / "sample.py")))  # outside src


@pytest.mark.parametrize(
    ("stated", "code"),
    [([5, 1, 6], 0), ([9, 9, 9], 0), ([4, 1, 6], 1), ([5, 0, 6], 1), ([5, 1, 5], 1)],
)
def test_longer_walk_fails(
    seen: walks.Walk, tmp_path: Path, monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str], stated: list[int], code: int,
) -> None:  # fmt: skip
    table = tmp_path / "budget.toml"
    table.write_text(f'["{walks.SECTION}"]\n"a call" = {stated}\n')
    monkeypatch.setattr(walks, "walks", lambda: {"a call": seen})
    monkeypatch.setattr(walks, "TABLE", str(table))
    assert walks.main() == code
    said = capsys.readouterr().out
    assert said.startswith("a call: [5, 1, 6]")
    assert (f"above {stated}" in said) == code
