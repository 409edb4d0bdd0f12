"""A specification of `reobserve estimate` whose numbers change, and the records that it reads."""

from __future__ import annotations

from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from reobserve.core.documents import parse_yaml
from reobserve.core.errors import InputError, nearest, shown
from reobserve.core.files import read_text
from reobserve.estimation.data_report import DataReport
from reobserve.estimation.dialect import Dialect
from reobserve.estimation.estimate import Estimation
from reobserve.estimation.families.file import naming
from reobserve.estimation.layout import Layout
from reobserve.estimation.observer_design import Design
from reobserve.estimation.record_file import File
from reobserve.estimation.specification import as_specification, read_specification
from reobserve.tuning.search import Settings
from reobserve.tuning.task import Array


class TunedSpecification:
    """The specification in a file, and numbers in it by dotted key, as ``observer.Q.1``."""

    def __init__(self, path: Path) -> None:
        self.path, self.stated = path, read_specification(path)
        self.period = self.stated.sampling.period
        self._text = read_text(path)
        self._reports: dict[Path, DataReport] = {}
        self._places: dict[str, tuple[int, int]] = {}
        self.header = cache(lambda record: self.file(record).header())
        self.cells = cache(self._cells)

    def number(self, key: str) -> float:
        """The number at a key, or `InputError` if there is none."""
        import yaml

        node: Any = yaml.compose(self._text, yaml.SafeLoader)
        steps = key.split(".")
        if steps[0] == "observer" and "observer" not in {name.value for name, _ in node.value}:
            steps = steps[1:]  # its keys stand at the top
        for step in steps:
            parts: dict[str, Any] = {}
            if isinstance(node, yaml.MappingNode):
                parts = {name.value: part for name, part in node.value}
            elif isinstance(node, yaml.SequenceNode):
                parts = {str(place): part for place, part in enumerate(node.value)}
            if step not in parts:
                problem = f"there is no {shown(step)} in {self.path}{nearest(step, parts)}"
                raise InputError(key, problem)
            node = parts[step]
        self._places[key] = start, end = node.start_mark.index, node.end_mark.index
        if self._text[start] == "&":
            raise InputError(key, f"has an anchor in {self.path}; write the number out")
        value = parse_yaml(self._text[start:end], str(self.path))
        if isinstance(value, bool) or not isinstance(value, int | float):
            raise InputError(key, f"is {shown(value)} in {self.path}, must be a number")
        return float(value)

    def text(self, settings: Settings) -> str:
        """The text of the file with other numbers, all else as it is."""
        text = self._text
        for key in sorted(settings, key=lambda key: self._places[key], reverse=True):
            start, end = self._places[key]
            text = f"{text[:start]}{settings[key]!r}{text[end:]}"
        return text

    def estimation(self, settings: Settings, record: Path) -> Estimation:
        """The estimation that runs the observer with other numbers over a record, no alarms."""
        tree = {**parse_yaml(self.text(settings), str(self.path)), "alarms": []}
        with naming(self.path):
            return Estimation(as_specification(tree), self.header(record), str(record))

    def design(self, settings: Settings) -> Design:
        """The observer with other numbers."""
        tree = parse_yaml(self.text(settings), str(self.path))
        with naming(self.path):
            design: Design = as_specification(tree).observer.design(self.period)
            return design

    def rows(self, record: Path, *more: str) -> tuple[Layout, Array, Array, Array]:
        """The layout of a record: its times, what the observer reads, and columns besides."""
        layout = self.estimation({}, record).layout
        cells, width = self.cells(record, *more), len(layout.titles)
        with self.file(record).lines():
            time, values = layout.values(cells[:, :width], DataReport())
            layout.fill(values, DataReport())
        if not layout.timed:
            time = self.period * np.arange(len(cells), dtype=np.float64)
        return layout, time, values, cells[:, width:]

    def seconds(self, place: str, when: float | str, record: Path) -> float:
        """The time [s] of a record, as `rows` has it, that is stated as a number or a date.

        Raises
        ------
        InputError
            If it is no date, at ``place``, or the record has none.
        """
        if not isinstance(when, str):
            return when
        layout = self.estimation({}, record).layout
        if layout.clock is None or layout.clock.dates is None:
            raise InputError(place, f"{shown(when)} must be seconds, as {record} has no dates")
        self.cells(record)
        return layout.clock.dates.at(place, when, self._reports[record])

    def file(self, record: Path) -> File:
        """A record as the specification reads it."""
        return File(record, Dialect.of(self.stated))

    def _cells(self, record: Path, *more: str) -> Array:
        layout = self.estimation({}, record).layout
        wanted = [*layout.titles, *more]
        titles = list(dict.fromkeys(wanted))
        report = DataReport()
        blocks = list(self.file(record).blocks(titles, layout.clock, report))
        if not blocks:
            raise InputError(str(record), "has no rows")
        cells = np.concatenate(blocks)
        self._reports[record] = report
        if layout.clock is not None:  # as segments have it
            cells[:, 0] += layout.clock.epoch(report)
        return cells[:, [titles.index(title) for title in wanted]]
