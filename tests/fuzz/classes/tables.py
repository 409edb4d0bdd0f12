"""Tables, CSV: numbers before claims, a study before numbers, claims before verdicts."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from random import Random

from reobserve.scoring.metrics import read_metrics

from .. import material, mutations
from ..case import Case, command

_TOKENS = [
    *(b",", b",,", b"\n", b"\n\n", b"\r", b'"', b'""', b"nan", b"-inf", b"1e999", b"x", b"\x00"),
    b" ",
    *(b"\xff", b"\xc3\xa9", b"\xef\xbb\xbf", b"observer,metric,value,unit\n", b"1_000"),
    b"\xd9\xa3",
    *(b"$(touch escaped)", b"-1", b"1e308", b"0x1", b"1,2,3,4\n", b"a" * 20_000),
]  # fmt: skip


def make(random: Random) -> Case:
    """A table with damage, and one that reads it."""
    name = random.choice([*_READERS])
    content, told = mutations.damaged(random, _example(name), _TOKENS)
    return case(name, content, told)


def examples() -> Iterator[Case]:
    """Each table as it is."""
    for name in _READERS:
        yield case(name, _example(name), "as it is")


def case(name: str, content: bytes, told: str) -> Case:
    """Run what reads the table."""
    return Case(f"{name}: {told}", _READERS[name](), {"t.csv": content})


def _example(name: str) -> bytes:
    if name == "metrics":
        return material.metrics("eso", "fig2")
    if name == "study":
        return material.study().read_bytes()
    return material.claims_table().read_bytes()


def _metrics() -> Callable[[], object]:
    return lambda: read_metrics("t.csv")


def _study() -> Callable[[], object]:
    files = ["--plant-file", material.record("lie"), "--study-file", "t.csv"]
    files += ["--estimate-files", *material.estimates("fig1_orders"), "--output", "m.csv"]
    arguments = ["stage", "metrics", material.ledger_file("lie"), "fig1_orders", *files]
    return lambda: command(*arguments)


def _claims() -> Callable[[], object]:
    return lambda: command("stage", "verdicts", "t.csv", "--output", "v.md")


_READERS = {"metrics": _metrics, "study": _study, "claims": _claims}
