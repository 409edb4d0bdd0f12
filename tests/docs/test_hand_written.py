"""Hand-written pages: blocks compile, references and links resolve."""

from __future__ import annotations

import importlib
import re
import subprocess
from functools import cache
from pathlib import Path

import pytest
import yaml

from docs.generate import sources
from reobserve.cli import main as library
from reobserve_papers.cli import main as papers

from .hand_written import PAGES, ROOT, blocks, hand_written, name, prose, snippets

WIDEST = 88  # characters of a code line, beyond which a desktop scrolls

PROGRAMS = {"reobserve": library, "reobserve-papers": papers}
# Those of the library, without the papers.
LIBRARY = (
    "start/library.md", "start/coming-from.md", "reference/calls.md",
    "tutorials/recorded-data.md",
    "how-to/recorded-data.md", "how-to/tune-on-a-log.md", "how-to/export-to-c.md",
    "how-to/add-an-observer.md", "explanation/proved-and-computed.md",
)  # fmt: skip

any_page = pytest.mark.parametrize("page", sorted(PAGES.rglob("*.md")), ids=name)
# Links in these lead to files of the repository.
linking_page = pytest.mark.parametrize(
    "page",
    [ROOT / "README.md", ROOT / "CONTRIBUTING.md", *sorted(PAGES.rglob("*.md"))],
    ids=lambda page: page.relative_to(ROOT).as_posix(),
)
every_page = pytest.mark.parametrize("page", hand_written(), ids=name)


@every_page
def test_every_python_block_compiles(page: Path) -> None:
    for block in blocks(page):
        if block.language == "python":
            compile(block.text, f"{name(page)}:{block.line}", "exec")
    for snippet in snippets(page):
        compile(snippet, name(page), "exec")


@every_page
def test_code_blocks_fit_the_page_width(page: Path) -> None:
    shown = [
        line
        for block in blocks(page)
        if block.language == "python"
        for line in block.text.splitlines()
    ]
    assert [line for line in shown if len(line) > WIDEST] == []


@any_page
def test_every_reference_resolves_to_a_file_without_the_site(page: Path) -> None:
    text = prose(page)
    leading = set(re.findall(r"^\[(reobserve[\w.]*)\]: ", text, flags=re.M))
    assert set(re.findall(r"\]\[(reobserve[\w.]*)\]", text)) == leading


@every_page
def test_every_reference_names_an_object_where_it_is_defined(page: Path) -> None:
    for dotted in re.findall(r"\]\[(reobserve[\w.]*)\]", prose(page)):
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


@linking_page
def test_every_link_leads_to_a_committed_file_and_anchor(page: Path) -> None:
    for target, anchor in re.findall(r"\]\(([^)#\s]*)(?:#([^)\s]*))?\)", prose(page)):
        there = (page.parent / target).resolve() if target else page
        if target.startswith(("http", "../../actions/")):  # of the code host, on its badges
            continue
        assert there in committed(), target
        assert not anchor or anchor in anchors(there), f"{target}#{anchor}"
        if page.is_relative_to(PAGES):
            inside = (PAGES, *(ROOT / folder for folder in sources._SECTIONS))
            assert any(there.is_relative_to(folder) for folder in inside), f"{target} has no page"


@cache
def committed() -> set[Path]:
    """Tracked files that exist, and their folders."""
    listed = subprocess.run(
        ["git", "ls-files"], cwd=ROOT, capture_output=True, text=True, check=True
    ).stdout.split()
    files = {ROOT / name for name in listed if (ROOT / name).is_file()}
    return files.union(*(file.parents for file in files))


@cache
def anchors(page: Path) -> set[str]:
    """Anchors that are stated, and those that code hosts and the site derive from headings."""
    text = prose(page)
    headings = re.findall(r"^#+ (?:<a [^>]*></a>)?(.*)$", text, flags=re.M)
    return {
        *re.findall(r'<a id="([^"]*)"></a>', text),
        *(re.sub(r"[^\w\- ]", "", one.lower()).strip().replace(" ", "-") for one in headings),
    }


def test_front_matter_names_and_orders_pages() -> None:
    places: dict[Path, list[int]] = {}
    for page in hand_written():
        text = page.read_text(encoding="utf-8")
        head = yaml.safe_load(text.split("---")[1])
        assert {"title", "order"} <= set(head) <= {"title", "short", "order"}
        assert f"\n# {head['title']}\n" in text
        places.setdefault(page.parent, []).append(head["order"])
    assert all(sorted(found) == list(range(1, len(found) + 1)) for found in places.values())


def test_images_have_alternative_text() -> None:
    shown = [
        (page.parent / file, words)
        for page in PAGES.rglob("*.md")
        for words, file in re.findall(r"!\[([^\]]*)\]\(([^)]*)\)", prose(page))
    ]
    assert [file for file, words in shown if len(words) < 20] == []
    drawn = {file for file, _ in shown if file.parent.name == "pictures"}
    assert len(drawn) >= 8
    assert drawn == set(PAGES.glob("*/pictures/*"))


@every_page
def test_commands_on_pages_can_be_parsed(page: Path) -> None:
    """Commands of the project in pages, with their arguments, can be parsed."""
    for block in blocks(page):
        text = block.text.replace("\n    ", " ")  # a long line continues
        for line in text.splitlines() if block.language == "console" else ():
            command = re.sub(r"\s+#.*", "", line)
            if not command.startswith("$ reobserve") or "--help" in command:
                continue
            _, program, *words = re.split(r"\s+[<>|]\s+", command)[0].split()
            PROGRAMS[program].command_parser().parse_args(words)


@pytest.mark.parametrize("page", LIBRARY)
def test_pages_of_the_library_import_nothing_of_the_papers(page: str) -> None:
    code = [block.text for block in blocks(PAGES / page) if block.language == "python"]
    assert "reobserve_papers" not in "\n".join([*code, *snippets(PAGES / page)])
