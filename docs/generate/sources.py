"""All sources of the site: the pages in the repository, and those of the library's modules."""

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
_IMAGE = re.compile(r"!\[[^\]]*\]\(([^)\s]+\.png)\)")

_DENSITY = 1.6  # pixels of a picture to one of the page, as in the report


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
    pages = [*placed, *api.pages(root / "src/reobserve")]
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

    References lead to pages of the library instead of files, headings have anchors of their own,
    images have a size, and accepted figures are in a folder of the site.
    """

    def sized(found: re.Match[str]) -> str:
        with Image.open(page.parent / found[1]) as image:
            width, height = (round(size / _DENSITY) for size in image.size)
        return f"{found[0]}{{ .figure loading=lazy width={width} height={height} }}"

    text = _COMMENT.sub("", page.read_text(encoding="utf-8"))
    text = _ANCHOR.sub(r"\1 \3 { #\2 }", _REFERENCE.sub("", text))
    return _IMAGE.sub(sized, text).replace(f"../../{REFERENCES}/", "figures/")
