"""Readers of files, and files that they must accept or refuse."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

from hypothesis import given
from hypothesis import strategies as st

from .odd import as_json, as_yaml, changed, damaged
from .outcome import is_accepted


@dataclass(frozen=True)
class Reader:
    """A reader of a file: ``tree`` or ``content`` is valid, ``others`` are files next to it."""

    file: str
    call: Callable[[], object]
    tree: Any = None
    content: bytes = b""
    others: Mapping[str, bytes] = field(default_factory=dict)
    is_accepted: Callable[..., bool] = is_accepted

    def accepts(self, content: bytes) -> bool:
        """Whether other content of the file is accepted."""
        return self.is_accepted(self.call, {**self.others, self.file: content})

    @cached_property
    def valid(self) -> bytes:
        """The valid file."""
        return self.content or self.dumped(self.tree)

    def dumped(self, tree: Any) -> bytes:
        """A tree in the format of the file."""
        return as_json(tree) if self.file.endswith(".json") else as_yaml(tree)


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
TOKENS = {"yaml": YAML, "json": YAML, "csv": CSV, "parquet": None}


def bomb(width: int, depth: int) -> bytes:
    """Each line refers to the previous one several times: short to write, endless to expand."""
    lines = [f"a{k}: &a{k} [{', '.join([f'*a{k - 1}'] * width)}]" for k in range(1, depth)]
    return "\n".join(["a0: &a0 [x]", *lines]).encode()


ONCE_OTHER_ERRORS = [*YAML, *(bomb(*size) for size in ((2, 30), (9, 9), (9, 30)))]


def made(reader: Callable[..., Reader], arguments: Sequence[Any]) -> list[Reader]:
    """The reader of each file, or the only one."""
    return [reader(*(one if isinstance(one, tuple) else (one,))) for one in arguments or [()]]


def check_changed_files(every: list[Reader]) -> None:
    """Valid files are accepted, changed ones accepted or refused."""
    for one in every:
        assert one.accepts(one.valid)

    @given(st.data())
    def try_one(data: st.DataObject) -> None:
        one = data.draw(st.sampled_from(every))
        contents = [damaged(one.valid, TOKENS[one.file.rpartition(".")[2]])]
        if one.tree is not None:
            contents += [changed(one.tree).map(one.dumped)] * 3
        one.accepts(data.draw(st.one_of(contents)))

    try_one()


def check_token(token: bytes, readers: Iterable[Reader]) -> None:
    """YAML with a token is accepted or refused, in another encoding refused."""
    for reader in readers:
        for content in (token, b"a: " + token, reader.valid + token, b"a: 1\nb: &b " + token):
            reader.accepts(content)
        for encoding in ("utf-16", "utf-32"):
            assert not reader.accepts(reader.valid.decode().encode(encoding))
