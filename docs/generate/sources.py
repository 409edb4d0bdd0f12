"""All sources of the site: the pages in the repository, and those of modules."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
from pathlib import Path

import yaml
from PIL import Image

from docs.generate import api
from docs.generate.markdown import Page
from docs.generate.navigation import hand_written, navigation
from docs.generate.parts import part
from reobserve.core.errors import InputError

_COMMENT = re.compile(r"^<!-- \[\[\[(?:cog\b.*?|end)\]\]\] -->\n", re.MULTILINE | re.DOTALL)
_REFERENCE = re.compile(r"^\[reobserve[\w.]*\]: .*\n", re.MULTILINE)
_PART = re.compile(r"^<!-- part: (.+) -->\n.+\n", re.MULTILINE)
_ANCHOR = re.compile(r'^(#+) <a id="([^"]+)"></a>(.*)$', re.MULTILINE)
_IMAGE = re.compile(r"!\[[^\]]*\]\(([^)\s]+\.png)\)")
_LINK = re.compile(r'href="([^"#:]+)["#]')

# Files and folders of a paper that links lead to, and the sections of the report that show them.
_SECTIONS = {
    "config/claims": "claims",
    "config/errata": "errata",
    "config/papers": "assumptions",
    "tests/reference": "figures",
}
_EVIDENCE = re.compile(rf"\.\./\.\./({'|'.join(_SECTIONS)})/(\w+)(?:\.yaml)?(?=\))")

_CODE = re.compile(r"`([^`]+)`")

# How far up the search lists pages of a folder: those for users first.
_BOOST = {
    "start/": 4, "how-to/add-": 0.5, "how-to/": 4, "explanation/which": 4, "tutorials/": 2,
    "reference/library/": 0.002, "reference/papers/": 0.001, "reference/": 0.05,
    "findings/": 0.3, "project/": 0.3,
}  # fmt: skip

_DENSITY = 1.6  # pixels of an image to one of the page, as in the report


def write(root: Path, build: Path, report: Path) -> None:
    """Write the sources of the site of the project at ``root`` into ``build``, emptied before.

    The site has the ``report`` of a build, and the files that it links to.

    Raises
    ------
    InputError
        If a page has no title or no place in the navigation, or a file of the report is missing.
    """
    built = _with_linked(report)
    by_hand = root / "docs/pages"
    found = [
        hand_written(
            file.relative_to(by_hand).as_posix(), _for_the_site(root, file) + _edit(root, file)
        )
        for file in sorted(by_hand.rglob("*.md"))
    ]
    placed = [page for page, _ in sorted(found, key=lambda pair: pair[1])]
    pages = [*placed, *api.pages(root)]
    shutil.rmtree(build, ignore_errors=True)
    shutil.copytree(by_hand, build / "docs", ignore=shutil.ignore_patterns("*.md"))
    for file in built:
        path = build / "docs" / file.relative_to(report.parent)
        path.parent.mkdir(parents=True, exist_ok=True)
        shutil.copyfile(file, path)
    for page in pages:
        path = build / "docs" / page.path
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(_ranked(page), encoding="utf-8")
    places = {
        "INHERIT": os.path.relpath(root / "mkdocs.yml", build),
        "docs_dir": "docs",
        "site_dir": "site",
        "nav": navigation(pages),
    }
    text = yaml.safe_dump(places, allow_unicode=True, sort_keys=False, width=1000)
    (build / "mkdocs.yml").write_text(text, encoding="utf-8")


def _ranked(page: Page) -> str:
    """The text of a page, with its rank in the search in its front matter."""
    boost = next((boost for part, boost in _BOOST.items() if page.path.startswith(part)), 1)
    begun = page.text.startswith("---\n")
    _, front, text = page.text.split("---\n", 2) if begun else ("", "", page.text)
    return f"---\n{front}search: {{boost: {boost}}}\n---\n{text}"


def _with_linked(report: Path) -> list[Path]:
    """The report and the files that it links to."""
    text = report.read_text(encoding="utf-8") if report.is_file() else ""
    files = [report, *(report.parent / name for name in sorted(set(_LINK.findall(text))))]
    missing = [file for file in files if not file.is_file()]
    if missing:
        raise InputError(str(missing[0]), "is missing, run make first")
    return files


def _for_the_site(root: Path, page: Path) -> str:
    """A page with its generated parts, without code for cog and with links within the site.

    References lead to pages of the site instead of files, evidence of a paper leads to its section
    of the report, and accepted figures to the built ones. Headings have anchors of their own,
    images have a size, and tables are broken within long names.
    """
    text = _REFERENCE.sub("", _COMMENT.sub("", page.read_text(encoding="utf-8")))
    text = _PART.sub(lambda found: f"{part(root, found[1]).rstrip()}\n", text)
    text = _EVIDENCE.sub(lambda found: f"report.html#{found[2]}-{_SECTIONS[found[1]]}", text)
    report = os.path.relpath(root / "docs/pages/report.html", page.parent)
    text = text.replace("`results/report.html`", f"[`results/report.html`]({report})")
    lines = (
        _CODE.sub(_broken, line) if line.startswith("|") else _ANCHOR.sub(r"\1 \3 { #\2 }", line)
        for line in text.splitlines(keepends=True)
    )
    sized = _IMAGE.sub(lambda found: _sized(page.parent, found), "".join(lines))
    return sized.replace("../../tests/reference/", "")


def _edit(root: Path, page: Path) -> str:
    """A link to change a page where the repository is hosted, if that is known."""
    command = ["git", "config", "--get", "remote.origin.url"]
    origin = subprocess.run(command, cwd=root, capture_output=True, text=True, check=False).stdout
    host = re.fullmatch(r"(?:https://|git@)([\w.-]+)[:/](.+?)(?:\.git)?/?\n", origin)
    if host is None:
        return ""
    address = f"https://{host[1]}/{host[2]}/edit/main/{page.relative_to(root).as_posix()}"
    return f"\n[Edit this page]({address}){{ .edit }}\n"


def _broken(found: re.Match[str]) -> str:
    """Code that may be broken between its words."""
    shown = re.sub(r"[^\w\s./:-]|_", lambda mark: f"&#{ord(mark[0])};", found[1])
    breaks = r"(?:[./]|::|&#95;)(?=[a-zA-Z])"
    return f"<code>{re.sub(breaks, lambda end: f'{end[0]}<wbr>', shown)}</code>"


def _sized(folder: Path, found: re.Match[str]) -> str:
    """An image with its size, so that nothing moves when it comes."""
    with Image.open(folder / found[1]) as image:
        width, height = (round(size / _DENSITY) for size in image.size)
    return f"{found[0]}{{ .figure loading=lazy width={width} height={height} }}"
