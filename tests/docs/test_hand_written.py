"""What the hand-written pages say: blocks compile, references and links lead somewhere."""

from __future__ import annotations

import importlib
import re
from pathlib import Path

import pytest
import yaml

from reobserve.cli.main import command_parser

from .hand_written import GENERATED, PAGES, blocks, everything, hand_written, name, prose

WIDEST = 88  # letters of a line of code, beyond which it is scrolled on a desktop

every_page = pytest.mark.parametrize("page", hand_written(), ids=name)


@every_page
def test_every_python_block_compiles(page: Path) -> None:
    for block in blocks(page):
        if block.language == "python":
            compile(block.text, f"{name(page)}:{block.line}", "exec")


@every_page
def test_sessions_are_named_by_their_page(page: Path) -> None:
    sessions = {
        found
        for block in blocks(page)
        if block.executed and block.language == "python"
        for found in re.findall(r'session="([^"]*)"', block.options)
    }
    runs = [block for block in blocks(page) if block.executed]
    assert all('session="' in block.options for block in runs)
    assert len(sessions) <= 1
    for other in hand_written():
        if other != page:
            assert not any(f'session="{one}"' in other.read_text() for one in sessions)


@every_page
def test_code_that_is_shown_is_not_wider_than_a_page(page: Path) -> None:
    shown = [
        line
        for block in blocks(page)
        if block.language == "python" and (not block.executed or "source=" in block.options)
        for line in block.text.splitlines()
    ]
    assert [line for line in shown if len(line) > WIDEST] == []


@every_page
def test_every_reference_is_an_object_where_it_is_defined(page: Path) -> None:
    for dotted in re.findall(r"\]\[(reobserve[\w.]*)\]", everything(page)):
        parts = dotted.split(".")
        for length in range(len(parts), 0, -1):
            try:
                found = importlib.import_module(".".join(parts[:length]))
            except ModuleNotFoundError:
                continue
            break
        home = ".".join(parts[:length])
        for part in parts[length:]:
            found = getattr(found, part)
        if parts[length:]:
            assert found.__module__ == home, f"{dotted} is defined in {found.__module__}"


@every_page
def test_every_link_leads_to_a_page(page: Path) -> None:
    text = everything(page)
    for target in re.findall(r"\]\(([^)#\s]*)(?:#[^)]*)?\)", text):
        if not target:
            continue
        there = (page.parent / target).resolve()
        assert there.is_relative_to(PAGES.resolve()), f"{target} leaves the site"
        called = there.relative_to(PAGES.resolve()).as_posix()
        assert there.is_file() or any(one.fullmatch(called) for one in GENERATED), target


@every_page
def test_links_within_a_page_lead_to_its_headings(page: Path) -> None:
    text = prose(page)
    headings = {
        re.sub(r"[^\w\- ]", "", heading.lower()).strip().replace(" ", "-")
        for heading in re.findall(r"^#+ (.*)$", text, flags=re.M)
    }
    assert set(re.findall(r"\]\(#([^)]*)\)", text)) <= headings


def test_front_matter_names_and_orders_pages() -> None:
    places: dict[Path, list[int]] = {}
    for page in hand_written():
        text = page.read_text(encoding="utf-8")
        head = yaml.safe_load(text.split("---")[1])
        assert {"title", "order"} <= set(head) <= {"title", "short", "order"}
        assert f"\n# {head['title']}\n" in text
        places.setdefault(page.parent, []).append(head["order"])
    assert all(sorted(found) == list(range(1, len(found) + 1)) for found in places.values())


def test_pictures_have_words_for_those_who_do_not_see_them() -> None:
    shown = [block for page in hand_written() for block in blocks(page) if "show(\n" in block.text]
    assert len(shown) >= 8
    assert all("alt=" in block.text and "caption=" in block.text for block in shown)
    assert all("print(show(" not in block.text or 'html="1"' in block.options for block in shown)


@every_page
def test_commands_are_commands(page: Path) -> None:
    """What a page tells to type is parsed, if it is a command of the project with arguments."""
    for block in blocks(page):
        for line in block.text.splitlines() if block.language == "console" else ():
            command = re.sub(r"\s+#.*", "", line)
            if not command.startswith("$ reobserve") or "--help" in command:
                continue
            words = re.split(r"\s+[<>|]\s+", command)[0].split()[2:]
            command_parser().parse_args(words)
