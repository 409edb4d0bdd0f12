"""Captions in LaTeX, read back by a LaTeX parser."""

from __future__ import annotations

import unicodedata

import pytest
from pylatexenc.latex2text import LatexNodes2Text

from reobserve.core.errors import InputError
from reobserve_papers.plotting.captions import with_note
from reobserve_papers.plotting.latex_captions import caption_in_latex

CAPTION = """\
**A fault of 5 % & more** (Fig. 3), scenario ``a_b``. RMS error of *x̂₁* is 1.2e-07 at ρ = 3. More.

Never \\*bold\\*, by #1 {of} ~2^3 \\\\ $4; see `the page <https://example.org/a_b>`_.

- one
- two
"""


def read_back(text: str) -> str:
    """The text that LaTeX would print, on one line, without sub- and superscripts."""
    known = text.replace(r"\texttt", "")  # which the parser omits together with its argument
    printed = LatexNodes2Text(keep_comments=False).latex_to_text(known)
    return " ".join(unicodedata.normalize("NFKC", printed).split())


def test_latex_caption_has_the_text_of_the_caption() -> None:
    text = caption_in_latex("c.rst", CAPTION)
    assert text.startswith(r"\caption[A fault of 5 \% \& more (Fig. 3), scenario a\_b.]{%")
    assert r"\textbf{A fault of 5 \% \& more} (Fig. 3), scenario \texttt{a\_b}. RMS" in text
    assert r"\emph{\ensuremath{\hat{x}}\textsubscript{1}}" in text
    assert r"by \#1 \{of\} {\textasciitilde}2{\textasciicircum}3 {\textbackslash} \$4" in text
    assert r"see the page." in text.replace("{the page}", "the page")
    assert text.count(r"\par") == 3  # LaTeX allows no blank line in a caption
    assert "\n\n" not in text
    body = text.partition("{%\n")[2].removesuffix("%\n}\n")
    reported = read_back(body.replace(r"\par", " "))
    for words in ("A fault of 5 % & more", "a_b", "ρ = 3", "Never *bold*, by #1 {of}", "$4"):
        assert words in reported, words


def test_braces_and_brackets_are_balanced() -> None:
    odd = "} \\] { [ \\\\ % comment\\? ^ ~ & # $ _x"
    text = caption_in_latex("c.rst", with_note("**One [1]** (Fig. 1). Two.\n", odd))
    depth = 0
    escaped = False
    for letter in text:
        if not escaped:
            depth += {"{": 1, "}": -1}.get(letter, 0)
        escaped = letter == "\\" and not escaped
        assert depth >= 0
    assert depth == 0
    assert read_back(text.rpartition(r"\par")[2].strip().removesuffix("%\n}")).startswith(
        "} \\] { ["
    )


def test_note_is_the_unchanged_last_paragraph() -> None:
    text = with_note("**Title** (Fig. 1). One.\n", "ρ_a = 5 *here*.")
    assert text == "**Title** (Fig. 1). One.\n\nρ_a = 5 \\*here\\*.\n"
    assert with_note("One.\n", "") == "One.\n"


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("**never closed", "c.rst: is no reStructuredText"),
        (".. image:: x.png", "c.rst: holds a image; a caption has paragraphs"),
        (
            "An :math:`x`.",
            "c.rst: holds a math; a caption has paragraphs, lists, emphasis and links",
        ),
    ],
)
def test_invalid_caption_is_refused(text: str, said: str) -> None:
    with pytest.raises(InputError, match=said):
        caption_in_latex("c.rst", text)
