"""The stage plot of a paper: one drawing for each layout that its ledger may name."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

from reobserve.errors import InputError
from reobserve.ledger.types import Job, Settings, read_job
from reobserve.scoring.metrics import Metric
from reobserve.timeseries.series import Series

Rows = Sequence[Mapping[str, Any]]
# Both return matplotlib's Figure, which is for those who draw to import.
Drawing = Callable[[Job, Series, Mapping[str, Series], Rows, Sequence[Metric]], Any]
Draw = Callable[[Settings, Series, Mapping[str, Series], Rows | None, Sequence[Metric]], Any]


def by_layout(keys: type, layouts: Mapping[str, Drawing], of_studies: Sequence[str] = ()) -> Draw:
    """A paper's `draw`: the drawing of the layout that the figure names.

    Parameters
    ----------
    keys
        What the paper's ledger declares.
    layouts
        The drawings by their names; each gets the job, plant, estimates, study and metrics.
    of_studies
        Those that draw the study of the method of the same name.
    """

    def draw(
        settings: Settings,
        plant: Series,
        estimates: Mapping[str, Series],
        study: Rows | None,
        metrics: Sequence[Metric],
    ) -> Any:
        """The figure in the layout that the ledger names.

        Raises
        ------
        InputError
            If it draws a study of another method.
        """
        job = read_job(keys, settings)
        layout = job.figure.layout
        method = None if job.study is None else job.study.method
        if layout in of_studies and method != layout:
            raise InputError("study", f"must be one of the method {layout}, as the layout is")
        return layouts[layout](job, plant, estimates, study or [], metrics)

    return draw
