"""Pixel comparison: what it must detect and what it must ignore."""

from __future__ import annotations

import io
from pathlib import Path

import numpy as np
import pytest
from matplotlib.figure import Figure
from PIL import Image

from reobserve.core.errors import InputError
from reobserve.plotting.figures import STYLES, TRUTH, add_note, new_figure
from reobserve.plotting.fitting import fix_layout
from reobserve.plotting.formats import save
from reobserve.replication.figure_diff.pixels import (
    PixelDifference,
    compare,
    read_pixels,
    show_difference,
)

TIME = np.linspace(0, 10, 400)


def drawing(label: str = "rate [rad/s]", note: str = "RMS 0.45 %", shift: float = 0) -> Figure:
    """Two curves; ``shift`` moves one of them up, in line widths."""
    figure, (axes,) = new_figure((2.0,))
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


def difference(reference: Path, figure: Figure) -> PixelDifference:
    new = reference.with_name("new.png")
    save(figure, new)
    return compare(read_pixels(reference), read_pixels(new), "fig1")


def test_moved_curve_is_detected_but_rounding_is_not(reference: Path) -> None:
    assert difference(reference, drawing()) == PixelDifference(0.0, 1.0, None)
    for shift in (3, -3):
        found = difference(reference, drawing(shift=shift))
        assert found.rms > 20 * 0.1
        assert found.similarity < 0.5
    found = difference(reference, drawing(shift=0.001))  # line widths
    assert found.rms > 0
    assert not found.exceeded
    numbers = [(0.09, 0.96), (0.11, 0.96), (0.09, 0.94)]
    assert [PixelDifference(*two, None).exceeded for two in numbers] == [False, True, True]


@pytest.mark.parametrize(
    "changed",
    [{"label": "rate [rad/h]"}, {"label": "rate [nad/s]"}, {"note": "RMS 0.46 %"},
     {"note": "RMS 0,45 %"}],
)  # fmt: skip
def test_changed_sign_in_a_label_is_detected(reference: Path, changed: dict[str, str]) -> None:
    found = difference(reference, drawing(**changed))
    assert found.exceeded
    assert found.similarity < 0.9


def test_similarity_of_flat_images_and_one_pixel_agrees_with_formula() -> None:
    """SSIM of two flat pictures a, b is (2ab + C) / (a^2 + b^2 + C), C = (0.01 * 255)^2."""
    flat = np.full((60, 40, 3), 100, dtype=np.uint8)
    found = compare(flat, flat + 10, "fig1")
    assert found.rms == pytest.approx(10, rel=1e-12)
    assert found.similarity == pytest.approx((22000 + 2.55**2) / (22100 + 2.55**2), abs=2e-3)
    one = flat.copy()
    one[41, 13, 2] = 160
    found = compare(flat, one, "fig1")
    assert found.rms == pytest.approx(60 / (60 * 40 * 3) ** 0.5, rel=1e-12)
    assert found.place is not None
    assert max(abs(found.place[0] - 13), abs(found.place[1] - 41)) <= 3
    shown = np.array(Image.open(io.BytesIO(show_difference(flat, one, None))), dtype=int)
    assert np.argwhere(shown[..., 0] > shown[..., 1] + 20).tolist() == [[41, 13]]


@pytest.mark.parametrize("size", [(1, 1), (3, 50), (7, 7)])
def test_small_images_and_edge_changes_are_compared(size: tuple[int, int]) -> None:
    white = np.full((*size, 3), 255, dtype=np.uint8)
    black = white.copy()
    black[-1, -1] = 0
    assert compare(white, black, "fig1").similarity < 0.1


@pytest.mark.parametrize("start", [0, 200, 5000])
def test_damaged_image_is_named(reference: Path, tmp_path: Path, start: int) -> None:
    path = tmp_path / "fig1.png"
    whole = reference.read_bytes()
    path.write_bytes(whole[:start] + b"\0" * 40 + whole[start + 40 :])
    with pytest.raises(InputError, match=r"fig1\.png: is damaged or is no picture \("):
        read_pixels(path)
