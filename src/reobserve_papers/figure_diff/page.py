"""The page of a figure comparison, one HTML file that needs no other, and its summary."""

from __future__ import annotations

import base64
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from reobserve_papers.figure_diff import pixels
from reobserve_papers.figure_diff.build_comparison import Item
from reobserve_papers.golden.comparison import number_of
from reobserve_papers.report.content_security_policy import content_policy, inline

_OF_PAPERS = "figures, tables, theories and papers' claims"
MOST_LINES = 30  # of the summary
_MOST_MOVED = 3  # numbers of an item there
_MOST_IMAGES = 12  # figures on the page, three images each


@dataclass(frozen=True)
class _Shown:
    """An item with its images as data, empty where there is none."""

    item: Item
    reference: str
    new: str
    difference: str


def drawing(item: Item) -> str:
    """Sentence on how far the images differ."""
    if not item.rms or item.rms <= item.allowed < item.note_rms:
        return f"only the note below the panels differs, RMS {item.note_rms:.3g} grey levels"
    return f"RMS {item.rms:.3g} grey levels"


def counts(items: Sequence[Item]) -> str:
    """The number of items with each verdict."""
    totals = Counter(item.verdict for item in items)
    words = {word: word for word in ("not compared", "not up to date", "moved", "lacks samples")}
    words["agrees"] = "agree"
    return ", ".join(f"{totals[word]} {words[word]}" for word in words if totals[word]) or "nothing"


def heading(items: Sequence[Item]) -> str:
    """The number of items, and what they are."""
    papers = any(item.paper for item in items)
    return f"{len(items)} {_OF_PAPERS}" if papers else number_of(items, "file")


def summary(items: Sequence[Item], problems: Sequence[str], context: Sequence[str] = ()) -> str:
    """The counts and what does not agree, the largest change first, as a list in Markdown.

    It has `MOST_LINES` at most, so that it can stand in a pull request. ``context`` are sentences
    on what else is different.
    """
    lines = [f"{heading(items)}: {counts(items)}"]
    lines += [f"- {sentence}" for sentence in (*problems, *context)]
    lacking = [f"- {item.title}: {item.lack}" for item in items if item.lack]
    failed = [item for item in items if item.verdict not in ("agrees", "lacks samples")]
    for number, item in enumerate(failed):
        said = _said(item)
        if len(lines) + 1 + len(said) > MOST_LINES - 1 - len(lacking):
            lines.append(f"- and {len(failed) - number} more, on the page")
            break
        lines += [f"- {item.title}: {item.verdict}", *said]
    return "\n".join([*lines, *lacking])


def _said(item: Item) -> list[str]:
    drawn = [drawing(item)] if item.redrawn else []
    stale = [f"a build would make it again: {item.stale}"] if item.stale else []
    said = [*item.problems, *stale, *map(str, item.moved[:_MOST_MOVED]), *drawn]
    more = item.moved[_MOST_MOVED:]
    said += [f"and {number_of(more, 'more number')}"] * bool(more)
    return [f"    - {row}" for row in said]


def render(
    items: Sequence[Item], problems: Sequence[str], templates: Path, context: Sequence[str] = ()
) -> str:
    """The page, from the template in the folder ``templates``, with what does not agree first.

    Only the first figures that do not agree are shown, so that it stays small.
    """
    import jinja2
    from markupsafe import Markup

    environment = jinja2.Environment(
        loader=jinja2.FileSystemLoader(templates), autoescape=True,
        undefined=jinja2.StrictUndefined, trim_blocks=True, lstrip_blocks=True,
    )  # fmt: skip
    failed = [item for item in items if item.verdict != "agrees"]
    drawn = [item for item in failed if item.reference or item.new][:_MOST_IMAGES]
    shown = [_show(item) if item in drawn else _Shown(item, "", "", "") for item in failed]
    style, script = inline(templates / "figure_diff.css"), inline(templates / "figure_diff.js")
    return environment.get_template("figure_diff.html.jinja").render(
        policy=content_policy(style, script),
        style=Markup(style),
        script=Markup(script),
        heading=heading(items),
        counts=counts(items),
        problems=problems,
        context=context,
        failed=shown,
        agreeing=[item for item in items if item.verdict == "agrees"],
    )


def _show(item: Item) -> _Shown:
    difference = ""
    if (item.rms or item.note_rms) and item.reference and item.new:
        images = map(pixels.read_pixels, (item.reference, item.new))
        difference = _data(pixels.show_difference(*images))
    new = "" if item.rms == item.note_rms == 0 else _image(item.new)
    return _Shown(item, _image(item.reference), new, difference)


def _image(path: Path | None) -> str:
    return _data(path.read_bytes()) if path else ""


def _data(content: bytes) -> str:
    return f"data:image/png;base64,{base64.b64encode(content).decode()}"
