"""Comparison of two plots of one figure by decoded pixels on white.

Two numbers count. The root mean square over all pixels shows large-area changes. The minimum local
structural similarity (Wang, Bovik, Sheikh & Simoncelli 2004, over windows of `_WINDOW` pixels)
shows small changes; its mean over a page that is mostly white would hide a changed label.

The tolerances separate changes that must pass from changes that must not. They were chosen after
both had been measured on the figures of this project:

- Another processor (builds without AVX2, FMA and AVX-512, in numpy, OpenBLAS, numba and the C
  library; 11 figures of the five papers): RMS up to 0.0053, similarity down to 0.9997. Nine of the
  eleven are the same bytes; in two the gains of `eso` move by what its solver leaves open.
- One letter or digit replaced in one text, up to 13 texts a figure: RMS from 0.175 on, similarity
  0.81 at most.
- One curve moved by three line widths, each curve of every figure: RMS from 2.2 on, similarity
  0.02 at most.

They do not cover every number within its golden tolerance: those come from halving the steps, and
on logarithmic axes some errors are smaller than that. A figure that shows it deserves a look.
"""

from __future__ import annotations

import io
import warnings
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from reobserve.core.errors import InputError
from reobserve.core.files import read_bytes

Pixels = NDArray[np.uint8]

RMS = 0.1  # grey levels of 0 to 255, at most
SIMILARITY = 0.95  # at least; 1 is the same

_WINDOW = 7  # pixels; half the height of a line of text
_WHITE = 255
_MAX_PIXELS = 20_000_000  # 80 megabytes; the largest figure has 1.6 million


@dataclass(frozen=True)
class PixelDifference:
    """How far a new figure is from the reference.

    ``rms`` is the root mean square over all pixels and channels in grey levels of 0 to 255,
    ``similarity`` the minimum local structural similarity, and ``place`` where (column, row).
    """

    rms: float
    similarity: float
    place: tuple[int, int] | None

    @property
    def exceeded(self) -> bool:
        """Whether a tolerance is exceeded."""
        return self.rms > RMS or self.similarity < SIMILARITY

    def __str__(self) -> str:
        """Both numbers in words."""
        return f"RMS {self.rms:.3g} grey levels, minimum local similarity {self.similarity:.4f}"


def read_pixels(path: Path) -> Pixels:
    """The picture of a PNG on white paper, shape (rows, columns, 3).

    Raises
    ------
    InputError
        If the file is missing, damaged, no PNG, or of more than `_MAX_PIXELS`.
    """
    from PIL import Image

    content = io.BytesIO(read_bytes(path))
    try:
        with (
            warnings.catch_warnings(action="ignore"),
            Image.open(content, formats=["PNG"]) as image,
        ):
            if image.width * image.height > _MAX_PIXELS:
                raise ValueError(f"{image.width} x {image.height} pixels are too many")
            picture = image.convert("RGBA")
    except Exception as error:  # what decoders raise has no common type
        raise InputError(str(path), f"is damaged or is no picture ({error})") from None
    paper = Image.new("RGBA", picture.size, (_WHITE, _WHITE, _WHITE, _WHITE))
    return np.asarray(Image.alpha_composite(paper, picture).convert("RGB"))


def compare(reference: Pixels, new: Pixels, name: str) -> PixelDifference:
    """How far ``new`` is from ``reference``; `InputError` if they differ in size."""
    if reference.shape != new.shape:
        here, there = (f"{p.shape[1]} x {p.shape[0]}" for p in (new, reference))
        raise InputError(name, f"has {here} pixels, the reference figure has {there}")
    if np.array_equal(reference, new):
        return PixelDifference(0.0, 1.0, None)
    difference = reference.astype(np.float64) - new
    rms = float(np.sqrt(np.mean(difference**2)))
    similarity, place = _least_similarity(reference, new)
    return PixelDifference(rms, similarity, place)


def show_difference(reference: Pixels, new: Pixels, place: tuple[int, int] | None) -> bytes:
    """A PNG of the reference, faded, in red where ``new`` differs, with a frame round ``place``."""
    from PIL import Image, ImageDraw

    shown = _WHITE - (_WHITE - reference) // 6
    shown[(reference != new).any(axis=2)] = (205, 0, 45)
    image = Image.fromarray(shown)
    if place is not None:
        (column, row), half = place, 3 * _WINDOW
        frame = (column - half, row - half, column + half, row + half)
        ImageDraw.Draw(image).rectangle(frame, outline=(20, 60, 200), width=2)
    stream = io.BytesIO()
    image.save(stream, format="PNG", optimize=True)
    return stream.getvalue()


def _least_similarity(reference: Pixels, new: Pixels) -> tuple[float, tuple[int, int]]:
    """The minimum local structural similarity and its place, column and row."""
    from skimage.metrics import structural_similarity

    # A margin of white, so that a window fits into the smallest picture.
    margin = ((_WINDOW, _WINDOW), (_WINDOW, _WINDOW), (0, 0))
    padded = [np.pad(pixels, margin, constant_values=_WHITE) for pixels in (reference, new)]
    _, local = structural_similarity(
        *padded, win_size=_WINDOW, data_range=_WHITE, channel_axis=2, full=True
    )
    local = local.min(axis=2)
    row, column = np.unravel_index(int(np.argmin(local)), local.shape)
    return float(local[row, column]), (int(column) - _WINDOW, int(row) - _WINDOW)
