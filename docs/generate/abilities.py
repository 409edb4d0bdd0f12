"""What each public observer can do, read from its class and the families, and why not."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import cache
from typing import Any, NamedTuple, get_args, get_type_hints

import reobserve
from docs.generate.markdown import code, plain, table, ticks
from reobserve.estimation.families import FAMILIES, family
from reobserve.observers.contract import Observer

Kind = type[Observer[Any]]


class Ability(NamedTuple):
    """A column: its title, what it means, and whether an observer has it."""

    title: str
    means: str
    known: Callable[[Kind], bool]


def observers() -> dict[str, Kind]:
    """The public observers by name."""
    public = {name: getattr(reobserve, name) for name in reobserve.__all__}
    return {
        name: found
        for name, found in public.items()
        if isinstance(found, type) and issubclass(found, Observer)
    }


def exporting(kind: Kind) -> list[str]:
    """The families with a program of an observer for export."""
    return [name for name in FAMILIES if kind in family(name).programs]


@cache
def families(kind: Kind) -> tuple[str, ...]:
    """The families that make an observer."""
    return tuple(name for name in FAMILIES if kind in family(name).programs or kind in _made(name))


def _made(name: str) -> tuple[Any, ...]:
    """The observers of a family, as its property says."""
    declared: Any = family(name).observer
    hint = get_type_hints(declared.func if hasattr(declared, "func") else declared.fget)["return"]
    return get_args(hint) or (hint,)


def _units(kind: Any) -> Mapping[str, str]:
    """The units of all estimates, which the class of a public observer holds."""
    found: Mapping[str, str] = kind.units
    return found


ABILITIES = {
    "nan": Ability(
        "nan", "a nan in `y` is a measurement that is missing", lambda kind: kind.reads_missing
    ),
    "noise": Ability(
        "noise by row", "`run(..., Q=, R=)`: covariances of this record, or of each row",
        lambda kind: {"Q", "R"} <= {*kind.takes},
    ),
    "model": Ability(
        "model by row", "`run(..., A=, B=, ...)` of linear models, `parameters=` of nonlinear ones",
        lambda kind: bool({"A", "parameters"} & {*kind.takes}),
    ),
    "uneven": Ability(
        "uneven times", "`run(..., time=)`: rows any time apart, of models with a density of the "
        "noise, without `noise_memory`",
        lambda kind: kind.reads_missing and kind.__name__ not in REASONS["uneven"],
    ),
    "smoother": Ability(
        "smoother", "`rts_smoother(run)`: each row from the whole record",
        lambda kind: getattr(kind, "has_kalman_gain", False),
    ),
    "covariance": Ability(
        "covariance", '`run["covariance"]` and `run["variance"]`',
        lambda kind: "covariance" in _units(kind),
    ),
    "predicted": Ability(
        "predicted state", '`run(..., keep=["predicted_state"])`: before it is corrected',
        lambda kind: "predicted_state" in getattr(kind, "keeps", ()),
    ),
    "gain": Ability(
        "gain", '`run(..., keep=["gain"])`: in each row',
        lambda kind: "gain" in getattr(kind, "keeps", ()),
    ),
    "names": Ability(
        "names", '`run["state_speed"]`, where the model names its signals',
        lambda kind: kind.component_names is not Observer.component_names,
    ),
    "bank": Ability(
        "bank", "a filter of an `IMM`",
        lambda kind: hasattr(kind, "predict") and hasattr(kind, "correct"),
    ),
    "batch": Ability(
        "many records", "`y` of shape (records, k, m), each bitwise as if run alone",
        lambda kind: True,
    ),
    "specification": Ability(
        "specification", "the kinds of `reobserve design` and `reobserve estimate`",
        lambda kind: bool(families(kind)),
    ),
    "C": Ability("C", "`reobserve export`", lambda kind: bool(exporting(kind))),
}  # fmt: skip

# Why an observer lacks an ability: by the name of its class, or of a base of it; else as most do.
MOST = ""
REASONS: Mapping[str, Mapping[str, str]] = {
    "nan": {
        MOST: "Its steps need a value in each row; `reobserve estimate` fills gaps, as `missing` "
        "says.",
    },
    "noise": {
        MOST: "Its gains do not follow from covariances of noise.",
        "FaultBank": "It takes R alone; the models of its modes have Q.",
        "GridFilter": "It takes R alone; the models of its modes have Q.",
    },
    "model": {
        MOST: "Its gains, and the proofs for them, belong to one model.",
        "LevantDifferentiator": "It has no model.",
        "FaultBank": "Its filters are made once, from the models of their modes.",
        "GridFilter": "Its filters are made once, from the models of their modes.",
    },
    "uneven": {
        MOST: "Its gains, and the proofs for them, belong to one sampling period.",
        "AugmentedKalmanFilter": "The random walk of its unknown inputs is per sample.",
        "FaultBank": "Its transition probabilities are per sample.",
        "GridFilter": "Its transition probabilities are per sample.",
    },
    "smoother": {
        MOST: "It has no covariance.",
        "IMM": "Its smoother is another algorithm; smooth the filter of one mode.",
        "GaussianFilter": "The smoother needs the gain of minimum variance.",
    },
    "covariance": {MOST: "It has no model of noise, but bounds or poles of its error."},
    "predicted": {
        MOST: "It makes no prediction apart from its correction.",
        "IMM": "Each of its filters has its own.",
    },
    "gain": {
        MOST: "It has the gains with which it was constructed.",
        "IMM": "Each of its filters has its own.",
    },
    "names": {MOST: "Its model does not name signals; a specification does."},
    "bank": {
        MOST: "A bank mixes means and covariances: its filters have `predict` and `correct`.",
        "IMM": "It is the bank.",
    },
    "specification": {MOST: "No kind makes it yet; it is called in Python."},
    "C": {MOST: "No kind has a program for it yet."},
}


def reason(ability: str, kind: Kind) -> str:
    """Why an observer lacks an ability."""
    among = REASONS[ability]
    return next((among[one.__name__] for one in kind.__mro__ if one.__name__ in among), among[MOST])


# The tables, each no wider than a page.
_TABLES = {
    "What a call takes": ("nan", "noise", "model", "uneven", "bank", "batch"),
    "What a run returns": ("covariance", "predicted", "gain", "names", "smoother"),
    "Without a program in Python": ("specification", "C"),
}


def abilities() -> str:
    """A table for each group of abilities, what its columns mean, and the reasons of its gaps."""
    return "\n".join(_table(title, names) for title, names in _TABLES.items())


def _table(title: str, names: tuple[str, ...]) -> str:
    """A row for all observers with the same abilities, what the columns mean, and the reasons."""
    marks: dict[str, str] = {}
    rows: dict[tuple[str, ...], list[str]] = {}
    for observer, kind in observers().items():
        link = f"[`{observer}`][{kind.__module__}.{observer}]"
        rows.setdefault(tuple(_cell(name, kind, marks) for name in names), []).append(link)
    shown = [(", ".join(links), *cells) for cells, links in rows.items()]
    columns = [ABILITIES[name] for name in names]
    means = "".join(f"- *{plain(one.title)}*: {ticks(one.means)}\n" for one in columns)
    why = "".join(f"- *{mark}*: {ticks(text)}\n" for text, mark in marks.items())
    titles = ("observers", *(one.title for one in columns))
    return f"## {title}\n\n{table(titles, shown)}\n{means}{why}"


def _cell(ability: str, kind: Kind, marks: dict[str, str]) -> str:
    """The kinds or a yes, or the letter of the reason."""
    if not ABILITIES[ability].known(kind):
        mark = chr(ord("a") + len(marks))
        return f"*{marks.setdefault(reason(ability, kind), mark)}*"
    return ", ".join(map(code, families(kind))) if ability == "specification" else "yes"
