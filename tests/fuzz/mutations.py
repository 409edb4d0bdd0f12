"""Changes that make a valid example an odd one: of values, trees and bytes."""

from __future__ import annotations

import copy
from collections.abc import Callable
from random import Random
from typing import Any

# What a user, or a program that writes for him, puts where something else belongs.
WORDS = [
    *("", " ", "x", "nan", "1e3", "0x10", "true", "null", "~", "None", "1,5", "٣", "sampled"),
    *("a b", "a;b", "it's", '"', "$(touch escaped)", "`touch escaped`", "$HOME", "{x}", "%s"),
    *(
        "../../../escaped",
        "/escaped",
        ".",
        "..",
        "con/stant",
        "-",
        "--help",
        "\x00",
        "\n",
        "\u202e",
    ),
    *("\ud800", "é" * 40, "x" * 20_000, "__import__('os').system('touch escaped')", "<b>&amp;"),
]
NUMBERS = [
    *(0, -0.0, 1, -1, 2, 3, 0.5, 1e-9, 5e-324, 1e300, -1e300, 2**31, 2**63, -(2**64), 10**30),
    *(float("nan"), float("inf"), float("-inf")),
]


def word(random: Random) -> str:
    """A text that is none of those that are expected."""
    return random.choice(WORDS)


def value(random: Random) -> Any:
    """A plain value of any kind."""
    kind = random.randrange(10)
    if kind < 4:
        return random.choice(NUMBERS)
    if kind < 7:
        return word(random)
    return copy.deepcopy(
        random.choice(
            [None, True, False, [], {}, [[]], [None], [{}], {"": None}, {"value": 1}, [1, [2, "x"]],
             {"value": 1, "unit": "1", "source": "x"}, [0] * 500, deep(200)]
        )
    )  # fmt: skip


def deep(levels: int) -> Any:
    """A list in a list in a list, and so on."""
    tree: Any = []
    for _ in range(levels):
        tree = [tree]
    return tree


def tree(random: Random, whole: Any, odd: Callable[[Random], Any] = value) -> tuple[Any, str]:
    """A copy of plain data with one to three changes, and what they are."""
    changed, told = copy.deepcopy(whole), []
    for _ in range(random.choice([1, 1, 1, 2, 3])):
        changed, what = _change(random, changed, odd)
        told.append(what)
    return changed, "; ".join(told)


def _change(random: Random, whole: Any, odd: Callable[[Random], Any]) -> tuple[Any, str]:
    path = _path(random, whole)
    if not path:
        new = odd(random)
        return new, f"all = {new!r:.80}"
    parent = whole
    for step in path[:-1]:
        parent = parent[step]
    last, place = path[-1], ".".join(map(str, path))
    act = random.randrange(10)
    if act < 5:
        parent[last] = odd(random)
        return whole, f"{place} = {parent[last]!r:.80}"
    if act < 6:
        old = parent[last]
        parent[last] = scaled(random, old)
        return whole, f"{place} = {parent[last]!r:.80}"
    if act < 8:
        del parent[last]
        return whole, f"no {place}"
    if isinstance(parent, dict):
        name = word(random) if act == 8 else f"{last}x"
        parent[name] = parent.pop(last) if random.random() < 0.5 else odd(random)
        return whole, f"{place} -> {name!r:.40}"
    parent.insert(random.randrange(len(parent) + 1), copy.deepcopy(parent[last]))
    return whole, f"{place} twice"


def scaled(random: Random, old: Any) -> Any:
    """A number times another, a text with something at its end, a list cut or drawn out."""
    if isinstance(old, bool) or old is None or isinstance(old, dict):
        return [old]
    if isinstance(old, int | float):
        return old * random.choice([0, -1, 0.5, 3, 1e-12, 1e12])
    if isinstance(old, str):
        return old + random.choice(["x", " ", "/", "\n", "'"])
    return random.choice([old[:-1], old + old, [old]])


def _path(random: Random, whole: Any) -> list[Any]:
    """To a random part; shallow and deep ones are as likely."""
    path: list[Any] = []
    here = whole
    while isinstance(here, dict | list) and here and (not path or random.random() < 0.8):
        step = random.choice(list(here)) if isinstance(here, dict) else random.randrange(len(here))
        path.append(step)
        here = here[step]
    return path


def damaged(random: Random, content: bytes, tokens: list[bytes] | None = None) -> tuple[bytes, str]:
    """Bytes with bits turned, pieces cut out, doubled, cut off, or replaced by ``tokens``."""
    data = bytearray(content)
    told = []
    for _ in range(random.choice([1, 1, 2, 4])):
        at = random.randrange(len(data) + 1)
        length = random.choice([1, 2, 8, 64])
        act = random.randrange(7 if tokens else 5)
        if act == 0 and at < len(data):
            data[at] ^= 1 << random.randrange(8)
            told.append(f"bit at {at}")
        elif act == 1:
            del data[at : at + length]
            told.append(f"{length} bytes cut at {at}")
        elif act == 2:
            data[at:at] = data[at : at + length]
            told.append(f"{length} bytes twice at {at}")
        elif act == 3:
            del data[at:]
            told.append(f"cut off at {at}")
        elif act == 4:
            data[at : at + length] = random.randbytes(length)
            told.append(f"{length} random bytes at {at}")
        elif tokens:
            token = random.choice(tokens)
            data[at : at + random.choice([0, 0, length])] = token
            told.append(f"{token!r:.60} at {at}")
    return bytes(data), ", ".join(told)
