"""Pages show what their code prints and plots now; how the code is run, compared and copied."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from docs import outputs
from docs.generate import sources
from docs.outputs import by_hand, renewed, with_outputs
from reobserve.core.errors import InputError
from reobserve_papers.figure_diff.pixels import TOLERANCE, read_pixels, rms_difference

from .hand_written import name, snippets

_NUMBER = re.compile(r"(?:(?<![\w)])[-+])?\d+(?:\.\d+)?(?:e[-+]?\d+)?")


def unit(number: str) -> float:
    """One unit of the last printed digit."""
    digits, _, exponent = number.partition("e")
    return 10.0 ** (int(exponent or 0) - len(digits.partition(".")[2]))


def changed(stored: str, found: str) -> list[tuple[str, str]]:
    """Pairs of differing lines, except for one unit of a last digit, which depends on the
    processor.
    """

    def same(one: str, other: str) -> bool:
        if " ".join(_NUMBER.sub("#", one).split()) != " ".join(_NUMBER.sub("#", other).split()):
            return False
        pairs = zip(_NUMBER.findall(one), _NUMBER.findall(other), strict=True)
        return all(abs(float(a) - float(b)) <= 1.001 * max(unit(a), unit(b)) for a, b in pairs)

    lines, others = stored.splitlines(), found.splitlines()
    if len(lines) != len(others):
        return [(f"{len(lines)} lines", f"{len(others)} lines")]
    return [pair for pair in zip(lines, others, strict=True) if not same(*pair)]


def runs(page: Path) -> bool:
    """Whether it computes; if not, its parts are taken from the repository."""
    return any(re.search(r"page\.(run|show)\(|console\.", code) for code in snippets(page))


@pytest.mark.nightly_cases("findings/imm.md", "findings/eso.md")
@pytest.mark.parametrize(
    "page",
    [
        pytest.param(page, id=name(page), marks=[pytest.mark.nightly] if runs(page) else [])
        for page in with_outputs()
    ],
)
def test_page_shows_what_its_code_prints_and_plots(page: Path, tmp_path: Path) -> None:
    found = renewed(page, tmp_path)
    assert changed(page.read_text(encoding="utf-8"), found) == [], "make pages renews it"
    for drawn in tmp_path.iterdir():
        pixels = (read_pixels(path) for path in (page.parent / "pictures" / drawn.name, drawn))
        assert rms_difference(*pixels, drawn.name) <= TOLERANCE, "make pages draws it again"


def test_numbers_may_differ_by_one_in_the_last_digit() -> None:
    assert changed("a 1.20 of 3e-05", "a  1.21 of 4e-05") == []
    assert changed("9.99 m", "10.00 m") == []
    assert changed("at -0.00 V", "at 0.01 V") == []
    assert changed("a 1.20", "a 1.22") == [("a 1.20", "a 1.22")]
    assert changed("a 3e-05", "a 5e-05") == [("a 3e-05", "a 5e-05")]
    assert changed("12 rows", "14 rows") == [("12 rows", "14 rows")]
    assert changed("one", "two") == [("one", "two")]
    assert changed("one", "one\ntwo") == [("1 lines", "2 lines")]


PAGE = """\
# A page

```python
x = [[[2.0]]]
print("x is", x[0][0][0])
```

<!-- [[[cog page.run() ]]] -->
<!-- [[[end]]] -->

```python title="not run"
x = 0
```

```python
x = 3
```

<!-- [[[cog
page.run()
print(f"Now $x$ is {x}, see [`a`][reobserve.core.errors.InputError].")
]]] -->
what was printed before
<!-- [[[end]]] -->

<!-- [[[cog page.references() ]]] -->
<!-- [[[end]]] -->
"""


def test_code_runs_once_in_order_and_its_output_follows(tmp_path: Path) -> None:
    page = tmp_path / "page.md"
    page.write_text(PAGE)
    text = renewed(page)
    assert "]]] -->\n\n```text\nx is 2.0\n```\n\n<!-- [[[end" in text
    assert "\n\nNow $x$ is 3, see [`a`][reobserve.core.errors.InputError].\n" in text
    (file,) = re.findall(r"^\[reobserve.core.errors.InputError\]: (.*)$", text, re.MULTILINE)
    assert (tmp_path / file).resolve() == outputs.ROOT / "src/reobserve/core/errors.py"
    assert "what was printed before" not in text
    page.write_text(text)
    assert renewed(page) == text
    assert by_hand(text) == by_hand(PAGE)
    assert "x is 2.0" not in by_hand(text)


def test_error_names_the_line_of_the_page(tmp_path: Path) -> None:
    page = tmp_path / "page.md"
    page.write_text(PAGE.replace("x = 3", "x = 1 / 0"))
    with pytest.raises(outputs.CogError, match=r"page\.md.*line 16[\s\S]*ZeroDivisionError"):
        renewed(page)


def test_site_has_parts_and_links_of_its_own(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    page = tmp_path / "docs/pages/findings/page.md"
    page.parent.mkdir(parents=True)
    page.write_text(
        '## <a id="claim-a"></a>One\n\n<!-- [[[cog page.run() ]]] -->\n\nText\n\n'
        "<!-- [[[end]]] -->\n<!-- [[[cog\nprint()\n]]] -->\n"
        "[reobserve.a.B]: ../a.py\n[c]: d.md\n<!-- [[[end]]] -->\n"
        "[full](../../../tests/reference/ilo/fig1.png)\n\n| `a.b_c|d` | `e f` |\n"
        "<!-- part: names -->\n`make docs` has them here.\n\n"
        "[6](../../../config/errata/ilo.yaml), [all](../../../tests/reference/ilo), "
        "`results/report.html`\n"
    )
    monkeypatch.setattr(sources, "part", lambda _, name: f"| all {name} |\n")
    assert sources._for_the_site(tmp_path, page) == (
        "## One { #claim-a }\n\n\nText\n\n[c]: d.md\n[full](../ilo/fig1.png)\n\n"
        "| <code>a.<wbr>b&#95;<wbr>c&#124;d</code> | <code>e f</code> |\n| all names |\n\n"
        "[6](../report.html#ilo-errata), [all](../report.html#ilo-figures), "
        "[`results/report.html`](../report.html)\n"
    )


def test_site_without_a_built_report_is_refused(tmp_path: Path) -> None:
    report = tmp_path / "report.html"
    with pytest.raises(InputError, match=r"report\.html: is missing, run make first"):
        sources.write(outputs.ROOT, tmp_path / "build", report)
    report.write_text('<a href="#top"><a href="https://a.b"><a href="ilo/fig1.pdf">')
    with pytest.raises(InputError, match=r"ilo/fig1\.pdf: is missing, run make first"):
        sources.write(outputs.ROOT, tmp_path / "build", report)
    assert not (tmp_path / "build").exists()
