"""Comparison of two plots of one figure by decoded pixels on white.

The root mean square of the difference counts, over all pixels and channels in grey levels of 0 to
255. The tolerance separates changes that must pass from changes that must not. It was chosen after
both had been measured on the figures of this project:

- Another processor (builds without AVX2, FMA and AVX-512, in numpy, OpenBLAS, numba and the C
  library; 11 figures of the five papers): up to 0.0053. Nine of the eleven are the same bytes; in
  two the gains of `eso` move by what its solver leaves open.
- One letter or digit replaced by the most similar one in the smallest text of the tallest figure:
  from 0.11 on (i and l, full stop and comma), digits from 0.34 on.
- One letter, digit, dot or marker erased, any one of each figure: from 0.14 on.
- One curve moved by three line widths, each curve of every figure: from 2.2 on.

It does not cover every number within its golden tolerance: those come from halving the steps, and
on logarithmic axes some errors are smaller than that. A figure that shows it deserves a look.
"""

from __future__ import annotations

import io
import warnings
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from reobserve.core.errors import InputError
from reobserve.core.files import SCORE, read_bytes
from reobserve_papers.plotting.formats import PANELS

Pixels = NDArray[np.uint8]

TOLERANCE = 0.1  # grey levels of 0 to 255, root mean square

_WHITE = 255
_MAX_PIXELS = 20_000_000  # 80 megabytes; the largest figure has 1.6 million


def read_pixels(path: Path) -> Pixels:
    """The image of a PNG on white paper, shape (rows, columns, 3)."""
    from PIL import Image, UnidentifiedImageError

    content = io.BytesIO(read_bytes(path))
    try:
        with (
            warnings.catch_warnings(action="ignore"),
            Image.open(content, formats=["PNG"]) as image,
        ):
            if image.width * image.height > _MAX_PIXELS:
                raise ValueError(f"{image.width} x {image.height} pixels are too many")
            if image.mode.startswith(("I", "F")):
                raise ValueError("more than 8 bits a channel")
            decoded = image.convert("RGBA")
    except UnidentifiedImageError:  # whose message is an address
        raise InputError(str(path), "is damaged or is no image (no PNG)") from None
    except Exception as error:  # what decoders raise has no common type
        raise InputError(str(path), f"is damaged or is no image ({error})") from None
    paper = Image.new("RGBA", decoded.size, (_WHITE, _WHITE, _WHITE, _WHITE))
    return np.asarray(Image.alpha_composite(paper, decoded).convert("RGB"))


def panel_share(path: Path) -> float:
    """The share of the height of a PNG above its note: 1 if it states none."""
    from PIL import Image

    with Image.open(io.BytesIO(read_bytes(path)), formats=["PNG"]) as image:
        stated = str(image.info.get(PANELS, 1.0))
    share = float(stated) if SCORE.allows(stated) else 1.0
    return share if 0 < share < 1 else 1.0


def compare_images(reference: Path, new: Path, name: str) -> tuple[float, float]:
    """Root mean squares of the differences of the panels, and of the note below them."""
    old, built = map(read_pixels, (reference, new))
    if old.shape != built.shape:
        return rms_difference(old, built, name), 0.0
    rows = max(round(panel_share(new) * len(built)), 1)
    note = rms_difference(old[rows:], built[rows:], name) if rows < len(built) else 0.0
    return rms_difference(old[:rows], built[:rows], name), note


def rms_difference(reference: Pixels, new: Pixels, name: str) -> float:
    """Root mean square of the difference, or `InputError` if the images differ in size."""
    if reference.shape != new.shape:
        here, there = (f"{p.shape[1]} x {p.shape[0]}" for p in (new, reference))
        raise InputError(name, f"has {here} pixels, the reference figure has {there}")
    return float(np.sqrt(np.mean((reference.astype(np.float64) - new) ** 2)))


def show_difference(reference: Pixels, new: Pixels) -> bytes:
    """A PNG of the reference, faded, in red where ``new`` differs, with a frame round all of it."""
    from PIL import Image, ImageDraw

    changed = (reference != new).any(axis=2)
    shown = _WHITE - (_WHITE - reference) // 6
    shown[changed] = (205, 0, 45)
    image = Image.fromarray(shown)
    rows, columns = np.nonzero(changed)
    corners = (columns.min(), rows.min(), columns.max(), rows.max())
    frame = [int(corner) + shift for corner, shift in zip(corners, (-9, -9, 9, 9), strict=True)]
    ImageDraw.Draw(image).rectangle(frame, outline=(20, 60, 200), width=2)
    stream = io.BytesIO()
    image.save(stream, format="PNG", optimize=True)
    return stream.getvalue()
