"""Pictures, PNG, as the figure diff reads them."""

from __future__ import annotations

import io
import struct
import zlib
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from random import Random

from PIL import Image

from reobserve.evidence.figure_diff.pixels import read_pixels

from .. import mutations
from ..case import Case


def make(random: Random) -> Case:
    """A small picture with damage, or with chunks of another kind and a right check sum."""
    if random.random() < 0.4:
        content, told = _chunks(random, _picture())
    else:
        content, told = mutations.damaged(random, _picture())
    return case(content, told)


def examples() -> Iterator[Case]:
    """The picture as it is."""
    yield case(_picture(), "as it is")


def case(content: bytes, told: str) -> Case:
    """Read the pixels."""
    return Case(told, lambda: read_pixels(Path("p.png")), {"p.png": content})


@cache
def _picture() -> bytes:
    stream = io.BytesIO()
    image = Image.new("RGBA", (40, 30), (255, 255, 255, 0))
    for k in range(30):
        image.putpixel((k, k), (k, 2 * k, 0, 255))
    image.save(stream, "PNG")
    return stream.getvalue()


def _chunks(random: Random, content: bytes) -> tuple[bytes, str]:
    """One chunk changed, its check sum set right: what only the meaning shows."""
    at, chunks = 8, []
    while at < len(content):
        (length,) = struct.unpack(">I", content[at : at + 4])
        chunks.append((content[at + 4 : at + 8], content[at + 8 : at + 8 + length]))
        at += 12 + length
    index = random.randrange(len(chunks))
    kind, body = chunks[index]
    if random.random() < 0.2:
        kind = random.choice(
            [b"tEXt", b"PLTE", b"acTL", b"IEND", b"IDAT", b"zTXt", b"xxxx", b"eXIf"]
        )
        told = f"{chunks[index][0]!r} as {kind!r}"
    elif kind == b"IHDR" and random.random() < 0.7:
        size = random.choice([0, 1, 2**31 - 1, 2**32 - 1, 60_000, 20_000])
        body = struct.pack(">II", size, random.choice([30, size])) + body[8:]
        told = f"a width of {size}"
    else:
        body, told = mutations.damaged(random, body)
        told = f"{kind!r}: {told}"
    chunks[index] = (kind, body)
    out = content[:8]
    for name, part in chunks:
        check = zlib.crc32(name + part)
        out += struct.pack(">I", len(part)) + name + part + struct.pack(">I", check)
    return out, told
