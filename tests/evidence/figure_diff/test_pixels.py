"""What the comparison of pixels must see, and what does not matter to it."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from matplotlib.figure import Figure
from PIL import Image
from PIL.PngImagePlugin import PngInfo

from reobserve.drawing.figures import STYLES, TRUTH, add_note, new_figure
from reobserve.drawing.fitting import fix_layout
from reobserve.drawing.formats import save
from reobserve.errors import InputError
from reobserve.evidence.figure_diff.pixels import (
    PixelDifference,
    compare,
    read_pixels,
    show_difference,
)

TIME = np.linspace(0, 10, 400)


def drawing(
    label: str = "rate [rad/s]", note: str = "RMS error 0.45 %", shift: float = 0
) -> Figure:
    """Two curves in the house's style; ``shift`` moves one of them up, in line widths."""
    figure, (axes,) = new_figure((2.0,))
    axes.plot(TIME, np.sin(TIME), **TRUTH.line(), label="truth")
    style = STYLES[1]
    (line,) = axes.plot(TIME, np.cos(TIME), **style.line(), label="estimate")
    axes.set_ylabel(label)
    axes.legend(loc="upper right")
    add_note(figure, note)
    fix_layout(figure)
    if shift:
        axes.set_autoscale_on(False)
        there = axes.transData.transform(np.column_stack([TIME, np.cos(TIME)]))
        there += [0, shift * style.linewidth * figure.dpi / 72]
        line.set_ydata(axes.transData.inverted().transform(there)[:, 1])
    return figure


@pytest.fixture(scope="module")
def reference(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("reference") / "fig1.png"
    save(drawing(), path)
    return path


def difference(reference: Path, figure: Figure) -> PixelDifference:
    new = reference.with_name("new.png")
    save(figure, new)
    return compare(read_pixels(reference), read_pixels(new), "fig1")


def test_the_same_drawing_is_the_same(reference: Path) -> None:
    assert difference(reference, drawing()) == PixelDifference(0.0, 1.0, None)


def test_a_curve_moved_by_three_line_widths_is_seen_twice(reference: Path) -> None:
    for shift in (3, -3):
        found = difference(reference, drawing(shift=shift))
        assert found.rms > 20 * 0.1
        assert found.similarity < 0.5


@pytest.mark.parametrize(
    "changed",
    [
        drawing(label="rate [rad/h]"),
        drawing(label="rate [nad/s]"),
        drawing(note="RMS error 0.46 %"),
        drawing(note="RMS error 0,45 %"),
    ],
    ids=["unit", "letter", "digit", "comma"],
)
def test_one_sign_of_a_label_is_seen(reference: Path, changed: Figure) -> None:
    """By the least local similarity; the mean over the page is that of a page unchanged."""
    found = difference(reference, changed)
    assert found.exceeded
    assert found.similarity < 0.9


def test_what_a_number_within_rounding_moves_is_not_seen(reference: Path) -> None:
    """A thousandth of a line width, far more than what another processor moves."""
    found = difference(reference, drawing(shift=0.001))
    assert found.rms > 0
    assert not found.exceeded


def colours_only(image: Image.Image) -> Image.Image:
    return image.convert("RGB")


def on_nothing(image: Image.Image) -> Image.Image:
    """White paper made transparent."""
    pixels = np.array(image.convert("RGBA"))
    pixels[(pixels[..., :3] == 255).all(axis=2), 3] = 0
    return Image.fromarray(pixels)


@pytest.mark.parametrize("change", [colours_only, on_nothing, Image.Image.copy])
@pytest.mark.parametrize("level", [0, 9])
def test_encoding_and_metadata_do_not_matter(
    reference: Path, change: Callable[[Image.Image], Image.Image], level: int
) -> None:
    about = PngInfo()
    about.add_text("Software", "another")
    new = reference.with_name("encoded.png")
    change(Image.open(reference)).save(new, compress_level=level, pnginfo=about, dpi=(72, 72))
    assert new.read_bytes() != reference.read_bytes()
    assert compare(read_pixels(reference), read_pixels(new), "fig1").place is None


def test_a_palette_does_not_matter(tmp_path: Path) -> None:
    grey = np.tile(np.arange(0, 250, 5, dtype=np.uint8), (20, 1))
    paths = [tmp_path / f"{mode}.png" for mode in ("L", "P", "RGBA")]
    for path in paths:
        Image.fromarray(grey).convert(path.stem).save(path)
    first, *rest = map(read_pixels, paths)
    assert all(compare(first, other, "fig1").place is None for other in rest)


def test_the_numbers_are_known_for_a_flat_picture_and_for_one_pixel() -> None:
    """SSIM of two flat pictures a, b is (2ab + C) / (a^2 + b^2 + C), C = (0.01 * 255)^2."""
    flat = np.full((60, 40, 3), 100, dtype=np.uint8)
    found = compare(flat, flat + 10, "fig1")
    constant = 2.55**2
    assert found.rms == pytest.approx(10, rel=1e-12)
    assert found.similarity <= (22000 + constant) / (22100 + constant) + 1e-12
    assert found.similarity == pytest.approx((22000 + constant) / (22100 + constant), abs=2e-3)
    one = flat.copy()
    one[41, 13, 2] = 160
    found = compare(flat, one, "fig1")
    assert found.rms == pytest.approx(60 / (60 * 40 * 3) ** 0.5, rel=1e-12)
    assert found.place is not None
    assert abs(found.place[0] - 13) <= 3
    assert abs(found.place[1] - 41) <= 3


@pytest.mark.parametrize("size", [(1, 1), (3, 50), (7, 7)])
def test_small_pictures_and_changes_at_the_edge_are_compared(size: tuple[int, int]) -> None:
    white = np.full((*size, 3), 255, dtype=np.uint8)
    black = white.copy()
    black[-1, -1] = 0
    assert compare(white, black, "fig1").similarity < 0.1


def test_the_difference_shows_where(reference: Path) -> None:
    old = read_pixels(reference)
    new = old.copy()
    new[100, 200] = 0
    shown = show_difference(old, new, (200, 100)).astype(int)
    assert shown[100, 200, 0] > shown[100, 200, 1] + 100
    red = shown[..., 0] > shown[..., 1] + 20
    assert np.argwhere(red).tolist() == [[100, 200]]


def test_a_change_of_one_colour_is_shown_in_red(reference: Path) -> None:
    old = read_pixels(reference)
    new = old.copy()
    new[100, 200, 2] ^= 255
    shown = show_difference(old, new, None).astype(int)
    assert np.argwhere(shown[..., 0] > shown[..., 1] + 100).tolist() == [[100, 200]]


@pytest.mark.parametrize(
    ("content", "said"),
    [
        (lambda whole: whole[: len(whole) // 2], "is damaged or no picture"),
        (lambda whole: b"", "is no picture"),
        (lambda whole: b"<html>", "is no picture"),
        (lambda whole: whole[:200] + b"\0" * 40 + whole[240:], "is damaged or no picture"),
    ],
)
def test_a_damaged_picture_is_named(
    reference: Path, tmp_path: Path, content: Callable[[bytes], bytes], said: str
) -> None:
    path = tmp_path / "fig1.png"
    path.write_bytes(content(reference.read_bytes()))
    with pytest.raises(InputError, match=rf"fig1\.png: {said}"):
        read_pixels(path)


def test_another_size_and_a_missing_file_are_named(reference: Path, tmp_path: Path) -> None:
    old = read_pixels(reference)
    height, width, _ = old.shape
    with pytest.raises(InputError) as caught:
        compare(old, old[:-8], "ilo fig1")
    assert str(caught.value) == (
        f"ilo fig1: has {width} x {height - 8} pixels, the reference figure has {width} x {height}"
    )
    with pytest.raises(InputError, match=r"none\.png: cannot be read"):
        read_pixels(tmp_path / "none.png")


@pytest.mark.parametrize(
    ("rms", "similarity", "exceeded"),
    [(0.09, 0.96, False), (0.11, 0.96, True), (0.09, 0.94, True), (0.11, 0.94, True)],
)
def test_one_tolerance_that_is_exceeded_is_enough(
    rms: float, similarity: float, exceeded: bool
) -> None:
    assert PixelDifference(rms, similarity, None).exceeded is exceeded
