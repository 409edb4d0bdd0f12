"""Pixel comparison: what it must detect and what it must ignore."""

from __future__ import annotations

import io
import struct
import zlib
from pathlib import Path

import numpy as np
import pytest
from matplotlib.figure import Figure
from PIL import Image
from scipy import ndimage

from reobserve.core.errors import InputError
from reobserve_papers.figure_diff.pixels import (
    TOLERANCE,
    compare_images,
    panel_share,
    read_pixels,
    rms_difference,
    show_difference,
)
from reobserve_papers.plotting.figures import STYLES, TRUTH, add_note, new_figure
from reobserve_papers.plotting.fitting import fix_layout
from reobserve_papers.plotting.formats import save
from tests import ROOT

TIME = np.linspace(0, 10, 400)
TALL = 8.0  # inches of a panel, for a figure taller than any accepted one
ACCEPTED = sorted((ROOT / "tests/reference").rglob("*.png"))


def drawing(label: str = "rate [rad/s]", note: str = "RMS 0.45 %", shift: float = 0) -> Figure:
    """Two curves; ``shift`` moves one of them up, in line widths."""
    figure, (axes,) = new_figure((TALL,))
    axes.plot(TIME, np.sin(TIME), **TRUTH.line(), label="truth")
    (line,) = axes.plot(TIME, np.cos(TIME), **STYLES[1].line(), label="estimate")
    axes.set_ylabel(label)
    axes.legend(loc="upper right")
    add_note(figure, note)
    fix_layout(figure)
    if shift:
        axes.set_autoscale_on(False)
        there = axes.transData.transform(np.column_stack([TIME, np.cos(TIME)]))
        there += [0, shift * STYLES[1].linewidth * figure.dpi / 72]
        line.set_ydata(axes.transData.inverted().transform(there)[:, 1])
    return figure


@pytest.fixture(scope="module")
def reference(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("reference") / "fig1.png"
    save(drawing(), path)
    return path


def difference(reference: Path, figure: Figure) -> float:
    new = reference.with_name("new.png")
    save(figure, new)
    return rms_difference(read_pixels(reference), read_pixels(new), "fig1")


def test_moved_curve_is_detected_but_rounding_is_not(reference: Path) -> None:
    assert read_pixels(reference).shape[0] > max(read_pixels(path).shape[0] for path in ACCEPTED)
    assert difference(reference, drawing()) == 0
    for shift in (3, -3):
        assert difference(reference, drawing(shift=shift)) > 20 * TOLERANCE
    assert 0 < difference(reference, drawing(shift=0.001)) < TOLERANCE  # line widths


@pytest.mark.parametrize(
    "changed",
    [{"label": "rate [rad/h]"}, {"label": "rate [nad/s]"}, {"note": "RMS 0.46 %"},
     {"note": "RMS 0,45 %"}],
)  # fmt: skip
def test_changed_sign_in_a_label_is_detected(reference: Path, changed: dict[str, str]) -> None:
    assert difference(reference, drawing(**changed)) > TOLERANCE


@pytest.mark.nightly_after(17)
@pytest.mark.parametrize("path", ACCEPTED, ids=lambda path: f"{path.parent.name}-{path.stem}")
def test_any_erased_sign_of_an_accepted_figure_is_detected(path: Path) -> None:
    """The sign with the least ink: what is on white, not connected, and of a letter's size."""
    figure = read_pixels(path)
    ink = 255.0 - figure
    signs, count = ndimage.label(ink.max(axis=2) > 0, structure=np.ones((3, 3)))
    index = np.arange(1, count + 1)
    energy = ndimage.sum_labels((ink**2).sum(axis=2), signs, index)
    dark = ndimage.maximum(ink.max(axis=2), signs, index) > 60  # grid lines and bands are light
    sizes = [[part.stop - part.start for part in box] for box in ndimage.find_objects(signs)]
    letters = dark & (np.min(sizes, axis=1) > 1) & (np.max(sizes, axis=1) <= 30)
    assert letters.sum() > 100
    erased = np.array(figure)
    erased[signs == index[letters][np.argmin(energy[letters])]] = 255
    assert rms_difference(figure, erased, "fig1") > TOLERANCE


def test_difference_of_flat_images_and_one_pixel_agrees_with_formula() -> None:
    flat = np.full((60, 40, 3), 100, dtype=np.uint8)
    assert rms_difference(flat, flat + 10, "fig1") == pytest.approx(10, rel=1e-12)
    one = flat.copy()
    one[41, 13, 2] = 160
    found = rms_difference(flat, one, "fig1")
    assert found == pytest.approx(60 / (60 * 40 * 3) ** 0.5, rel=1e-12)
    shown = np.array(Image.open(io.BytesIO(show_difference(flat, one))), dtype=int)
    assert np.argwhere(shown[..., 0] > shown[..., 1] + 20).tolist() == [[41, 13]]
    rows, columns = np.nonzero(shown[..., 2] > shown[..., 0] + 20)  # the frame
    assert (rows.min() + rows.max(), columns.min() + columns.max()) == (2 * 41, 2 * 13)


@pytest.mark.parametrize("size", [(1, 1), (3, 50), (7, 7)])
def test_small_images_and_edge_changes_are_compared(size: tuple[int, int]) -> None:
    white = np.full((*size, 3), 255, dtype=np.uint8)
    black = white.copy()
    black[-1, -1] = 0
    assert rms_difference(white, black, "fig1") == pytest.approx(255 / np.prod(size) ** 0.5)
    assert show_difference(white, black)


def test_note_is_compared_apart_from_the_panels(reference: Path) -> None:
    new = reference.with_name("noted.png")
    save(drawing(note="RMS 0.46 %"), new)
    panels, note = compare_images(reference, new, "fig1")
    assert panels == 0
    assert note > TOLERANCE
    save(drawing(shift=3), new)
    panels, note = compare_images(reference, new, "fig1")
    assert note == 0
    assert panels > TOLERANCE
    rows = read_pixels(new).shape[0]
    whole = rms_difference(read_pixels(reference), read_pixels(new), "fig1")
    assert panels**2 * round(panel_share(new) * rows) == pytest.approx(whole**2 * rows)


@pytest.mark.parametrize("start", [0, 200, 5000])
def test_damaged_image_is_named(reference: Path, tmp_path: Path, start: int) -> None:
    path = tmp_path / "fig1.png"
    whole = reference.read_bytes()
    path.write_bytes(whole[:start] + b"\0" * 40 + whole[start + 40 :])
    with pytest.raises(InputError, match=r"fig1\.png: is damaged or is no image \("):
        read_pixels(path)


def png(width: int, height: int, *rows: bytes) -> bytes:
    """A grey PNG that states this size, whatever it contains."""

    def chunk(name: bytes, content: bytes) -> bytes:
        check = zlib.crc32(name + content)
        return struct.pack(">I", len(content)) + name + content + struct.pack(">I", check)

    header = struct.pack(">IIBBBBB", width, height, 8, 0, 0, 0, 0)
    data = zlib.compress(b"".join(b"\0" + row for row in rows))
    return (
        b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", header) + chunk(b"IDAT", data) + chunk(b"IEND", b"")
    )


@pytest.mark.parametrize("size", [5_000, 12_000, 60_000, 2**31 - 1])
def test_image_too_large_to_decode_is_refused(tmp_path: Path, size: int) -> None:
    path = tmp_path / "bomb.png"
    path.write_bytes(png(size, size))
    with pytest.raises(InputError, match=r"bomb.png: (has \d+ x \d+ pixels|is damaged)") as caught:
        read_pixels(path)
    assert "\n" not in str(caught.value)


def test_small_png_is_read_and_other_content_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "small.png"
    path.write_bytes(png(3, 2, b"\0\x80\xff", b"\x10\x20\x30"))
    expected = np.array([[0, 128, 255], [16, 32, 48]])
    np.testing.assert_array_equal(read_pixels(path)[:, :, 0], expected)
    path.write_bytes(b"GIF89a" + b"\0" * 50)
    with pytest.raises(InputError, match="is no image"):
        read_pixels(path)
