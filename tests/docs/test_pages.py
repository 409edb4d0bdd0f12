"""Hand-written pages: their numbers agree with the build, their code runs, every page is listed."""

from __future__ import annotations

import html
import json
import re

import pytest

import reobserve
from docs.generate import api
from docs.generate.markdown import Page
from docs.generate.navigation import hand_written, navigation
from docs.generate.parts import _parts, part
from docs.outputs import PAGES, ROOT, by_hand
from reobserve.core.errors import InputError
from reobserve_papers.claims.inquiry import counted
from reobserve_papers.claims.outcomes import nested, outcome
from reobserve_papers.claims.registry import read_claims, read_registry
from reobserve_papers.claims.sample_table import read_cached
from reobserve_papers.golden.golden_claims import read_golden
from reobserve_papers.parameters.parameters import Parameters
from reobserve_papers.report.reported_claims import SIGNS
from tests import FIVE, published_numbers
from tests.test_project import LAYERS


@pytest.mark.nightly_cases("eso", "ilo", "imm")
@pytest.mark.parametrize("paper", FIVE)
def test_numbers_in_findings_agree_with_the_build(paper: str) -> None:
    text = by_hand((PAGES / f"findings/{paper}.md").read_text(encoding="utf-8"))
    reported = list(getattr(published_numbers, f"of_{paper}")())
    assert [one for one in reported if one not in published_numbers.squeezed(text)] == []
    assert published_numbers.numbers_left(text, reported) == []


@pytest.mark.parametrize("paper", FIVE)
def test_verdicts_in_findings_agree_with_the_accepted_ones(paper: str) -> None:
    """Each link to a claim shows its verdict, and the first table has the main claims alone."""
    page = (PAGES / f"findings/{paper}.md").read_text(encoding="utf-8")
    text = published_numbers.squeezed(by_hand(page))
    links = re.findall(r"\[([^\]]*)\]\([^)]*#claim-(\w+)\)", text)
    reported = {claim: word for word, claim in links}
    accepted = {claim: one["verdict"] for claim, one in read_golden(ROOT)[paper].items()}
    assert reported == {claim: accepted.get(claim) for claim in reported}
    claims = read_claims(ROOT, paper).claims.items()
    mains = {name for name, one in claims if one.promised and not one.not_testable}
    listed = re.findall(
        r'<a id="claim-(\w+)">', page.partition("**What the paper leaves open.**")[0]
    )
    assert sorted(listed) == sorted(mains)


@pytest.mark.parametrize("paper", FIVE)
def test_table_in_findings_has_each_claim_in_full(paper: str) -> None:
    """Statement and verdict."""
    text = (PAGES / f"findings/{paper}.md").read_text(encoding="utf-8")
    accepted = read_golden(ROOT)[paper]
    for name, claim in read_claims(ROOT, paper).claims.items():
        verdict = accepted[name]["verdict"]
        row = text.partition(f'<a id="claim-{name}"></a>')[2].partition("\n")[0]
        statement, shown, _ = (html.unescape(cell) for cell in row.split(" | "))
        stated = " ".join(claim.statement.split())
        assert re.sub("</?code>|`", "", statement) == stated.replace("`", "")
        assert f">{SIGNS[verdict]}</span> **{verdict}**<" in shown


@pytest.mark.parametrize("paper", FIVE)
def test_findings_have_figures_with_the_calls_that_make_them(paper: str) -> None:
    text = (PAGES / f"findings/{paper}.md").read_text(encoding="utf-8")
    shown = re.findall(
        r"!\[.+\]\(\.\./\.\./\.\./tests/reference/(\w+)/(\w+)\.png\)\n\n(.+\n.+)\n", text
    )
    assert 1 <= len(shown) == text.count("![") <= 3
    known = Parameters.load(ROOT, paper).section("figures")
    for home, figure, below in shown:
        assert home == paper
        assert figure in known
        assert f'`replicate("{paper}", "{figure}")`' in below
        assert f"`snakemake --cores 2 results/{paper}/{figure}.pdf`" in below


@pytest.mark.parametrize("paper", FIVE)
def test_findings_are_brief_beside_their_tables(paper: str) -> None:
    text = (PAGES / f"findings/{paper}.md").read_text(encoding="utf-8")
    shown = re.sub(r"<!--.*?-->|^\| (?:<a|&#91;).*$", "", text, flags=re.MULTILINE)
    assert sum(bool(re.search(r"\w", word)) for word in shown.split()) <= 900


def test_share_of_samples_is_that_of_the_cached_ones() -> None:
    text = (PAGES / "findings/lie.md").read_text(encoding="utf-8")
    samples = json.loads((ROOT / "config/samples/lie.json").read_text(encoding="utf-8"))
    kept = samples["claims"]["nonresonance_is_easy"]
    assert kept["metrics"][0] == "theory nonresonant share"
    drawn = [float(draw.split()[0]) > 0.9 for draw in kept["samples"]]
    row = text.partition('<a id="claim-nonresonance_is_easy"></a>')[2].partition("\n")[0]
    assert f" | {100 * sum(drawn) / len(drawn):.0f} % (" in row


@pytest.mark.parametrize("paper", FIVE)
def test_share_of_a_baseline_stands_beside_that_of_the_observer(paper: str) -> None:
    """Drawn over all claims with a baseline, from the samples that git holds."""
    text = (PAGES / f"findings/{paper}.md").read_text(encoding="utf-8")
    cached = read_cached(ROOT, paper).claims
    for claim in read_registry(ROOT, Parameters.load(ROOT, paper)).claims:
        if claim.null and claim.name in cached:
            kept = cached[claim.name]
            drawn = [kept.at(k) for k in range(len(kept.samples))]
            own, null = (
                counted([outcome(one, sample and nested(sample)) for sample in drawn])
                for one in (claim, claim.with_null)
            )
            row = text.partition(f'<a id="claim-{claim.name}"></a>')[2].partition("\n")[0]
            assert f"; baseline {100 * null.held / null.samples:.0f} % |" in row
            assert "no better than the baseline" in row or null.held < own.held or not null.held


def test_parts_are_on_pages_and_announced_where_the_site_has_them() -> None:
    text = "\n".join(page.read_text(encoding="utf-8") for page in PAGES.rglob("*.md"))
    announced = re.findall(r"^<!-- part: (.+) -->\n(.+)\n$", text, re.MULTILINE)
    assert len(announced) == text.count("<!-- part:")
    assert all("that `make docs` builds" in line for _, line in announced)
    printed = re.findall(r'page\.part\("(.+?)"\)', text)
    assert sorted([name for name, _ in announced] + printed) == sorted(_parts(ROOT))


def test_modules_with_pages_are_public_or_named_on_pages() -> None:
    texts = {page.path: page.text for page in api.pages(ROOT)}
    shown = [text.splitlines()[0] for text in texts.values() if text.startswith(":::")]
    modules = {line[4:].strip() for line in shown}
    assert {f"reobserve.{home}" for home in reobserve._HOME.values()} <= modules
    named = {"reobserve_papers.plants.satellite", "reobserve.estimation.specification"}
    assert named <= modules  # a link, and an import, to which no public name leads
    assert len(modules) < 90
    index = texts["reference/library/observers/index.md"]
    assert "| [`ilo`](ilo.md) |" in index
    assert "| `record` |" in index
    assert {name for name in modules if not api.is_shown(ROOT, name)} == set()
    assert api.is_shown(ROOT, "reobserve.observers.kalman.KalmanFilter.run")
    assert not api.is_shown(ROOT, "reobserve.observers.kalman.correct_mean")
    assert not api.is_shown(ROOT, "reobserve.observers.record.A")
    assert not api.is_shown(ROOT, "reobserve_papers.papers.ilo.plots")


def test_list_of_packages_is_complete_and_in_dependency_order() -> None:
    text = (PAGES / "project/index.md").read_text(encoding="utf-8")
    plan = re.findall(r"```text\n(.*?)```", text, re.DOTALL)[-1]
    listed = [line.partition("  ")[0] for line in plan.splitlines()]
    assert listed == [name for name in LAYERS[::-1] if not name.endswith("__")]


def test_listed_folders_exist() -> None:
    text = (PAGES / "project/index.md").read_text(encoding="utf-8")
    folders = re.findall(r"```text\n(.*?)```", text, re.DOTALL)[0]
    # Two columns: names and contents.
    groups = re.findall(r"(?:^|\s{2,})([\w/.]+(?:, [\w/.]+)*)  ", folders, re.M)
    named = [name for group in groups for name in group.split(", ") if "/" in name]
    assert len(named) > 5
    assert [name for name in named if not (ROOT / name).exists()] == []


def test_pages_are_ordered_with_the_index_first() -> None:
    files = ("start/b.md", "index.md", "start/index.md", "start/a.md", "start/more/index.md")
    pages = [Page(name, name, "") for name in files]
    assert navigation(pages) == [
        "index.md",
        {
            "Start": [
                "start/index.md",
                {"start/b.md": "start/b.md"},
                {"start/a.md": "start/a.md"},
                {"start/more/index.md": ["start/more/index.md"]},
            ]
        },
    ]


def test_titles_and_order_are_read() -> None:
    text = "---\ntitle: One\norder: 2\n---\n\n# Another\n"
    assert hand_written("start/a.md", text) == (Page("start/a.md", "One", text), 2.0)
    assert hand_written("start/a.md", "# `two` of them\n")[0].title == "two of them"
    with pytest.raises(InputError, match=r"start/a\.md: must have a title"):
        hand_written("start/a.md", "no heading\n")
    with pytest.raises(InputError, match="odd: is no folder of the site"):
        navigation([Page("odd/a.md", "A", "")])


def test_unknown_part_is_refused() -> None:
    with pytest.raises(InputError, match=r"'verdict': is no part of a page.*verdicts"):
        part(ROOT, "verdict")
