"""The page as HTML: complete, safe, with valid links, and reproducible."""

from __future__ import annotations

import re
import shutil
from html import unescape
from html.parser import HTMLParser
from pathlib import Path

import pytest

from reobserve.core.errors import InputError
from reobserve_papers.claims.verdict_rules import DEPENDS, REPRODUCED
from reobserve_papers.report import report_command
from reobserve_papers.report.gather import gather
from reobserve_papers.report.render import alike, parts, render
from reobserve_papers.report.reported_claims import SIGNS

from .project import BROKEN, CLAIMS, write_claims

PAGE = "results/report.html"


class Outline(HTMLParser):
    """The links, link targets and headings of a page, and the resources it loads."""

    def __init__(self) -> None:
        super().__init__()
        self.ids: list[str] = []
        self.links: list[str] = []
        self.headings: list[int] = []
        self.sources: list[str] = []
        self.unnamed: list[str] = []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        found = dict(attrs)
        self.ids += [found["id"]] if "id" in found else []
        self.links += [found["href"]] if "href" in found else []
        self.sources += [found["src"]] if "src" in found else []
        self.headings += [int(tag[1])] if re.fullmatch(r"h\d", tag) else []
        if tag == "img" and not found.get("alt") and "src" in found:
            self.unnamed.append(str(found))


def page_of(folder: Path) -> str:
    report_command(folder, folder / PAGE)
    return (folder / PAGE).read_text(encoding="utf-8")


def outline(page: str) -> Outline:
    parser = Outline()
    parser.feed(page)
    return parser


def test_page_contains_everything(project: Path, capsys: pytest.CaptureFixture[str]) -> None:
    page = page_of(project)
    text = unescape(re.sub(r"[ \n]+", " ", page))
    for reported in (
        "One paper on observers, replicated", "[Re?]", "No gaps:", "A lag and its disturbance",
        "(a) The estimate errs by 0.1 %.", "Both poles are in one place.", "Depends on",
        "Held in 30 of 40 samples: 75\xa0%, confidence interval 60 to 86\xa0%.",
        "The bound was set after its numbers were known.",
        "late_rms_error / fig1 slow late_rms_error below any number.",
        "1 of 1 are certain:", "Which choices separate the outcomes of claims", "undecided",
        "[Re?], 1 of 2 main claims reproduced, 0 contradicted.",
        "[¬Re]: A tenth is <less>. <code>placed_is_better</code> is then contradicted (1 of 40, "
        "30 of 40 as stated).", "4 are ties; the opposite holds in 3.",
        "3 diverged or were refused. 2 more are no case", "With the baseline it holds in 2",
        "38 were computed earlier and are cached in <code>config/samples</code>; the others were",
        "40 were computed earlier and are cached in <code>config/samples</code>.</p>",
        "Readings that change it", "A tenth is <less>. It is then contradicted (1 of 40).",
        "A setting at which it holds: the parameter file.",
        '<td class="held">holds with gains (observer slow) above 2 in 9 of 9, up to it in 2; base',
        "<p>Holds with gains (observer slow) above 2 in 9 of 9, up to it in 2, in the half of",
        *(f'aria-hidden="true">{SIGNS[word]}</span>{word}<' for word in (REPRODUCED, DEPENDS)),
        "There is no laboratory here.", "The gains of one observer are not given.",
        "0.5 to 5 each", "l₂ = 15.9", "It is the square of the pole, which is 4.",
        "slow poles, late: 390 mrad/s, ours 400 mrad/s", "none: a photograph", "numpy",
        "4 printed, 1 assumed",
        "As <code>chosen</code>.",
    ):  # fmt: skip
        assert reported in text, reported
    assert "It is &lt;script&gt;alert(1)&lt;/script&gt; tuned." in page, "text stays text"
    assert page.count("<script>") == 1
    assert capsys.readouterr().out == f"{project / PAGE}: no gaps\n"


@pytest.mark.parametrize("gaps", [False, True])
def test_links_have_targets_and_headings_are_ordered(project: Path, gaps: bool) -> None:
    if gaps:
        write_claims(project, [*CLAIMS, BROKEN])
        for name in ("results/toy/fig1.svg", "results/toy/fig1.caption.rst"):
            (project / name).unlink()
        (project / "config/errata/toy.yaml").write_text("errata: []")
    found = outline(page_of(project))
    assert len(found.ids) == len(set(found.ids))
    inside = {link[1:] for link in found.links if link.startswith("#")}
    assert inside <= set(found.ids)
    files = [link for link in found.links if not re.match(r"#|data:|https://doi\.org/", link)]
    assert all((project / "results" / file).is_file() for file in files)
    assert all(b <= a + 1 for a, b in zip(found.headings, found.headings[1:], strict=False))
    assert found.headings.count(1) == 1
    assert all(source.startswith("data:image/") for source in found.sources)
    assert found.unnamed == []


def test_claims_and_figures_link_to_each_other(project: Path) -> None:
    page = page_of(project)
    claim = page.partition('id="toy-claim-placed_is_better"')[2].partition("</article>")[0]
    assert '<a href="#toy-fig1">fig1</a> slow late_rms_error' in claim
    assert claim.count('href="#toy-key-observers.slow.gains"') == 1
    figure = page.partition('id="toy-fig1"')[2].partition("</article>")[0]
    assert 'href="#toy-claim-placed_is_better"' in figure
    entry = page.partition('id="toy-key-observers.slow.gains"')[2].partition("</tr>")[0]
    assert 'href="#toy-claim-placed_is_better"' in entry


def test_gaps_are_counted_at_the_top_and_shown_in_place(
    project: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    write_claims(project, [*CLAIMS, BROKEN])
    (project / "results/toy/fig1.svg").unlink()
    page = page_of(project)
    assert "2 gaps in this page" in page
    for number, sentence in ((1, BROKEN["problem"]), (2, "results/toy/fig1.svg: not built")):
        listed, placed = (
            unescape(page).find(sentence, at) for at in (0, page.find('<h2 id="toy"'))
        )
        assert 0 < listed < placed
        assert f'<a href="#gap-{number}">Gap {number}</a>' in page
    assert "2 gaps\n" in capsys.readouterr().out


def test_pages_of_two_builds_differ_only_in_the_environment(
    project: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    first = page_of(project)
    monkeypatch.setattr("platform.python_version", lambda: "9.9.9")
    second = page_of(project)
    assert first != second
    pattern = r"<!-- measured: begin -->.*<!-- measured: end -->"
    assert re.sub(pattern, "", first, flags=re.S) == re.sub(pattern, "", second, flags=re.S)
    assert page_of(project) == second


def test_links_are_relative_to_the_page(project: Path) -> None:
    elsewhere = project / "pages" / "out" / "page.html"
    report_command(project, elsewhere)
    assert 'href="../../results/toy/fig1.svg"' in elsewhere.read_text()


def test_keys_differing_in_one_part_are_listed_once() -> None:
    assert alike(("a.x.k", "b", "a.y.k", "a.x.m", "c.d")) == [
        ("a.", [("x", "a.x.k"), ("y", "a.y.k")], ".k"), ("", [("b", "b")], ""),
        ("a.", [("x", "a.x.m")], ".m"), ("", [("c.d", "c.d")], ""),
    ]  # fmt: skip


def test_figure_names_are_found_in_text() -> None:
    assert parts("fig1 over fig1_forms, fig12", ("fig1", "fig1_forms")) == [
        ("fig1", True), (" over ", False), ("fig1_forms", True), (", fig12", False),
    ]  # fmt: skip


@pytest.mark.parametrize(
    ("name", "text", "said"),
    [
        ("report.css", None, "report.css: cannot be read"),
        ("claims.html.jinja", None, "claims.html.jinja: cannot be read"),
        (
            "claims.html.jinja",
            "{{ paper.verdict }}",
            "cannot be filled: .* has no attribute 'verdict'",
        ),
        ("claims.html.jinja", "{% if %}", "cannot be filled"),
    ],
)
def test_invalid_template_is_named(
    project: Path, tmp_path: Path, name: str, text: str | None, said: str
) -> None:
    folder = tmp_path / "templates"
    shutil.copytree(project / "workflow/report/replication", folder)
    (folder / name).unlink()
    if text is not None:
        (folder / name).write_text(text)
    report = gather(project, project / PAGE)
    with pytest.raises(InputError, match=said):
        render(report, folder)
    assert not (project / PAGE).exists()
