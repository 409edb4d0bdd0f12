"""Captions: templates of the workflow, filled from the parameters and the metrics of a figure."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

from reobserve.core.errors import InputError
from reobserve.core.files import read_text
from reobserve_papers.metrics.metrics import Metric, lookup


def render(template: Path, settings: Mapping[str, Any], metrics: Iterable[Metric]) -> str:
    """The caption in reStructuredText.

    Templates see the branches of the settings by name, ``value(observer, metric)``, with the
    coordinates of a number in a study by name (``order=4``), and the filters ``digits``
    (significant ones), ``percent`` and ``milli``. Titles, labels and all other text of the
    settings is text: it is shown as it stands, whatever it would mean as markup.
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


# Nothing of the machine, no other file and no raw markup gets into a page by a caption.
SETTINGS = {
    "_disable_config": True,
    "file_insertion_enabled": False,
    "raw_enabled": False,
    "warning_stream": False,
    "halt_level": 2,
    "initial_header_level": 5,
    "smart_quotes": False,
}

# What a caption may be made of. No directive and no role makes anything else of text: no image,
# no other file, no class or name that the page has given.
_ALLOWED = {
    *("document", "paragraph", "Text", "emphasis", "strong", "literal", "subscript"),
    *("superscript", "title_reference", "bullet_list", "enumerated_list", "list_item"),
    *("block_quote", "definition_list", "definition_list_item", "term", "definition"),
    *("literal_block", "line_block", "line", "reference", "target", "comment"),
}


def parse(path: str, text: str) -> Any:
    """Return the docutils document of a caption in reStructuredText, without classes and names."""
    from docutils import nodes
    from docutils.core import publish_doctree
    from docutils.utils import SystemMessage

    try:
        document = publish_doctree(text, settings_overrides=SETTINGS)
    except SystemMessage as error:
        reason = str(error).removeprefix("<string>:")
        raise InputError(path, f"is no reStructuredText (line {reason})") from None
    for node in list(document.findall()):
        kind = type(node).__name__
        if kind not in _ALLOWED:
            raise InputError(
                path, f"holds a {kind}; a caption has paragraphs, lists, emphasis and links"
            )
        if isinstance(node, nodes.Element):
            node["classes"], node["ids"] = [], []  # those of the page are the page's
        if isinstance(node, nodes.target):
            node.parent.remove(node)
    return document


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
    # No share needs more than six places.
    shown = round(float(f"{100 * number:.{count}g}"), 6)
    return "< 0.000001 %" if number and not shown else f"{shown:g} %"


def _milli(number: float, count: int = 2) -> str:
    return f"{1000 * number:.{count}g}"
