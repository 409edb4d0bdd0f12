"""The built site: complete, without dead links and without requests to a network."""

from __future__ import annotations

import html
import json
import re
from functools import cache
from pathlib import Path
from urllib.parse import unquote, urlsplit

import pytest

import reobserve
from docs.generate.api import is_shown
from docs.generate.equations import anchor, citations
from docs.generate.evidence import papers
from reobserve.cli import main as library
from reobserve.core.errors import InputError
from reobserve_papers.cli import main as papers_command
from tests import FIVE

from .conftest import ROOT, Project, Site

# Tags for which a browser makes requests on its own.
_ASKED = re.compile(
    r"<(?:link|script|img|source|iframe|object|use|image)\b[^>]*?\s(?:href|src|srcset|data)=\"([^\"]+)"
)


def pages(site: Site) -> list[Path]:
    return sorted(site.folder.rglob("*.html"))


@cache
def anchors(page: Path) -> set[str]:
    text = page.read_text(encoding="utf-8")
    return {html.unescape(one) for one in re.findall(r'\s(?:id|name)="([^"]+)"', text)}


def test_site_build_prints_no_warnings(site: Site) -> None:
    assert [line for line in site.printed.splitlines() if "WARN" in line or "ERROR" in line] == []


def test_every_link_resolves(site: Site) -> None:
    dead = set()
    for page in pages(site):
        if page.name == "404.html":  # handled by the server
            continue
        links = set(re.findall(r'\s(?:href|src)="([^"]*)"', page.read_text(encoding="utf-8")))
        for link in links:
            parts = urlsplit(html.unescape(link))
            if parts.scheme or parts.netloc:
                continue
            target = (page.parent / unquote(parts.path)).resolve() if parts.path else page
            target = target / "index.html" if target.is_dir() else target
            known = target.is_file() and (
                not parts.fragment
                or target.suffix != ".html"
                or unquote(parts.fragment) in anchors(target)
            )
            if not known:
                dead.add((page.relative_to(site.folder).as_posix(), link))
    assert dead == set()


def test_no_page_requests_anything_from_the_network(site: Site) -> None:
    outside = {
        (page.name, asked)
        for page in pages(site)
        for asked in _ASKED.findall(page.read_text(encoding="utf-8"))
        if urlsplit(asked).netloc
    }
    assert outside == set()
    for sheet in site.folder.rglob("*.css"):
        text = sheet.read_text(encoding="utf-8")
        assert not re.search(r"@import|url\(\s*[\"']?(?:https?:)?//", text), sheet


def test_every_public_name_has_a_reference_entry(site: Site) -> None:
    listed = site.page("reference/library")
    for name in reobserve.__all__:
        home = f"reobserve.{reobserve._HOME[name]}"
        path = "/".join(home.split(".")[1:])
        page = site.folder / "reference/library" / path / "index.html"
        assert f"{home}.{name}" in anchors(page)
        assert f'{path}/#{home}.{name}"' in listed


def test_inherited_method_is_shown_in_the_subclass(site: Site) -> None:
    name = "reobserve.observers.ilo.SampledILO"
    shown = anchors(site.folder / "reference/library/observers/ilo/index.html")
    assert {f"{name}.run", f"{name}.step", f"{name}.init"} <= shown


def test_every_command_shows_its_help(site: Site) -> None:
    text = html.unescape(re.sub(r"<[^>]+>", "", site.page("reference/commands")))
    squeezed = " ".join(text.split())
    for parser in (library.command_parser(), papers_command.command_parser()):
        about = parser.format_help().split("\n\n")[1]
        assert " ".join(about.split()) in squeezed
    for command in ("reobserve estimate", "reobserve design", "reobserve-papers stage observe"):
        assert f"usage: {command}" in squeezed
        assert command.replace(" ", "-") in anchors(site.folder / "reference/commands/index.html")


@pytest.mark.parametrize("paper", FIVE)
def test_every_equation_has_a_row_with_its_code(site: Site, paper: str) -> None:
    text = site.page("reference/equations")
    found = citations(ROOT, f"reobserve_papers.papers.{paper}")
    assert found is not None
    for place, names in found.code.items():
        row = text.partition(f'id="{anchor(paper, place)}"')[2].partition("</tr>")[0]
        shown = html.unescape(re.sub(r"<[^>]+>", "", row))
        for name in names:
            assert name in shown
            assert (f'#{name}"' in row) == (is_shown(ROOT, name) and "._" not in name)


def test_report_is_on_the_site_and_findings_lead_to_it(site: Site, as_built: Project) -> None:
    built = (as_built.folder / "results/report.html").read_bytes()
    assert (site.folder / "report.html").read_bytes() == built
    text = site.page("findings/lie")
    sections = re.findall(r'href="\.\./\.\./report\.html#(\S+)"', text)
    assert {*sections} == {"lie-claims", "lie-errata", "lie-assumptions", "lie-figures"}
    assert {*sections} <= anchors(site.folder / "report.html")


def test_inconsistent_evidence_is_refused() -> None:
    (paper,) = (one for one in papers(ROOT) if one.name == "lie")
    row = paper.accepted["eigenvalues"]
    accepted = {**paper.accepted, "eigenvalues": {**row, "verdict": "contradicted"}}
    with pytest.raises(InputError, match=r"claims\.lie\.eigenvalues: .*accepted as contradicted"):
        type(paper)(ROOT, "lie", accepted, paper.seed).claims  # noqa: B018  # it is a property


def test_search_index_contains_objects_and_findings(site: Site) -> None:
    index = json.loads((site.folder / "search/search_index.json").read_text(encoding="utf-8"))
    places = {entry["location"]: entry["text"] for entry in index["docs"]}
    assert any("SampledILO" in where for where in places)
    assert "satellite" in places["findings/ilo/"].lower()
