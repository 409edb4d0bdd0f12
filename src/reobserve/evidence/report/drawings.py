"""Drawings: files of a figure as images inside the page."""

from __future__ import annotations

import base64
import re
import struct
from collections.abc import Sequence
from xml.etree import ElementTree

from reobserve.errors import InputError
from reobserve.evidence.report.model import Gap, Image, Link
from reobserve.evidence.report.reading import Project

# Lengths of an SVG in CSS pixels.
_PIXELS = {"": 1.0, "px": 1.0, "pt": 4 / 3, "in": 96.0, "mm": 96 / 25.4, "cm": 96 / 2.54}

# PNG files are drawn with this many pixels to a CSS pixel, at least.
_DENSITY = 1.6

_PNG = b"\x89PNG\r\n\x1a\n"


def drawing(
    project: Project, base: str, formats: Sequence[str], place: str, log: str
) -> tuple[Image | None, tuple[Link, ...], tuple[Gap, ...]]:
    """The image of a figure, links to its files, and what is missing of either.

    ``base`` is the path without suffix, ``log`` that of the job that draws. Vectors are preferred,
    then PNG; a PDF can only be linked.
    """
    image = None
    gaps = []
    missing = [f"{base}.{kind}" for kind in formats if not project.exists(f"{base}.{kind}")]
    if missing:
        sentence = f"{', '.join(missing)}: not built{project.reason(log)}"
        gaps.append(project.gaps.add(place, sentence))
    for kind, read in (("svg", _svg), ("png", _png)):
        if image is None and kind in formats and project.exists(f"{base}.{kind}"):
            try:
                image = read(project, f"{base}.{kind}")
            except InputError as error:
                gaps.append(project.gaps.add(place, error))
    there = [kind for kind in formats if project.exists(f"{base}.{kind}")]
    links = tuple(project.link(f"{base}.{kind}", kind.upper()) for kind in there)
    return image, links, tuple(gaps)


def _svg(project: Project, path: str) -> Image:
    content = project.bytes(path)
    try:
        root = ElementTree.fromstring(content)
    except ElementTree.ParseError as error:
        raise InputError(path, f"is no SVG ({error})") from None
    sizes = [re.fullmatch(r"([\d.]+)([a-z]*)", root.get(key, "")) for key in ("width", "height")]
    if not root.tag.endswith("svg") or any(s is None or s[2] not in _PIXELS for s in sizes):
        raise InputError(path, "is no SVG with a width and a height")
    width, height = (round(float(s[1]) * _PIXELS[s[2]]) for s in sizes if s)
    return Image(_data_uri("image/svg+xml", content), width, height)


def _png(project: Project, path: str) -> Image:
    content = project.bytes(path)
    if not content.startswith(_PNG) or len(content) < 24:
        raise InputError(path, "is no PNG")
    width, height = struct.unpack(">II", content[16:24])
    return Image(_data_uri("image/png", content), round(width / _DENSITY), round(height / _DENSITY))


def _data_uri(kind: str, content: bytes) -> str:
    return f"data:{kind};base64,{base64.b64encode(content).decode()}"
