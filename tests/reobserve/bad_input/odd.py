"""Strategies: valid data with a few changes."""

from __future__ import annotations

import copy
import json
from typing import Any

import yaml
from hypothesis import strategies as st

WORDS = [
    "", " ", "x", "nan", "1e3", "0x10", "true", "null", "~", "None", "1,5", "٣", "²", "sampled",
    "a b", "a;b", "it's", '"', "$(touch escaped)", "`touch escaped`", "$HOME", "{x}", "%s", ".",
    "..", "../../../escaped", "con/stant", "-", "--help", "\x00", "\n", "\u202e", "\ud800",
    "é" * 40, "x" * 20_000, "__import__('os').system('touch escaped')", "<b>&amp;",
]  # fmt: skip
NUMBERS = [
    0, -0.0, 1, -1, 2, 3, 0.5, 1e-9, 5e-324, 1e300, -1e300, 2**31, 2**63, -(2**64), 10**30,
    float("nan"), float("inf"), float("-inf"),
]  # fmt: skip
# Parts of files.
YAML = [
    b"&a ", b"*a", b"&a [*a]", b"<<: *a", b"<<: {b: 1}", b"!!binary aGk=", b"!!set {a}", b"!x",
    b"!!python/object/apply:os.system [touch escaped]", b"!!python/name:os.system", b"!!",
    b"2020-01-01", b"2020-01-01T00:00:00Z", b"1" * 5000, b"1e999", b".nan", b"-.inf", b"0b12",
    b"12:30:45", b"? ", b"? [a]\n: 1\n", b": ", b"- ", b"\t", b"\r", b"\x00", b"\xff\xfe", b"%",
    b"\xef\xbb\xbf", b"\xc3\x28", b"\xe2\x80\xa8", b"[" * 2000, b"{a: " * 1000, b"---\n",
    b"...\n", b"|\n", b">-\n", b"'", b'"', b'"\\uD800"', b"#", b"@", b"`", b"a: 1\na: 2\n",
    b"1: 2\n", b"null", b"\xf0\x9f\x98\x80", b"yes", b"!!omap [a: 1]", b"!!int x",
    b"!!float []", b"!!timestamp x",
]  # fmt: skip
CSV = [
    b",", b",,", b"\n", b"\n\n", b"\r", b"\r\n", b'"', b'""', b'"a"', b"nan", b"NA", b"inf",
    b"-inf", b"1e999", b"x", b" ", b" [", b"\x00", b"\xff", b"\xc3\xa9", b"\xef\xbb\xbf",
    b"\xd9\xa3", b"time", b"t", b"time,time", b"speed [rpm]", b";", b"\t", b"2020-01-01", b"true",
    b"1,2,3", b"0,0\n", b"#", b"=1+1", b"0x1", b"1_000", b"9" * 400, b"-1", b"-", b"1e-400",
    b"1e308", b"$(touch escaped)", b"a" * 20_000, b"observer,metric,value,unit\n",
]  # fmt: skip
DEEP: Any = []
for _ in range(200):
    DEEP = [DEEP]
TREES = [
    None, True, False, [], {}, [[]], [None], [{}], {"": None}, {"value": 1}, [1, [2, "x"]],
    {"value": 1, "unit": "1", "source": "x"}, [0] * 500, DEEP,
]  # fmt: skip

words = st.sampled_from(WORDS) | st.text(st.characters(exclude_characters="/"), max_size=8)
# Other numbers for a step or a horizon would only make the run long.
numbers = st.sampled_from(NUMBERS) | st.integers(-3, 3) | st.floats(-4, 4)
values = st.one_of(numbers, words, st.sampled_from(TREES))


@st.composite
def changed(draw: st.DrawFn, tree: Any, odd: st.SearchStrategy[Any] = values) -> Any:
    """A copy of a tree of plain values with one to three changes anywhere in it."""
    whole = copy.deepcopy(tree)
    for _ in range(draw(st.integers(1, 3))):
        path: list[Any] = []
        here: Any = whole
        while isinstance(here, dict | list) and here and (not path or draw(st.integers(0, 4))):
            keys = list(here) if isinstance(here, dict) else range(len(here))
            path.append(draw(st.sampled_from(keys)))
            here = here[path[-1]]
        if not path:
            return draw(odd)
        *above, last = path
        parent: Any = whole
        for key in above:
            parent = parent[key]
        match draw(st.sampled_from(["replace", "replace", "scale", "remove", "rename"])):
            case "replace":
                parent[last] = copy.deepcopy(draw(odd))
            case "scale":
                parent[last] = draw(scaled(parent[last]))
            case "remove":
                del parent[last]
            case "rename" if isinstance(parent, dict):
                parent[draw(st.just(f"{last}x") | words)] = parent.pop(last)
            case "rename":
                parent.append(copy.deepcopy(parent[last]))
    return whole


@st.composite
def scaled(draw: st.DrawFn, old: Any) -> Any:
    """A number times another, text with an addition, a longer or shorter list."""
    if isinstance(old, bool) or old is None or isinstance(old, dict):
        return [old]
    if isinstance(old, int | float):
        return old * draw(st.sampled_from([0, -1, 0.5, 3, 1e-12, 1e12]))
    if isinstance(old, str):
        return old + draw(st.sampled_from(["x", " ", "/", "\n", "'"]))
    return draw(st.sampled_from([old[:-1], old + old, [old]]))


@st.composite
def damaged(draw: st.DrawFn, content: bytes, tokens: list[bytes] | None = None) -> bytes:
    """Bytes with parts removed, repeated or replaced, or with a token inserted."""
    for _ in range(draw(st.integers(1, 4))):
        at = draw(st.integers(0, len(content)))
        end = at + draw(st.sampled_from([0, 1, 2, 8, 64, len(content)]))
        new = draw(
            st.just(content[at:end] * 2)
            | st.binary(max_size=8)
            | (st.sampled_from(tokens) if tokens else st.just(b""))
        )
        content = content[:at] + new + content[end:]
    return content


def bomb(width: int, depth: int) -> bytes:
    """Each line refers to the previous one several times: short to write, endless to expand."""
    lines = [f"a{k}: &a{k} [{', '.join([f'*a{k - 1}'] * width)}]" for k in range(1, depth)]
    return "\n".join(["a0: &a0 [x]", *lines]).encode()


def as_json(tree: Any) -> bytes:
    """Plain values as a program would write it."""
    return json.dumps(tree).encode()


def as_yaml(tree: Any) -> bytes:
    """Plain values as a person might write it."""
    try:
        return yaml.dump(tree, Dumper=yaml.CSafeDumper, sort_keys=False).encode()
    except UnicodeEncodeError:  # half of a surrogate pair
        return as_json(tree)
