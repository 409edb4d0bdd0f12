"""The report as one HTML page: templates, style and script of the workflow, filled."""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from reobserve.core.errors import InputError
from reobserve.core.files import write_text
from reobserve_papers.claims.verdict_rules import BROKEN, VERDICTS, then
from reobserve_papers.parameters.config import known_tasks, refuse_unknown
from reobserve_papers.parameters.names import shared_texts
from reobserve_papers.report.content_security_policy import content_policy, inline
from reobserve_papers.report.gather import gather
from reobserve_papers.report.report_gaps import Gap
from reobserve_papers.report.reported_claims import SIGNS
from reobserve_papers.steps.freshness import check_code


def report_command(
    project: Path,
    output: Path,
    papers: Sequence[str] | None = None,
    formats: Sequence[str] | None = None,
    bench: Sequence[str] | None = None,
    *,
    fresh: bool = False,
) -> None:
    """Write the page, with every gap shown in its place, and print how many there are.

    ``papers``, ``formats`` and ``bench`` are what was built, if other than `config/config.yaml`
    says. What a build would make again is marked, unless all is known to be ``fresh``.
    """
    check_code(project)
    refuse_unknown("--bench", bench or (), known_tasks(project))
    report = gather(project, output, papers, formats, bench, fresh=fresh)
    write_text(output, render(report, shared_texts(project) / "replication"))
    count = len(report["gaps"])
    print(f"{output}: {'no gaps' if not count else '1 gap' if count == 1 else f'{count} gaps'}")
    for gap in report["gaps"]:
        print(f"  {gap.sentence}")


def render(report: dict[str, Any], templates: Path) -> str:
    """Fill the templates with what `gather` found."""
    import jinja2
    from markupsafe import Markup

    environment = jinja2.Environment(
        loader=jinja2.FileSystemLoader(templates),
        autoescape=True,
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.tests["gap"] = lambda value: isinstance(value, Gap)
    environment.filters.update(
        parameter_key=parameter_key, parts=parts, ticks=_ticks, alike=alike, then=then
    )
    try:
        style, script = inline(templates / "report.css"), inline(templates / "report.js")
        return environment.get_template("page.html.jinja").render(
            report=report,
            verdicts=(*VERDICTS, BROKEN),
            signs=SIGNS,
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


def _ticks(text: str) -> Any:
    """Text with what stands between backticks as code."""
    from markupsafe import Markup, escape

    return Markup(re.sub(r"`+([^`]+)`+", r"<code>\1</code>", str(escape(text))))


def parameter_key(key: str, known: Sequence[str]) -> str:
    """Return the first of the ``known`` keys that ``key`` is or is a number of, or nothing."""
    key = re.sub(r"\{([^,}]*)[^}]*\}", r"\1", key)  # a.{b,c}.d stands for both
    while key and key not in known:
        key = key.rpartition(".")[0]
    return key


def alike(keys: Sequence[str]) -> list[tuple[str, list[tuple[str, str]], str]]:
    """Group keys that differ in their second part only.

    Each group is the first part, the second parts with their keys, and the rest; a key of fewer
    than three parts stands alone, as one second part between nothing.
    """
    groups: dict[tuple[str, str], list[tuple[str, str]]] = {}
    for key in keys:
        first, _, rest = key.partition(".")
        second, _, last = rest.partition(".")
        if last:
            groups.setdefault((f"{first}.", f".{last}"), []).append((second, key))
        else:
            groups.setdefault((key, ""), []).append((key, key))
    return [(first if last else "", members, last) for (first, last), members in groups.items()]


def parts(text: str, figures: Sequence[str]) -> list[tuple[str, bool]]:
    """Split a text, with True for the parts that name a figure."""
    names = "|".join(map(re.escape, figures))
    pieces = re.split(rf"(?<![\w.-])({names})(?![\w.-])", text)
    return [(piece, index % 2 == 1) for index, piece in enumerate(pieces) if piece]
