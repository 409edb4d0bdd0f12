"""YAML and JSON written by users: plain bounded data, or one bounded message."""

from __future__ import annotations

import os
from collections import OrderedDict
from pathlib import Path
from typing import Any

import pytest

from reobserve.core.documents import (
    DEPTH,
    check_plain,
    parse_json,
    parse_yaml,
    read_json,
    read_yaml,
)
from reobserve.core.errors import InputError, one_line, shown

BOMB = "a: &a [x,x,x,x,x,x,x,x,x]\n" + "".join(
    f"{key}: &{key} [{','.join([f'*{chr(ord(key) - 1)}'] * 9)}]\n" for key in "bcdefghi"
)

# Each case by name: the text, and its message.
REFUSED = {
    "latin-1": ("a: n\xe9e".encode("latin-1"), r"byte 5 is not UTF-8"),
    "utf-16": ("a: 1".encode("utf-16"), r"byte 1 is not UTF-8"),
    "binary": (b"a: !!binary aGVsbG8=", r"the tag tag:yaml.org,2002:binary; only plain values"),
    "a set": (b"a: !!set {x, y}", r"the tag tag:yaml.org,2002:set"),
    "a python tag": (b"!!python/object/apply:os.system [ls]", r"the tag tag:yaml.org,2002:python"),
    "5000 digits": (b"a: " + b"9" * 5000, r"a number of more than 30 characters"),
    "beyond 2^53": (b"a: 9007199254740993", r"a: is an integer beyond 2\^53"),
    "infinite": (b"a: {b: -.inf}", r"a.b: -inf must be a finite number"),
    "no number": (b"a: [1, .nan]", r"a.1: nan must be a finite number"),
    "a recursive alias": (b"a: &a [*a]", rf"nested deeper than {DEPTH} levels"),
    "a recursive mapping": (b"a: &a {b: *a}", rf"nested deeper than {DEPTH} levels"),
    "an alias bomb": (BOMB.encode(), r"holds more values or text than anything"),
    "aliases of a long text": (
        b"a: [&l " + b"y" * 80_000 + b", *l" * 100 + b"]", r"holds more values or text than",
    ),
    "many aliases": (b"a: [&l 1" + b", *l" * 1000 + b"]", r"more than 200 aliases"),
    "many values": (b"a: [" + b"1," * 100_000 + b"]", r"holds more values or text than"),
    "deep lists": (b"[" * 2000, rf"nested deeper than {DEPTH} levels"),
    "deep blocks": (b"- " * 2000, rf"nested deeper than {DEPTH} levels"),
    "deep mappings": (b"{a: " * 2000, rf"nested deeper than {DEPTH} levels"),
    "a large file": (b"a: " + b"x" * 600_000, r"has more than 524288 bytes"),
    "a key twice": (b"a: 1\nb: 2\na: 3", r"line 3, column 1: the key 'a' twice"),
    "an anchor twice": (
        b"a: &K1 1\nb: [&K1 2]\nc: *K1", r"line 2, column 5: the anchor &K1 is defined again, "
        r"first in line 1; give it another name",
    ),
    "a key twice, inside": (b"a: {b: 1, b: 2}", r"the key 'b' twice"),
    "a number as a key": (b"1: a", r"a key that is no text; put it in quotes"),
    "a decimal comma": (b"a: {value: 60,0, unit: s}", r"a decimal comma; numbers have"),
    "true as a key": (b"true: a", r"a key that is no text"),
    "a control character": (b"a: \x07", r"unacceptable character"),
    "two documents": (b"a: 1\n---\nb: 1", r"but found another document|expected a single document"),
    "a list on top": (b"[1, 2]", r"must be a mapping of keys to values"),
    "nothing": (b"", r"must be a mapping of keys to values"),
}  # fmt: skip


@pytest.mark.parametrize("case", REFUSED)
def test_yaml_beyond_bounded_plain_data_is_refused(tmp_path: Path, case: str) -> None:
    content, said = REFUSED[case]
    path = tmp_path / "mine.yaml"
    path.write_bytes(content)
    with pytest.raises(InputError, match=said) as caught:
        read_yaml(path)
    assert str(caught.value).startswith(str(path))
    assert "\n" not in str(caught.value)
    assert len(str(caught.value)) < 1000


def test_plain_yaml_is_read_unchanged(tmp_path: Path) -> None:
    path = tmp_path / "mine.yaml"
    path.write_text(
        "a: [1, -2.5, 1e-3, 1.e3, true, null, née, 2007-05-01, yes, 1:30]\nb: &b {c: []}\nd: *b\n"
    )
    tree = read_yaml(path)
    values = [1, -2.5, 1e-3, 1e3, True, None, "née", "2007-05-01", "yes", "1:30"]
    assert tree == {"a": values, "b": {"c": []}, "d": {"c": []}}
    tree["b"]["c"].append(1)
    assert tree["d"] == {"c": []}, "an alias is a copy"


def test_non_regular_file_is_refused_without_waiting(tmp_path: Path) -> None:
    fifo = tmp_path / "fifo"
    os.mkfifo(fifo)
    other = "a device, fifo or socket"
    for path, kind in ((fifo, other), (Path("/dev/zero"), other), (tmp_path, "a folder")):
        for read in (read_yaml, read_json):
            with pytest.raises(InputError, match=rf"is {kind}, must be a regular|Is a directory"):
                read(path)
    with pytest.raises(InputError, match="cannot be read"):
        read_yaml(Path("a\0b"))


@pytest.mark.parametrize("text", ["[]", "1", '"text"', "null"])
def test_stage_file_must_hold_a_mapping(text: str, tmp_path: Path) -> None:
    path = tmp_path / "file.json"
    path.write_text(text)
    with pytest.raises(InputError, match=r"file\.json: must be a mapping of keys to values$"):
        read_json(path)


def nested(depth: int) -> Any:
    tree: Any = 1
    for _ in range(depth):
        tree = {"a": tree}
    return tree


def test_already_parsed_data_is_checked() -> None:
    """Snakemake parses --configfile and --config itself and passes on the result."""
    import datetime

    check_plain(OrderedDict(a=[1, {"b": "c"}], d=None), "config")
    check_plain(nested(DEPTH - 1), "config")
    shared: Any = ["x"] * 9
    for _ in range(12):
        shared = [shared] * 9
    recursive: list[Any] = []
    recursive.append(recursive)
    for tree, said in (
        ({"a": {1: 2}}, r"^config.a: has the key 1, must be text in quotes$"),
        ({"a": datetime.date(2007, 5, 1)}, r"^config.a: is a date; only numbers, text, true"),
        ({"a": b"x"}, r"^config.a: is a bytes; only"),
        ({"a": [0, {3}]}, r"^config.a.1: is a set; only"),
        ({"a": 10**5000}, r"^config.a: is an integer beyond 2\^53"),
        ({"a" * 5000: {3}}, r"^config.a+ … a+: is a set; only numbers"),
        (nested(100_000), rf"nested deeper than {DEPTH} levels$"),
        (recursive, rf"nested deeper than {DEPTH} levels$"),
        (shared, r"^config: holds more values or text than"),
    ):
        with pytest.raises(InputError, match=said):
            check_plain(tree, "config")


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ('{"a": "\\ud800"}', r"^o.a: holds half a letter, which no file can$"),
        ('{"\\ud800": 1}', r"^o: has the key '.ud800', must be text in quotes$"),
        ('{"a": 1, "a": 2}', r"^o: has the key 'a' twice$"),
        ('{"a": NaN}', r"^o.a: nan must be a finite number$"),
        ('{"a": [-Infinity]}', r"^o.a.0: -inf must be a finite number$"),
        ('{"a": 1e999}', r"^o.a: inf must be a finite number$"),
        ('{"a": ' + "9" * 5000 + "}", r"^o: has an integer beyond 2\^53$"),
        ('{"a": 9007199254740993}', r"^o.a: is an integer beyond 2\^53"),
        ("[" * 20_000 + "]" * 20_000, rf"^o: is nested deeper than {DEPTH} levels$"),
        ('{"a":' * 500 + "1" + "}" * 500, rf"is nested deeper than {DEPTH} levels$"),
        ("{", r"^o: is not JSON: Expecting property name"),
    ],
)
def test_json_beyond_bounded_plain_data_is_refused(text: str, said: str) -> None:
    with pytest.raises(InputError, match=said):
        parse_json(text, "o")


def test_messages_quote_only_a_short_excerpt() -> None:
    error = InputError(
        "a\n" * 5000, f"{shown('x' * 20_000)} is\nlong, " + "y" * 20_000 + " must end"
    )
    assert len(str(error)) < 1000
    assert "\n" not in str(error)
    assert str(error).endswith("must end")
    assert len(shown(["x" * 10_000] * 3)) <= 100
    assert shown(10**6000) == "a int too large to show"
    assert one_line("a\x1b[31mb\ud800") == "a\\x1b[31mb\\ud800"


@pytest.mark.parametrize("number", [2**53, -(2**53)])
def test_largest_integer_is_read(number: int) -> None:
    assert (
        parse_yaml(f"a: {number}", "x.yaml")
        == parse_json(f'{{"a": {number}}}', "")
        == {"a": number}
    )
    for read, text in ((parse_yaml, f"a: {2 * number}"), (parse_json, f'{{"a": {2 * number}}}')):
        with pytest.raises(InputError, match=r"a: is an integer beyond 2\^53"):
            read(text, "x.yaml")
