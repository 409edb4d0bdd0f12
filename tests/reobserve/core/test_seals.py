"""Files that carry a digest: what was changed since is refused, whatever was changed."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from reobserve.core.documents import read_json
from reobserve.core.errors import InputError
from reobserve.core.files import read_table, write_table
from reobserve.core.seals import sealed

HEADER = ("name", "value", "unit")
ROWS = [{"name": "a, b", "value": 0.1}, {"name": 'say "c"', "value": float("nan"), "unit": "m"}]
CHANGES: dict[str, Callable[[str], str]] = {
    "a digit": lambda text: text.replace("0.1", "0.7"),
    "a word": lambda text: text.replace("say", "Say"),
    "a unit": lambda text: text.replace("nan,m", "nan,mm"),
    "a row lost": lambda text: "".join(text.splitlines(keepends=True)[:-1]),
    "all rows lost": lambda text: text.splitlines(keepends=True)[0],
    "rows in another order": lambda text: "".join(
        text.splitlines(keepends=True)[place] for place in (0, 2, 1)
    ),
    "a word in the last column": lambda text: text[:-1] + "x\n",
    "the digest": lambda text: text.replace("sha256:", "sha256:0"),
}


@pytest.mark.parametrize("change", CHANGES)
def test_changed_table_is_refused(tmp_path: Path, change: str) -> None:
    path = tmp_path / "t.csv"
    write_table(path, ROWS, HEADER, seal=True)
    assert read_table(path, HEADER) == [
        {"name": "a, b", "value": "0.1", "unit": ""},
        {"name": 'say "c"', "value": "nan", "unit": "m"},
    ]
    text = path.read_text()
    changed = CHANGES[change](text)
    assert changed != text
    path.write_text(changed)
    with pytest.raises(InputError, match=r"t\.csv: is not what was written: its digest is another"):
        read_table(path, HEADER)


def test_table_without_a_digest_is_as_it_stands(tmp_path: Path) -> None:
    write_table(tmp_path / "t.csv", ROWS, HEADER)
    assert (tmp_path / "t.csv").read_text().splitlines()[0] == "name,value,unit"
    assert len(read_table(tmp_path / "t.csv", HEADER)) == 2


@pytest.mark.parametrize("change", [("1.5", "1.6"), ("[", "[0, "), ("name", "names"), ("µ", "u")])
def test_changed_json_is_refused(tmp_path: Path, change: tuple[str, str]) -> None:
    tree: dict[str, Any] = {"name": {"µ": [1.5, None, True]}, "n": {1: (2, 3)}}
    path = tmp_path / "t.json"
    text = json.dumps(sealed(tree), ensure_ascii=False, indent=1)
    path.write_text(text)
    assert read_json(path) == {"name": {"µ": [1.5, None, True]}, "n": {"1": [2, 3]}}
    path.write_text(text.replace(*change, 1))
    with pytest.raises(InputError, match=r"t\.json: is not what was written"):
        read_json(path)


def test_files_of_other_versions_are_read(tmp_path: Path) -> None:
    """The digest, by `sha256sum`, is part of the format: caches and results outlast a version."""
    path = tmp_path / "t.json"
    path.write_text('{"n": [1, 2.5], "sha256": "c14784682e69073c"}')
    assert read_json(path, must_be_sealed=True) == {"n": [1, 2.5]}
