"""Files of a build as parts of the page: drawings as images inside it, and tables."""

from __future__ import annotations

import base64
import io
import math
import re
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

from reobserve.core.errors import InputError
from reobserve.core.files import SCORE, read_bytes, read_rows
from reobserve_papers.metrics.metrics import Metric, read_metrics
from reobserve_papers.steps.glossary import Glossary

# More observers, or fewer of the metrics of each, and a column for each makes no good table.
_MAX_COLUMNS = 6
_LEAST_FILLED = 0.6

_POINT = 4 / 3  # CSS pixels
_DENSITY = 1.6  # pixels of a PNG to a CSS pixel, at least

_LONGEST = 200_000  # bytes of an SVG in the page
_COLOURS = 64  # of a PNG there: those of lines and of their edges
_DIGITS = re.compile(r"(\.\d\d)\d{3,}")  # after hundredths of a point, of coordinates

_WORDS = ("observer", "metric", "unit", "what it is")  # columns that are no numbers


def image(path: Path) -> dict[str, Any]:
    """Return a drawing as a data URI, with its size in CSS pixels.

    Coordinates of an SVG are cut to hundredths of a point. One that is long all the same, of
    thousands of markers, gives way to the PNG beside it, if there is one.
    """
    content = read_bytes(path)
    drawn = path.with_suffix(".png")
    try:
        if path.suffix == ".svg":
            root = ElementTree.fromstring(content)
            lengths = (root.attrib[key].removesuffix("pt") for key in ("width", "height"))
            size = [float(length) * _POINT for length in lengths]
            if len(content) > _LONGEST and drawn.is_file():
                return {**image(drawn), "width": round(size[0]), "height": round(size[1])}
            source = _shortened(content.decode())
        else:
            from PIL import Image

            opened, small = Image.open(io.BytesIO(content)), io.BytesIO()
            size = [s / _DENSITY for s in opened.size]
            opened.convert("RGB").quantize(_COLOURS, Image.Quantize.FASTOCTREE).save(small, "png")
            source = f"data:image/png;base64,{base64.b64encode(small.getvalue()).decode()}"
    except (ElementTree.ParseError, KeyError, ValueError, OSError):
        kind = "SVG with a width and a height in points" if path.suffix == ".svg" else "PNG"
        raise InputError(str(path), f"is no {kind}") from None
    return {"source": source, "width": round(size[0]), "height": round(size[1])}


def _shortened(svg: str) -> str:
    """An SVG as a data URI, without what no reader sees."""
    svg = re.sub(r"<\?xml.*?\?>|<!DOCTYPE.*?>|<metadata>.*?</metadata>", "", svg, flags=re.DOTALL)
    svg = " ".join(re.sub(r"<[^>]*>", _cut, svg).split())
    if "'" not in svg:  # which is one character in a page, and a quotation mark three
        svg = svg.replace('"', "'")
    return "data:image/svg+xml," + re.sub(r'[%#<>&"]', lambda found: f"%{ord(found[0]):02X}", svg)


def _cut(tag: re.Match[str]) -> str:
    """A tag without what follows hundredths of a point, which scales are no matter of."""
    return tag[0] if "scale(" in tag[0] else _DIGITS.sub(r"\1", tag[0])


def csv_table(path: Path) -> dict[str, Any]:
    """Return a CSV as it stands, or `InputError` if it cannot be read or is empty."""
    header, rows = read_rows(path)
    if not header:
        raise InputError(str(path), "is empty")
    return _table(header, rows)


def metrics_table(path: Path, known: Glossary, most: int | None) -> dict[str, Any]:
    """Return metrics: a row a metric, a column an observer where that makes a good table.

    Rows after the first ``most`` are counted and left out.
    """
    rows = read_metrics(path)
    observers = {row.observer for row in rows}
    metrics = {(row.metric, row.unit) for row in rows}
    full = len(rows) >= _LEAST_FILLED * len(metrics) * len(observers)
    if full and len(observers) <= _MAX_COLUMNS:
        header, body = by_observer(rows, _number)
    else:
        header = ["observer", "metric", "value", "unit"]
        body = [[row.observer, row.metric, _number(row.value), row.unit] for row in rows]
    if known:
        place = header.index("metric")
        header, body = (
            [*header, "what it is"],
            [
                [*row, next((text for fits, text in known if fits.fullmatch(row[place])), "")]
                for row in body
            ],
        )
    return _table(header, body, most)


def by_observer(
    rows: Sequence[Metric], shown: Callable[[float], str]
) -> tuple[list[str], list[list[str]]]:
    """Return metrics with a row a metric and a column an observer: the header and the rows."""
    found: dict[tuple[str, str], dict[str, str]] = {}
    for row in rows:
        found.setdefault((row.metric, row.unit), {})[row.observer] = shown(row.value)
    observers = list(dict.fromkeys(row.observer for row in rows))
    body = [
        [metric, *(values.get(name, "") for name in observers), unit]
        for (metric, unit), values in found.items()
    ]
    return ["metric", *observers, "unit"], body


def _table(
    header: Sequence[str], rows: Sequence[Sequence[str]], most: int | None = None
) -> dict[str, Any]:
    """Rows of text under a header, and which columns are numbers."""
    numeric = [
        name not in _WORDS and all(SCORE.allows(row[k].replace("−", "-")) for row in rows if row[k])
        for k, name in enumerate(header)
    ]
    shown = rows[:most]
    return {
        "header": header, "rows": shown, "numeric": numeric, "left_out": len(rows) - len(shown),
    }  # fmt: skip


def _number(value: float) -> str:
    return "nan" if math.isnan(value) else f"{value:.4g}".replace("-", "−")
