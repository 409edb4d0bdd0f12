"""The navigation: folders in a fixed order, pages by what they say of their place."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from pathlib import PurePosixPath
from typing import Any

from docs.generate.markdown import Page
from reobserve.core.documents import parse_yaml
from reobserve.core.errors import InputError

# The tabs, by folder; a folder that has no page is left out.
FOLDERS = {
    "start": "Start",
    "tutorials": "Tutorials",
    "how-to": "How to",
    "explanation": "Explanation",
    "findings": "Findings",
    "reference": "Reference",
    "project": "Project",
}

_LAST = 1000  # of pages that say nothing of their place


def hand_written(path: str, text: str) -> tuple[Page, float]:
    """A page as it stands in its file, and its place: ``title`` and ``order`` of its front matter.

    Raises
    ------
    InputError
        If it has no title, there or as its first heading.
    """
    front: Mapping[str, Any] = {}
    found = re.match(r"---\n(.*?)\n---\n", text, re.DOTALL)
    if found:
        front = parse_yaml(found[1], path) or {}
    heading = re.search(r"^# (.+?)(?: \{.*\})?$", text, re.MULTILINE)
    title = front.get("short") or front.get("title") or (heading and heading[1])
    if not title:
        raise InputError(path, "must have a title, in its front matter or as its first heading")
    return Page(path, str(title).replace("`", ""), text), float(front.get("order", _LAST))


def navigation(pages: Iterable[Page]) -> list[Any]:
    """What mkdocs takes for ``nav``, of pages in the order in which they stand."""
    tree: dict[str, Any] = {}
    for page in pages:
        place = tree
        for part in PurePosixPath(page.path).parts[:-1]:
            place = place.setdefault(part, {})
        place[PurePosixPath(page.path).name] = page
    top = [tree.pop("index.md").path] if "index.md" in tree else []
    unknown = sorted(set(tree) - set(FOLDERS))
    if unknown:
        raise InputError(
            unknown[0], f"is no folder of the site, must be one of {', '.join(FOLDERS)}"
        )
    return [
        *top,
        *({title: _entries(tree[name])} for name, title in FOLDERS.items() if name in tree),
    ]


def _entries(tree: Mapping[str, Any]) -> list[Any]:
    """The index of a folder first, without a title of its own, and then its pages and folders."""
    first = [tree["index.md"].path] if "index.md" in tree else []
    rest: list[Any] = []
    for name, found in tree.items():
        if name == "index.md":
            continue
        if isinstance(found, Page):
            rest.append({found.title: found.path})
        else:
            index = found.get("index.md")
            rest.append({index.title if index else name: _entries(found)})
    return [*first, *rest]
