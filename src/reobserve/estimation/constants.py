"""Inputs that are constant, as gravity, and have no column: a specification states their values."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from reobserve.core.matrices import as_scalar
from reobserve.estimation.observer_design import Design
from reobserve.estimation.quantities import conversion
from reobserve.estimation.specification import Columns, Constant

Array = NDArray[np.float64]


@dataclass(frozen=True)
class AllInputs:
    """All inputs of an observer, of which some are constant: nan stands for the columns."""

    values: tuple[float, ...] = ()

    def of(self, columns: Array) -> Array:
        """The inputs, shape (k, m), of rows of the columns alone."""
        constant = np.isfinite(self.values)
        if not constant.any():
            return columns
        values = np.empty((len(columns), len(self.values)))
        values[:, constant] = np.array(self.values)[constant]
        values[:, ~constant] = columns
        return values


def inputs(columns: Columns, design: Design) -> AllInputs:
    """The inputs of a design, with constants in its units."""
    values, units = [], [unit for _, unit in design.inputs]
    for k, column in enumerate(columns.inputs):
        if not isinstance(column, Constant):
            values.append(np.nan)
            continue
        unit = units[k] if k < len(units) and all(units) else ""
        at = f"columns.inputs.{k}.unit"
        way = conversion(at, column.unit, unit) if column.unit and unit else None
        value = column.value if way is None else float(way.of(column.value))
        values.append(as_scalar(f"columns.inputs.{k}.value", value))
    return AllInputs(tuple(values))
