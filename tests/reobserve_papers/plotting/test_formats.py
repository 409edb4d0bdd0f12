"""Formats: the width of the style, embedded fonts, no loss, reproducible bytes."""

from __future__ import annotations

import io
import re
import time
from pathlib import Path

import numpy as np
import pytest
from fontTools.ttLib import TTFont
from matplotlib.figure import Figure
from PIL import Image
from pypdf import PdfReader

from reobserve.core.errors import InputError
from reobserve_papers.plotting.figures import STYLES, PaperFigure, add_note, new_figure
from reobserve_papers.plotting.fitting import fix_layout
from reobserve_papers.plotting.formats import save
from reobserve_papers.plotting.style_sheet import use_sheet
from tests import ROOT

SHEETS = ROOT / "config" / "styles"
SIDES = ("width", "height")
FORMATS = ("pdf", "svg", "png", "eps", "pgf")
WIDTHS = {"default": 6.6 * 72, "ieee-column": 3.5 * 72, "elsevier-column": 90 / 25.4 * 72}


def drawing() -> PaperFigure:
    """Letters of all kinds, a transparent band, a logarithmic axis."""
    figure, (axes,) = new_figure((2.0,))
    axes.plot([1, 2, 3], [1, 20, 300], **STYLES[1].points(), label="Γ τ K₁, 5 % & x̂₁ − x₁")
    axes.fill_between([1, 2, 3], 1, [2, 30, 400], color="#c4500a", alpha=0.2, linewidth=0)
    axes.set_yscale("log")
    axes.set_ylabel("rate [rad/s]")
    axes.set_title("(∂S/∂x)⁻¹ in #1_a")
    axes.legend()
    add_note(figure, "Chosen here: a note of the kind that stands below a figure, ℓ(y) = (-2 y).")
    return figure


def saved(folder: Path, kind: str, figure: Figure | None = None) -> bytes:
    if figure is None:
        figure = drawing()
        fix_layout(figure)
    path = folder / f"figure.{kind}"
    save(figure, path)
    return path.read_bytes()


def page(kind: str, content: bytes) -> tuple[float, float]:
    """Width and height in points."""
    if kind == "pdf":
        box = PdfReader(io.BytesIO(content)).pages[0].mediabox
        return float(box.width), float(box.height)
    if kind == "png":
        with Image.open(io.BytesIO(content)) as image:
            wide, high = image.size
            return wide / image.info["dpi"][0] * 72, high / image.info["dpi"][1] * 72
    text = content.decode()
    patterns = {
        "eps": r"%%HiResBoundingBox: 0\.0* 0\.0* ([\d.]+) ([\d.]+)",
        "pgf": r"\\pgfqpoint\{([\d.]+)in\}\{([\d.]+)in\}",
    }
    if kind == "svg":
        wide, high = (re.search(rf'<svg [^>]*\b{side}="([\d.]+)pt"', text) for side in SIDES)
        assert wide
        assert high
        return float(wide[1]), float(high[1])
    found = re.search(patterns[kind], text)
    assert found
    inch = 72 if kind == "pgf" else 1
    return float(found[1]) * inch, float(found[2]) * inch


@pytest.mark.nightly
@pytest.mark.parametrize("style", WIDTHS)
def test_every_format_has_the_width_of_the_style(tmp_path: Path, style: str) -> None:
    use_sheet(SHEETS / f"{style}.mplstyle")
    figure = drawing()
    fix_layout(figure)
    for kind in FORMATS:
        wide, high = page(kind, saved(tmp_path, kind, figure))
        assert wide == pytest.approx(WIDTHS[style], abs=0.5), kind
        assert high == pytest.approx(72 * figure.get_figheight(), abs=0.5), kind


@pytest.mark.nightly_after(2)
@pytest.mark.parametrize("kind", FORMATS)
def test_files_are_reproducible_without_date_or_folder(tmp_path: Path, kind: str) -> None:
    content = saved(tmp_path, kind)
    time.sleep(1.1)
    assert saved(tmp_path, kind) == content
    assert b"Date" not in content
    assert str(tmp_path).encode() not in content


@pytest.mark.parametrize("style", ["default", "ieee-column"])
def test_pdf_fonts_are_embedded_as_journals_require(tmp_path: Path, style: str) -> None:
    use_sheet(SHEETS / f"{style}.mplstyle")
    resources = PdfReader(io.BytesIO(saved(tmp_path, "pdf"))).pages[0]["/Resources"]
    fonts = [font.get_object() for font in resources["/Font"].values()]
    assert fonts
    names = set()
    for font in fonts:
        assert font["/Subtype"] in ("/Type0", "/TrueType")  # none of type 3
        inner = font["/DescendantFonts"][0].get_object() if "/DescendantFonts" in font else font
        descriptor = inner["/FontDescriptor"].get_object()
        tables = TTFont(io.BytesIO(descriptor["/FontFile2"].get_object().get_data())).keys()
        assert "glyf" in tables
        names.add(str(font["/BaseFont"]).partition("+")[2])
    family = "DejaVuSans" if style == "default" else "STIXGeneral"
    assert any(name.startswith(family) for name in names)


def test_eps_fonts_are_embedded(tmp_path: Path) -> None:
    content = saved(tmp_path, "eps").decode("latin-1")
    used = set(re.findall(r"^/(\S+) [\d.]+ selectfont", content, re.MULTILINE))
    assert used
    assert used <= set(re.findall(r"/FontName /(\S+) def", content))
    assert "/FontType 3" not in content
    assert set(re.findall(r"/FontType (\d+)", content)) == {"42"}


def test_eps_bands_have_the_colour_of_transparent_ones(tmp_path: Path) -> None:
    """#c4500a at 0.2 on white is 0.2 c + 0.8; the figure itself is unchanged."""
    figure = drawing()
    fix_layout(figure)
    before = saved(tmp_path, "png", figure)
    content = saved(tmp_path, "eps", figure).decode("latin-1")
    light = [0.2 * part / 255 + 0.8 for part in (0xC4, 0x50, 0x0A)]
    colors = re.findall(r"^([\d.]+) ([\d.]+) ([\d.]+) setrgbcolor", content, re.MULTILINE)
    assert any(np.allclose([*map(float, color)], light, atol=1e-3) for color in colors)
    assert saved(tmp_path, "png", figure) == before


def test_pgf_text_is_latex_in_the_document_font(tmp_path: Path) -> None:
    content = saved(tmp_path, "pgf").decode("ascii")
    texts = re.findall(r"\\pgftext\[.*\]\{.*def%\{\\%\}(.*)\}\}%$", content, re.MULTILINE)
    assert r"\ensuremath{\Gamma} \ensuremath{\tau} K\textsubscript{1}, 5 \% \& " in "".join(texts)
    assert r"(\ensuremath{\partial}S/\ensuremath{\partial}x)\textsuperscript{-1} in \#1\_a" in texts
    assert r"$\mathrm{10^{2}}$" in texts
    assert "setmainfont" not in content


def test_image_in_a_pgf_is_refused(tmp_path: Path) -> None:
    figure, (axes,) = new_figure((2.0,))
    axes.imshow([[0, 1], [1, 0]])
    fix_layout(figure)
    with pytest.raises(InputError, match=r"figure\.pgf: cannot hold an image"):
        saved(tmp_path, "pgf", figure)
    assert list(tmp_path.iterdir()) == []
