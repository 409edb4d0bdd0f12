"""Captions: a template of the workflow, filled from the ledger and the metrics of the figure."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

from reobserve.errors import InputError
from reobserve.plain_data.files import read_text
from reobserve.scoring.metrics import Metric, lookup


def render(template: Path, settings: Mapping[str, Any], metrics: Iterable[Metric]) -> str:
    """The caption in reStructuredText.

    Templates see the branches of the settings by name, ``value(observer, metric)``, with the
    coordinates of a number in a study by name (``order=4``), and the filters ``digits``
    (significant ones), ``percent`` and ``milli``. Titles, labels and all other text of the
    settings is text: it is shown as it stands, whatever it would mean as markup.

    Raises
    ------
    InputError
        If the template is missing, is no template or asks for what does not exist.
    """
    import jinja2

    # Templates may import from others of the workflow, by their path below its report folder.
    environment = jinja2.Environment(
        loader=jinja2.FileSystemLoader([template.parent, template.parent.parent]),
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
    )
    environment.filters.update(digits=_digits, percent=_percent, milli=_milli)
    text = read_text(template)
    try:
        rendered = environment.from_string(text).render(
            **_literal(dict(settings)), value=lookup(metrics).at
        )
    except InputError as error:
        raise InputError(str(template), f"asks for a metric: {error.problem}") from None
    except jinja2.TemplateError as error:
        raise InputError(str(template), f"cannot be filled: {error.message}") from None
    paragraphs = [" ".join(paragraph.split()) for paragraph in rendered.split("\n\n")]
    return "\n\n".join(paragraph for paragraph in paragraphs if paragraph) + "\n"


def with_note(caption: str, note: str) -> str:
    """A caption and, as its last paragraph, the note that is left out of the figure."""
    return f"{caption}\n{_Literal(note)}\n" if note else caption


class _Literal(str):
    """Text that compares as it is, and is written so that reStructuredText shows it as it is."""

    __slots__ = ()

    def __str__(self) -> str:
        return _MARKUP.sub(r"\\\g<0>", " ".join(self.split()))


# Beside these nothing within a line is markup; an underscore is only at the end of a word.
_MARKUP = re.compile(r"[\\*`|]|_(?![A-Za-z0-9])")


def _literal(value: Any) -> Any:
    """Settings whose texts are literal, those that are names of branches among them."""
    if isinstance(value, str):
        return _Literal(value)
    if isinstance(value, Mapping):
        return {_literal(key): _literal(entry) for key, entry in value.items()}
    if isinstance(value, list | tuple):
        return [_literal(entry) for entry in value]
    return value


def _digits(number: float, count: int = 2) -> str:
    return f"{float(f'{number:.{count}g}'):g}"


def _percent(number: float, count: int = 2) -> str:
    # No share needs more than six places: 1e-54 % is nothing.
    return f"{round(float(f'{100 * number:.{count}g}'), 6):g} %"


def _milli(number: float, count: int = 2) -> str:
    return f"{1000 * number:.{count}g}"
