"""A report as one HTML page: templates, style and script of the workflow, put together."""

from __future__ import annotations

import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from reobserve.errors import InputError
from reobserve.evidence.report.jobs import outside_inputs
from reobserve.evidence.report.model import Claim, Entry, Gap, Image, Paper, Report
from reobserve.evidence.report.policy import content_policy, inline, without_blank_lines
from reobserve.evidence.report.verdicts import ALL_VERDICTS, counts, replicated, title_margin


def render(report: Report, templates: Path) -> str:
    """The page.

    Raises
    ------
    InputError
        If a template is missing or asks for what does not exist.
    """
    import jinja2
    from markupsafe import Markup

    environment = jinja2.Environment(
        loader=jinja2.FileSystemLoader(templates),
        autoescape=True,
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.tests.update(gap=_is_gap, image=_is_image)
    environment.filters.update(
        slug=_slug, percent=_percent, ledger_key=_ledger_key, parts=_parts, bar=_bar,
        outside=outside_inputs, ticks=_ticks, alike=_alike,
    )  # fmt: skip
    try:
        style, script = inline(templates / "report.css"), inline(templates / "report.js")
        page = environment.get_template("page.html.jinja").render(
            report=report,
            verdicts=ALL_VERDICTS,
            counts={paper.name: counts(paper.known_claims) for paper in report.papers},
            replicated={paper.name: replicated(paper.known_claims) for paper in report.papers},
            margins={paper.name: title_margin(paper.known_claims) for paper in report.papers},
            deciding={paper.name: _deciding(paper) for paper in report.papers},
            policy=content_policy(style, script),
            style=Markup(style),
            script=Markup(script),
        )
    except jinja2.TemplateNotFound as error:  # an OSError, too
        raise InputError(str(templates / str(error.name)), "cannot be read") from None
    except OSError as error:
        raise InputError(str(error.filename), f"cannot be read ({error.strerror})") from None
    except jinja2.TemplateError as error:
        raise InputError(str(templates), f"cannot be filled: {error.message}") from None
    return without_blank_lines(page).rstrip() + "\n"


def _is_gap(value: object) -> bool:
    return isinstance(value, Gap)


def _is_image(value: object) -> bool:
    return isinstance(value, Image)


def _deciding(paper: Paper) -> Mapping[str, Claim]:
    return {claim.name: claim for claim in paper.known_claims}


def _ticks(text: str) -> Any:
    """Text with what stands between backticks as code."""
    from markupsafe import Markup, escape

    return Markup(re.sub(r"`+([^`]+)`+", r"<code>\1</code>", str(escape(text))))


def _slug(verdict: str) -> str:
    return verdict.replace(" ", "-")


def _percent(share: float) -> str:
    return f"{100 * share:.0f}"


def _ledger_key(key: str, entries: tuple[Entry, ...]) -> str:
    """The first of the ledger's keys that ``key`` is, stands for or is a number of; or nothing."""
    key = re.sub(r"\{([^,}]*)[^}]*\}", r"\1", key)  # a.{b,c}.d is told of both
    known = [name for entry in entries for name in entry.keys]
    while key:
        if key in known:
            return key
        key = key.rpartition(".")[0]
    return ""


def _alike(keys: tuple[str, ...]) -> list[tuple[str, list[tuple[str, str]], str]]:
    """Keys that differ in their second part only, told once.

    Each is the first part, the second parts with their keys, and the rest; a key of fewer than
    three parts stands alone, as one second part between nothing.
    """
    groups: dict[tuple[str, str], list[tuple[str, str]]] = {}
    for key in keys:
        first, _, rest = key.partition(".")
        second, _, last = rest.partition(".")
        if last:
            groups.setdefault((f"{first}.", f".{last}"), []).append((second, key))
        else:
            groups.setdefault((key, ""), []).append((key, key))
    return [(first if last else "", found, last) for (first, last), found in groups.items()]


def _parts(text: str, figures: tuple[str, ...]) -> list[tuple[str, bool]]:
    """A text in parts; true for those that name a figure."""
    if not figures:
        return [(text, False)]
    names = "|".join(map(re.escape, figures))
    pieces = re.split(rf"(?<![\w.-])({names})(?![\w.-])", text)
    return [(piece, index % 2 == 1) for index, piece in enumerate(pieces) if piece]


def _bar(robustness: Any, width: float) -> dict[str, float]:
    """Where the marks of a bar are that is ``width`` wide."""
    places = {name: getattr(robustness, name) * width for name in ("share", "low", "high")}
    return {name: round(place, 1) for name, place in places.items()}
