"""Text of pages: formulas in MathML, names as links, escaped text."""

from __future__ import annotations

import html

import pytest

pytest.importorskip("markdown")

from markdown import markdown

from docs.generate.markdown import code, plain, table, ticks
from docs.mathematics import mathml

OPEN = '<math xmlns="http://www.w3.org/1998/Math/MathML">'


def test_subscript_follows_an_accented_letter() -> None:
    hat = '<mover accent="true"><mi>x</mi><mo stretchy="false">ˆ</mo></mover>'
    index = "<mrow><mi>k</mi><mo>+</mo><mn>1</mn></mrow>"
    assert mathml(r"\hat{x}_{k+1}") == f"{OPEN}<msub>{hat}{index}</msub></math>"


def test_matrix_rows_are_aligned() -> None:
    found = mathml(r"\begin{aligned} a &= b \\ c &= d \end{aligned}", block=True)
    assert found.count("<mtr>") == 2
    assert found.count("<mtd>") == 4


def test_invalid_formula_is_refused() -> None:
    with pytest.raises(
        ValueError, match=r'\$\\fooo\$ is no formula: Unknown LaTeX command "\\fooo"'
    ):
        mathml(r"\fooo")


def test_formulas_are_distinguished_from_dollars_and_code() -> None:
    text = "$x$ costs 5$ or `$y$`, not \\$z\\$.\n\n$$\nx = 1\n$$\n\nThe end."
    found = markdown(text, extensions=["docs.mathematics"])
    assert found.count("<math") == 2
    assert '<div class="formula"><math' in found
    assert 'display="block"' in found
    assert "costs 5$ or <code>$y$</code>, not $z$." in found


def test_text_is_shown_unchanged() -> None:
    odd = "a_b* c|d [e](f) <g> `h` $i$ #j &amp; \\k"
    page = table(("one", "two"), [(plain(odd), code(odd))])
    found = markdown(page, extensions=["tables", "docs.mathematics"])
    cells = [cell.split("</td>")[0] for cell in found.split("<td>")[1:]]
    assert [html.unescape(cell) for cell in cells] == [odd, f"<code>{odd}</code>"]


def test_names_in_docstrings_are_linked_except_in_code() -> None:
    pytest.importorskip("griffe")
    from docs.docstrings import with_links

    link = '<autoref optional identifier="reobserve.a.B">`reobserve.a.B`</autoref>'
    text = "As `reobserve.a.B`; ``reobserve.a``.\n\n    x = `reobserve.a.B`\n"
    section = "\nRaises\n------\nInputError\n    As `reobserve.a.B`.\n"
    assert with_links(text + section) == (
        f"As {link}; ``reobserve.a``.\n\n    x = `reobserve.a.B`\n"
        + section.replace("`reobserve.a.B`", link)
    )
    assert with_links("`reobserve_papers.a`").count("reobserve_papers.a") == 2


def test_inline_code_is_rendered() -> None:
    assert ticks("a_b *`c_d`") == "a_b &#42;`c_d`"
    assert code("a|b") == "<code>a&#124;b</code>"
