"""The columns of what was estimated: their names and units, and how they are read from a run."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from reobserve.core.errors import InputError, nearest, shown
from reobserve.estimation.families.design import Design
from reobserve.estimation.layout import Layout
from reobserve.estimation.quantities import SAME, Conversion, conversion, rate_unit

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

    design: Design
    columns: tuple[Output, ...]

    def numbers(self, y: Array, estimates: Mapping[str, Array]) -> Array:
        """The columns' values, shape (k, columns)."""
        plan, rows = self._plan(estimates), len(y)
        parts = [estimates[name].reshape(rows, -1) for name in plan.estimates]
        parts.append(self.design.residual(y, estimates))
        found: Array = np.concatenate(parts, axis=1)[:, plan.places]
        with np.errstate(invalid="ignore"):  # a variance below zero has no root
            found[:, plan.deviations] = np.sqrt(found[:, plan.deviations])
        for column, factor in plan.factors:
            found[:, column] *= factor
        for column, offset in plan.offsets:
            found[:, column] += offset
        return found

    def row(self, y: Array, estimates: Mapping[str, Array]) -> list[float]:
        """The same numbers for one row, shape (1, p), where each microsecond counts."""
        plan = self._plan(estimates)
        flat: list[float] = []
        for name in plan.estimates:
            flat += estimates[name].ravel().tolist()
        flat += self.design.residual(y, estimates)[0].tolist()
        found = [flat[place] for place in plan.places]
        for column in plan.deviations:
            found[column] = math.sqrt(found[column]) if found[column] >= 0.0 else math.nan
        for column, factor in plan.factors:
            found[column] *= factor
        for column, offset in plan.offsets:
            found[column] += offset
        return found

    def _plan(self, estimates: Mapping[str, Array]) -> _Plan:
        """Where the columns stand; the same for all rows, since shapes do not change."""
        made: _Plan | None = vars(self).get("plan")
        if made is None:
            made = _planned(self, estimates)
            vars(self)["plan"] = made
        return made


class _Plan(NamedTuple):
    """Columns as places in the flattened ``estimates`` and the residual, one behind the other."""

    estimates: tuple[str, ...]
    places: list[int]
    deviations: list[int]  # columns of which the root is taken
    factors: list[tuple[int, float]]
    offsets: list[tuple[int, float]]


def _planned(made: Outputs, estimates: Mapping[str, Array]) -> _Plan:
    sigmas = made.design.sigmas
    sources = [sigmas[one.estimate] if one.deviation else one.estimate for one in made.columns]
    names = tuple(dict.fromkeys(name for name in sources if name != RESIDUAL))
    starts, size = {}, 0
    for name in names:
        starts[name] = size
        size += estimates[name][0].size
    starts[RESIDUAL] = size
    places = [starts[one] + column.place for one, column in zip(sources, made.columns, strict=True)]
    ways = list(enumerate(made.columns))
    return _Plan(
        names,
        places,
        [c for c, column in ways if column.deviation],
        [(c, column.conversion.factor) for c, column in ways if column.conversion.factor != 1.0],
        [
            (c, column.conversion.offset)
            for c, column in ways
            if column.conversion.offset and not column.deviation
        ],
    )


def outputs(
    design: Design,
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
                columns.append(Output(label, unit, name, place, True, way))
    residuals = design.residual(np.zeros((1, layout.measurements)), sample).shape[1]
    for place in range(residuals):
        label = f"residual {layout.names[layout.timed + place]}"
        columns.append(Output(label, layout.units[layout.timed + place], RESIDUAL, place))
    names = [column.name for column in columns] + ["time", "status"]
    for name in names:
        if names.count(name) > 1:
            raise InputError("estimates", f"two columns would have the name {shown(name)}")
    return Outputs(design, tuple(columns))


def _called(
    name: str, design: Design, layout: Layout, named: Mapping[str, str] | None
) -> tuple[list[str], list[str], list[str]]:
    """Names of the components, their units as far as they are known, and those asked for."""
    labels, units = map(list, zip(*design.estimates[name], strict=True))
    size = len(labels)
    if name == "derivatives":
        signal = layout.units[layout.timed]
        units = [rate_unit(signal, order) for order in range(size)]
    if named is None:
        return labels, units, [""] * size
    if len(named) != size:
        problem = f"names {len(named)} components, the observer estimates {size}"
        raise InputError(f"estimates.{name}", problem)
    return list(named), units, list(named.values())
