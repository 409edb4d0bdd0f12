"""All sources of the site: the pages in the repository, and those of modules."""

from __future__ import annotations

import os
import re
import shutil
from pathlib import Path

import yaml
from PIL import Image

from docs.generate import api
from docs.generate.evidence import REFERENCES
from docs.generate.navigation import hand_written, navigation

_COMMENT = re.compile(r"^<!-- \[\[\[(?:cog\b.*?|end)\]\]\] -->\n", re.MULTILINE | re.DOTALL)
_REFERENCE = re.compile(r"^\[reobserve[\w.]*\]: .*\n", re.MULTILINE)
_ANCHOR = re.compile(r'^(#+) <a id="([^"]+)"></a>(.*)$', re.MULTILINE)
_PACKAGE = re.compile(r"\]\((?:\.\./)+src/reobserve(?:_papers)?/(\w+)\)")
_IMAGE = re.compile(r"!\[[^\]]*\]\(([^)\s]+\.png)\)")

_CODE = re.compile(r"`([^`]+)`")

_DENSITY = 1.6  # pixels of an image to one of the page, as in the report


def write(root: Path, build: Path) -> None:
    """Write the sources of the site of the project at ``root`` into ``build``, emptied before.

    Raises
    ------
    InputError
        If a page has no title or no place in the navigation.
    """
    by_hand = root / "docs/pages"
    found = [
        hand_written(file.relative_to(by_hand).as_posix(), _for_the_site(file))
        for file in sorted(by_hand.rglob("*.md"))
    ]
    placed = [page for page, _ in sorted(found, key=lambda pair: pair[1])]
    pages = [*placed, *api.pages(root / "src")]
    shutil.rmtree(build, ignore_errors=True)
    shutil.copytree(by_hand, build / "docs", ignore=shutil.ignore_patterns("*.md"))
    pictures = shutil.ignore_patterns("*.json")
    shutil.copytree(root / REFERENCES, build / "docs/figures", ignore=pictures)
    for page in pages:
        path = build / "docs" / page.path
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(page.text, encoding="utf-8")
    places = {
        "INHERIT": os.path.relpath(root / "mkdocs.yml", build),
        "docs_dir": "docs",
        "site_dir": "site",
        "nav": navigation(pages),
    }
    text = yaml.safe_dump(places, allow_unicode=True, sort_keys=False, width=1000)
    (build / "mkdocs.yml").write_text(text, encoding="utf-8")


def _for_the_site(page: Path) -> str:
    """A page without code for cog; what a code host shows of it otherwise, the site has better.

    References and packages lead to pages of the site instead of files, headings have anchors of
    their own, images have a size, accepted figures are in a folder of the site, and tables are
    broken within long names.
    """
    text = _REFERENCE.sub("", _COMMENT.sub("", page.read_text(encoding="utf-8")))
    text = _PACKAGE.sub(r"](\1/index.md)", text)
    lines = (
        _CODE.sub(_broken, line) if line.startswith("|") else _ANCHOR.sub(r"\1 \3 { #\2 }", line)
        for line in text.splitlines(keepends=True)
    )
    sized = _IMAGE.sub(lambda found: _sized(page.parent, found), "".join(lines))
    return sized.replace(f"../../{REFERENCES}/", "figures/")


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
