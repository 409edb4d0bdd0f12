"""The columns of what was estimated: their names and units, and how they are read from a run."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from reobserve.errors import InputError, nearest, shown
from reobserve.own_data.kinds.setup import Setup
from reobserve.own_data.layout import Layout
from reobserve.own_data.quantities import SAME, Conversion, conversion, rate_unit

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
        """As the header has it."""
        return f"{self.name} [{self.unit}]" if self.unit else self.name


RESIDUAL = "residual"


@dataclass(frozen=True)
class Outputs:
    """What is written of each row, in order."""

    setup: Setup
    columns: tuple[Output, ...]

    def numbers(self, y: Array, estimates: Mapping[str, Array]) -> Array:
        """The columns' values, shape (k, columns)."""
        found = np.empty((len(y), len(self.columns)))
        residual = None if self.setup.residual is None else self.setup.residual(y, estimates)
        for c, column in enumerate(self.columns):
            if column.estimate == RESIDUAL:
                assert residual is not None
                values = residual[:, column.place]
            elif column.deviation:
                variance = estimates[self.setup.sigmas[column.estimate]]
                if variance.ndim == 3:
                    values = np.sqrt(variance[:, column.place, column.place])
                else:
                    values = np.sqrt(variance[:, column.place])
            else:
                whole = estimates[column.estimate]
                values = whole if whole.ndim == 1 else whole[:, column.place]
            factor, offset = column.conversion
            found[:, c] = values
            if factor != 1.0:
                found[:, c] *= factor
            if offset and not column.deviation:
                found[:, c] += offset
        return found

    def row(self, y: Array, estimates: Mapping[str, Array]) -> list[float]:
        """The same numbers for one row, shape (1, p), where each microsecond counts."""
        residual: list[float] = []
        if self.setup.residual is not None:
            residual = self.setup.residual(y, estimates)[0].tolist()
        found, parts = [], {}
        for _, _, estimate, index, deviation, (factor, offset) in self.columns:
            if estimate == RESIDUAL:
                value = residual[index]
            elif deviation:
                name = self.setup.sigmas[estimate]
                if name not in parts:
                    parts[name] = estimates[name][0].tolist()
                variance = parts[name][index]
                value = math.sqrt(variance if isinstance(variance, float) else variance[index])
            else:
                if estimate not in parts:
                    parts[estimate] = estimates[estimate][0].tolist()
                whole = parts[estimate]
                value = whole if isinstance(whole, float) else whole[index]
            if factor != 1.0:
                value *= factor
            if offset and not deviation:
                value += offset
            found.append(value)
        return found


def outputs(
    setup: Setup,
    layout: Layout,
    sample: Mapping[str, Array],
    named: Mapping[str, Mapping[str, str]],
) -> Outputs:
    """The columns for an observer, from a ``sample`` of its estimates and what the user ``named``.

    Raises
    ------
    InputError
        If there is no such estimate, it has another number of components, two columns have one
        name, or a unit cannot become the one that is asked for.
    """
    written = {
        name: values for name, values in sample.items()
        if name not in setup.left_out and values.ndim <= 2
    }  # fmt: skip
    for name in named:
        if name not in written:
            raise InputError(
                f"estimates.{name}", f"there is no such estimate{nearest(name, written)}"
            )
    columns: list[Output] = []
    for name, values in written.items():
        size = 1 if values.ndim == 1 else values.shape[1]
        labels, units, asked = _called(name, size, setup, layout, named.get(name))
        for place in range(size):
            way = SAME
            if units[place] and asked[place]:
                at = f"estimates.{name}.{labels[place]}"
                way = conversion(at, units[place], asked[place])
            unit = asked[place] or units[place]
            columns.append(Output(labels[place], unit, name, place, False, way))
            if name in setup.sigmas:
                label = f"{labels[place]} sigma"
                columns.append(Output(label, unit, name, place, True, way))
    if setup.residual is not None:
        for place, unit in enumerate(layout.units[layout.timed :][: layout.measurements]):
            label = f"residual {layout.names[layout.timed + place]}"
            columns.append(Output(label, unit, RESIDUAL, place))
            if place + 1 == _residuals(setup, sample, layout):
                break
    names = [column.name for column in columns] + ["time", "status"]
    for name in names:
        if names.count(name) > 1:
            raise InputError("estimates", f"two columns would have the name {shown(name)}")
    return Outputs(setup, tuple(columns))


def _residuals(setup: Setup, sample: Mapping[str, Array], layout: Layout) -> int:
    assert setup.residual is not None
    return int(setup.residual(np.zeros((1, layout.measurements)), sample).shape[1])


def _called(
    name: str, size: int, setup: Setup, layout: Layout, named: Mapping[str, str] | None
) -> tuple[list[str], list[str], list[str]]:
    """Names of the components, their units as far as they are known, and those asked for."""
    usual = [name] if size == 1 and name not in ("state", "fault") else (
        [f"{name}_{place + 1}" for place in range(size)]
    )  # fmt: skip
    labels = list(setup.names.get(name, usual))
    units = list(setup.units.get(name, [setup.observer.units.get(name, "")] * size))
    if name == "derivatives":
        signal = layout.units[layout.timed]
        units = [rate_unit(signal, order) for order in range(size)]
    if named is None:
        return labels, units, [""] * size
    if len(named) != size:
        problem = f"names {len(named)} components, the observer estimates {size}"
        raise InputError(f"estimates.{name}", problem)
    return list(named), units, list(named.values())
