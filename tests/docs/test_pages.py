"""Hand-written pages: their numbers agree with the build, their code runs, every page is listed."""

from __future__ import annotations

import re

import pytest

from docs.generate.markdown import Page
from docs.generate.navigation import hand_written, navigation
from docs.generate.parts import part
from docs.outputs import PAGES, ROOT, by_hand
from reobserve.core.errors import InputError
from reobserve_papers.claims.registry import read_claims
from reobserve_papers.golden.claims import read_golden
from tests import FIVE, published_numbers
from tests.test_project import LAYERS


@pytest.mark.parametrize("paper", FIVE)
def test_numbers_in_findings_agree_with_the_build(paper: str) -> None:
    text = by_hand((PAGES / f"findings/{paper}.md").read_text(encoding="utf-8"))
    reported = list(getattr(published_numbers, f"of_{paper}")())
    assert [one for one in reported if one not in published_numbers.squeezed(text)] == []
    assert published_numbers.numbers_left(text, reported) == []


@pytest.mark.parametrize("paper", FIVE)
def test_verdicts_in_findings_agree_with_the_accepted_ones(paper: str) -> None:
    """Each link to a claim shows its verdict, and each promised claim has a link."""
    text = by_hand((PAGES / f"findings/{paper}.md").read_text(encoding="utf-8"))
    text = published_numbers.squeezed(text)
    links = re.findall(r"\[([^\]]*)\]\([^)]*#claim-(\w+)\)", text)
    reported = {claim: word for word, claim in links}
    accepted = {claim: one["verdict"] for claim, one in read_golden(ROOT)[paper].items()}
    assert reported == {claim: accepted.get(claim) for claim in reported}
    promised = {name for name, one in read_claims(ROOT, paper).claims.items() if one.promised}
    assert promised <= set(reported)


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
