"""The section `file` of a specification: which lines are rows, and what cells may hold."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Annotated, Any, Literal

from reobserve.core.errors import InputError, shown
from reobserve.core.validation import as_stated, checked, items, within

# What pandas and pyarrow take for missing values, and what no number is spelled like.
NOTHING = (
    "", "nan", "NaN", "NAN", "-nan", "-NaN", "NA", "N/A", "n/a", "#N/A", "#NA", "<NA>", "null",
    "NULL", "None", "-", "1.#IND", "-1.#IND", "1.#QNAN", "-1.#QNAN",
)  # fmt: skip

Delimiter = Literal[",", ";", "\t", "|", "whitespace"]
Decimal = Literal[".", ","]
Thousands = Literal["", ".", ",", "'", "’", " ", "\u00a0", "\u202f"]
Encoding = Literal["utf-8", "cp1252", "latin-1", "utf-16"]


def _printable(place: str, value: str) -> None:
    if len(value) > 200 or not value.isprintable() or value != value.strip():
        problem = f"{shown(value)} must be text that can be printed, without blanks around it"
        raise InputError(place, problem)


def _choice(place: str, value: Any) -> None:
    texts = value["not"] if isinstance(value, dict) and value.keys() == {"not"} else value
    listed = texts if isinstance(texts, list) else [texts]
    if not listed or not all(isinstance(text, str) for text in listed):
        problem = f"{shown(value)} must be a text (a number in quotes), a list of texts, or not: "
        raise InputError(place, f"{problem}and one of these")


Text = Annotated[str, checked(_printable)]


@dataclass(frozen=True)
class FileFormat:
    """The lines of a text that are no rows, and the texts in cells that are no numbers.

    Without any key, the first line is the header, and all lines below it are rows; blank ones are
    left out, and so are ``skip`` lines above the header and all that begin with ``comment``, of
    which the last one may be the header. ``names`` may be "" for columns that nobody reads. The
    lines ``below_header`` are ``units``, which are read as units in titles are, or lines to
    ``skip``. ``missing_values`` are compared with whole cells.

    A last line without a line end may have been truncated within a number. It is read, and refused
    where that cannot be done. With ``tail: drop`` it is left out, and so is a last line, with or
    without an end, that is no row.

    ``where`` takes rows of Parquet files, too: by the name of a column, a text that its cell must
    be, a list of which it must be one, or either under ``not``. All columns must be as stated.
    """

    skip: Annotated[int, within(0, 100_000)] = 0
    comment: Text = ""
    header: Literal["first", "commented"] = "first"
    names: Annotated[tuple[Text, ...], items(0)] = ()
    below_header: Annotated[tuple[Literal["units", "skip"], ...], items(0, 100)] = ()
    repeated_header: Literal["refuse", "skip"] = "refuse"
    missing_values: Annotated[tuple[Text, ...], items(0, 100)] = ()
    tail: Literal["refuse", "drop"] = "refuse"
    where: dict[str, Annotated[Any, as_stated(_choice)]] = field(default_factory=dict)

    def __post_init__(self) -> None:
        if self.header == "commented" and not self.comment:
            raise InputError("comment", "is missing; a header that is a comment begins with it")
        if self.below_header.count("units") > 1:
            raise InputError("below_header", "states units twice, must state them once")
        if self.names and not any(self.names):
            raise InputError("names", "are all empty, must name the columns that are read")
        for key, default in (
            ("header", "first"),
            ("below_header", ()),
            ("repeated_header", "refuse"),
        ):
            if self.names and getattr(self, key) != default:
                problem = "must be left out where names take the place of a header"
                raise InputError(key, problem)
