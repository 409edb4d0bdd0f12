"""Metrics of estimates, and the table that holds them."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import asdict, dataclass
from pathlib import Path

from reobserve.core.errors import InputError, shown
from reobserve.core.files import NAME, SCORE, UNIT, read_table, write_table

HEADER = ("observer", "metric", "value", "unit")
KEY = ("observer", "metric")
KINDS = {"observer": NAME, "metric": NAME, "value": SCORE, "unit": UNIT}

Level = float | int | str  # of a coordinate: a number, or a word
Score = tuple[str, float, str]  # a metric, its value and its unit, whoever's they are


def name_at(metric: str, /, **at: Level) -> str:
    """The one name of a metric at coordinates: ``ise order=4``, coordinates in alphabetic order."""
    return " ".join([metric, *(f"{name}={_spelt(at[name])}" for name in sorted(at))])


def parse_name(text: str) -> tuple[str, dict[str, Level]]:
    """The metric and its coordinates from what `name_at` gives, or what a person writes for it."""
    metric, *words = text.split() or [""]
    at: dict[str, Level] = {}
    for word in words:
        name, equals, level = word.partition("=")
        if not (name and equals and level) or name in at:
            raise InputError(
                "metric", f"{shown(text)} must be a metric, then each coordinate as NAME=LEVEL"
            )
        at[name] = _level(level)
    return metric, at


def _spelt(level: Level) -> str:
    """A level as a name has it: no more digits than it needs."""
    if isinstance(level, str):
        return level
    short = f"{level:g}"
    return short if float(short) == level else repr(float(level))


def _level(text: str) -> Level:
    try:
        return float(text)
    except ValueError:
        return text


@dataclass(frozen=True)
class Metric:
    """One number: whose, what, how much. ``nan`` where it does not exist.

    What it is called says at which coordinates it was found, if at any; see `name_at`.
    """

    observer: str
    metric: str
    value: float
    unit: str

    @classmethod
    def at(cls, observer: str, score: Score, /, **coordinates: Level) -> Metric:
        """A score found at coordinates, such as those of a study."""
        metric, value, unit = score
        return cls(observer, name_at(metric, **coordinates), value, unit)


def scores_of(observer: str, scores: Iterable[Score]) -> Iterator[Metric]:
    """The scores of one observer."""
    return (Metric(observer, *score) for score in scores)


def write_metrics(path: str | Path, metrics: Iterable[Metric]) -> None:
    """Write to CSV, or raise `InputError` if the folder cannot be written."""
    write_table(path, (asdict(metric) for metric in metrics), HEADER, seal=True)


def read_metrics(path: str | Path) -> list[Metric]:
    """Read what `write_metrics` wrote, or `InputError` if the file is another or repeats one."""
    return [
        Metric(row["observer"], row["metric"], float(row["value"]), row["unit"])
        for row in read_table(path, HEADER, KINDS, KEY)
    ]


class Numbers(dict[tuple[str, str], float]):
    """Values by (observer, metric), of which one that nobody has is refused by name."""

    def __missing__(self, key: tuple[str, str]) -> float:
        raise InputError("metrics", f"there is no {shown(key[1])} of {shown(key[0])}")

    def at(self, observer: str, metric: str, /, **coordinates: Level) -> float:
        """The value of a metric at coordinates, in whatever order they are given."""
        return self[observer, name_at(metric, **coordinates)]


def lookup(metrics: Iterable[Metric]) -> Numbers:
    """Values by (observer, metric)."""
    return Numbers({(metric.observer, metric.metric): metric.value for metric in metrics})
