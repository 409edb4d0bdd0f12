"""The columns of what was estimated: their names and units, and how they are read from a run."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from reobserve.core.errors import InputError, nearest, shown
from reobserve.estimation.families.signals import product
from reobserve.estimation.layout import Layout
from reobserve.estimation.observer_design import Design
from reobserve.estimation.quantities import SAME, Conversion, conversion

Array = NDArray[np.float64]


class Output(NamedTuple):
    """A column: the component at ``place`` of an estimate, or its standard deviation."""

    name: str
    unit: str
    estimate: str
    place: int
    deviation: bool = False
    conversion: Conversion = SAME

    @property
    def title(self) -> str:
        """The title as the header has it."""
        return f"{self.name} [{self.unit}]" if self.unit else self.name


RESIDUAL = "residual"


@dataclass(frozen=True)
class Outputs:
    """Columns that are written of each row, in order.

    ``places`` are those of the columns among the ``sources`` (estimates, flattened) and then the
    residual, one behind the other. Of ``deviations`` the root is taken.
    """

    design: Design
    columns: tuple[Output, ...]
    sources: tuple[str, ...]
    places: list[int]
    deviations: list[int]
    converted: list[tuple[int, Conversion]]

    def deviation_of(self, column: int) -> int | None:
        """The place of the standard deviation of a column, None if there is none."""
        follows = column + 1 < len(self.columns) and self.columns[column + 1].deviation
        return column + 1 if follows else None

    def numbers(self, y: Array, estimates: Mapping[str, Array]) -> Array:
        """The columns' values, shape (k, columns)."""
        parts = [estimates[name].reshape(len(y), -1) for name in self.sources]
        parts.append(self.design.residual(y, estimates))
        values: Array = np.concatenate(parts, axis=1)[:, self.places]
        with np.errstate(invalid="ignore"):  # a variance below zero has no root
            values[:, self.deviations] = np.sqrt(values[:, self.deviations])
        for column, way in self.converted:
            values[:, column] = way.of(values[:, column])
        return values

    def row(self, y: Array, estimates: Mapping[str, Array]) -> list[float]:
        """The same numbers for one row, shape (1, p), where each microsecond counts."""
        flat: list[float] = []
        for name in self.sources:
            flat += estimates[name].ravel().tolist()
        flat += self.design.residual(y, estimates)[0].tolist()
        values = [flat[place] for place in self.places]
        for column in self.deviations:
            values[column] = math.sqrt(values[column]) if values[column] >= 0.0 else math.nan
        for column, way in self.converted:
            values[column] = way.of(values[column])
        return values


def outputs(
    design: Design,
    layout: Layout,
    sample: Mapping[str, Array],
    named: Mapping[str, Mapping[str, str]],
) -> Outputs:
    """The columns for an observer, from a ``sample`` of its estimates and the names ``named``."""
    written = {
        name: sample[name] for name in sample
        if name in design.estimates and name not in design.left_out
    }  # fmt: skip
    for name in named:
        if name not in written:
            raise InputError(
                f"estimates.{name}", f"there is no such estimate{nearest(name, written)}"
            )
    columns: list[Output] = []
    for name, values in written.items():
        size = 1 if values.ndim == 1 else values.shape[1]
        labels, units, asked = _called(name, design, layout, named.get(name))
        for place in range(size):
            way = SAME
            if units[place] and asked[place]:
                at = f"estimates.{name}.{labels[place]}"
                way = conversion(at, units[place], asked[place])
            unit = asked[place] or units[place]
            columns.append(Output(labels[place], unit, name, place, False, way))
            if name in design.sigmas:
                label = f"{labels[place]} sigma"
                columns.append(Output(label, unit, name, place, True, Conversion(way.factor, 0.0)))
    residuals = design.residual(np.zeros((1, layout.measurements)), sample).shape[1]
    for place in range(residuals):
        label = f"residual {layout.names[layout.timed + place]}"
        columns.append(Output(label, layout.units[layout.timed + place], RESIDUAL, place))
    names = [column.name for column in columns] + ["time", "status"]
    for name in names:
        if names.count(name) > 1:
            raise InputError("estimates", f"two columns would have the name {shown(name)}")
    read = [design.sigmas[out.estimate] if out.deviation else out.estimate for out in columns]
    sources = tuple(name for name in dict.fromkeys(read) if name != RESIDUAL)
    ends = np.cumsum([0, *(sample[name][0].size for name in sources)]).tolist()
    starts = dict(zip((*sources, RESIDUAL), ends, strict=True))
    return Outputs(
        design, tuple(columns), sources,
        [starts[name] + column.place for name, column in zip(read, columns, strict=True)],
        [c for c, column in enumerate(columns) if column.deviation],
        [(c, out.conversion) for c, out in enumerate(columns) if out.conversion != SAME],
    )  # fmt: skip


def _called(
    name: str, design: Design, layout: Layout, named: Mapping[str, str] | None
) -> tuple[list[str], list[str], list[str]]:
    """Names of the components, their units as far as they are known, and those asked for."""
    labels, units = map(list, zip(*design.estimates[name], strict=True))
    size = len(labels)
    if name == "derivatives":
        signal = layout.units[layout.timed]
        units = [signal, *(product(signal, f"1/s^{order}") for order in range(1, size))]
    if named is None:
        return labels, units, [""] * size
    if len(named) != size:
        problem = f"names {len(named)} components, the observer estimates {size}"
        raise InputError(f"estimates.{name}", problem)
    return list(named), units, list(named.values())
