"""YAML as bytes: what editors, other programs and malice make of a file."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from random import Random

from reobserve.plain_data.documents import read_yaml

from .. import material, mutations
from ..case import Case

_TOKENS = [
    *(b"&a ", b"*a", b"*a ", b"&a [*a]", b"<<: *a", b"<<: {b: 1}", b"!!binary aGk=", b"!!set {a}"),
    *(b"!!python/object/apply:os.system [touch escaped]", b"!!python/name:os.system", b"!x", b"!!"),
    *(b"2020-01-01", b"2020-01-01T00:00:00Z", b"1" * 5000, b"1e999", b".nan", b"-.inf", b"0b12"),
    *(b"12:30:45", b"? ", b"? [a]\n: 1\n", b": ", b"- ", b"\t", b"\r", b"\x00", b"\xff\xfe", b"%"),
    *(b"\xef\xbb\xbf", b"\xc3\x28", b"\xe2\x80\xa8", b"[" * 2000, b"{a: " * 1000, b"---\n"),
    b"...\n",
    *(b"|\n", b">-\n", b"'", b'"', b'"\\uD800"', b"#", b"@", b"`", b"a: 1\na: 2\n", b"1: 2\n"),
    b"null",
    *(b"\xf0\x9f\x98\x80", b"yes", b"!!omap [a: 1]", b"!!int x", b"!!float []", b"!!timestamp x"),
]  # fmt: skip


def make(random: Random) -> Case:
    """A config file, or a piece of one, with damage."""
    folder = random.choice(["papers", "claims", "errata"])
    files = [f"config/{folder}/{paper}.yaml" for paper in material.PAPERS]
    path = random.choice([*files, "config/config.yaml", "config/config.yaml"])
    lines = (material.ROOT / path).read_bytes().splitlines(keepends=True)
    first = random.randrange(len(lines))
    piece = b"".join(lines[first : first + 12]) if random.random() < 0.8 else b"a: 1\n"
    if random.random() < 0.02:
        return case(_bomb(random), "aliases of aliases")
    content, told = mutations.damaged(random, piece, _TOKENS)
    if random.random() < 0.05:
        content = content.decode(errors="replace").encode(random.choice(["utf-16", "utf-32"]))
    return case(content, f"{told}: {content!r:.200}")


def examples() -> Iterator[Case]:
    """Two lines."""
    yield case(b"papers: [ilo]\nseed: 1\n", "two lines")


def case(content: bytes, told: str) -> Case:
    """Read it."""
    return Case(told, lambda: read_yaml(Path("mine.yaml")), {"mine.yaml": content})


def _bomb(random: Random) -> bytes:
    """Each line names the one before many times: short to write, without end to read."""
    width, depth = random.choice([2, 9]), random.choice([3, 9, 30])
    lines = [f"a{k}: &a{k} [{', '.join([f'*a{k - 1}'] * width)}]" for k in range(1, depth)]
    return "\n".join(["a0: &a0 [x]", *lines]).encode()
