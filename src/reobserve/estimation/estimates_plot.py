"""A plot of results: estimates over measurements, residuals, inputs, alarms, and gaps in grey.

It remembers no more than some thousand points of a record, however long that is: of more it keeps
the minimum and the maximum of as many rows as must share a point. matplotlib is imported when
the plot is drawn.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from reobserve.core.errors import InputError
from reobserve.core.extras import package
from reobserve.core.files import write_whole
from reobserve.estimation.dates import time_zone
from reobserve.estimation.estimate import Estimated, Estimation
from reobserve.estimation.gaps import Stretch
from reobserve.estimation.output_columns import RESIDUAL, Output

Array = NDArray[np.float64]

_DAY = 86400.0  # [s]
_POINTS = 4000
_MOST_LINES = 6  # in a panel
_MOST_PANELS = 12
_COLOURS = ("#0072b2", "#d55e00", "#009e73", "#cc79a7", "#56b4e9", "#7f6000")
_DASHES: tuple[Any, ...] = (
    "-", (0, (5, 1.5)), (0, (1, 1.2)), (0, (5, 1.5, 1, 1.5)), (0, (9, 2)), (0, (3, 1, 1, 1, 1, 1)),
)  # fmt: skip
_THRESHOLD, _MEASURED, _GAP = "0.35", "0.55", "0.88"
_SIGMAS = 2.0  # of a band, to each side
_INPUT = "input"
_FORMATS = (".png", ".pdf", ".svg")


def check_plot(path: Path) -> None:
    """Refuse a name that says no format of plots, before there is one to draw."""
    if path.suffix not in _FORMATS:
        raise InputError(str(path), f"must end with {', '.join(_FORMATS)}")
    package("matplotlib", "draw a plot")


@contextmanager
def _style() -> Iterator[None]:
    """The style of plots, whatever a matplotlibrc says."""
    style = {
        "font.size": 9, "axes.spines.top": False, "axes.spines.right": False,
        "axes.grid": True, "grid.color": "0.92", "axes.axisbelow": True, "svg.hashsalt": "0",
        "legend.frameon": False, "pdf.fonttype": 42, "svg.fonttype": "none",
    }  # fmt: skip
    matplotlib = package("matplotlib", "draw a plot")
    default = {key: value for key, value in matplotlib.rcParamsDefault.items() if key != "backend"}
    with matplotlib.rc_context({**default, **style}):
        yield


def _extremes(rows: Array, share: int) -> Array:
    """Minima and maxima, shape (k, 2, n), of rows that have both, ``share`` to a point."""
    blocks = rows.reshape(-1, share, *rows.shape[1:])
    low, high = blocks[:, :, 0], blocks[:, :, 1]
    return np.stack([np.fmin.reduce(low, axis=1), np.fmax.reduce(high, axis=1)], axis=1)


class Plot:
    """Collects results, and draws them."""

    def __init__(self, estimation: Estimation) -> None:
        self.estimation = estimation
        self.share = 1  # rows to a point
        layout, columns = estimation.layout, estimation.outputs.columns
        names, units = layout.names[layout.timed :], layout.units[layout.timed :]
        # Places of what is kept: columns, alarms, measurements, their deviations, inputs.
        self.alarmed = len(columns)
        self.measured = self.alarmed + len(estimation.alarms)
        self.predicted = self.measured + layout.measurements
        self.given = self.predicted + layout.measurements
        width = self.given + len(names) - layout.measurements
        self.drawn = dict(enumerate(columns))
        for k in range(layout.measurements, len(names)):
            place = k - layout.measurements
            self.drawn[self.given + place] = Output(names[k], units[k], _INPUT, place)
        # Times and these, the minimum and the maximum of rows that share a point.
        self.points = self.rest = np.empty((0, 2, 1 + width))

    def add(self, block: Estimated, stretch: Stretch, estimates: Mapping[str, Array]) -> None:
        """Take results, with the rows and the estimates that they are of."""
        variance = self.estimation.design.residual_variance(estimates)
        unknown = np.full(stretch.y.shape, np.nan)
        rows = np.column_stack([
            block.time, block.numbers, block.alarms, stretch.y,
            unknown if variance is None else np.sqrt(variance),
            stretch.u[:, np.isnan(self.estimation.inputs.values)],
        ])  # fmt: skip
        self.rest = np.concatenate([self.rest, np.stack([rows, rows], axis=1)])
        whole = len(self.rest) // self.share * self.share
        made = _extremes(self.rest[:whole], self.share)
        self.points, self.rest = np.concatenate([self.points, made]), self.rest[whole:]
        while len(self.points) >= 4 * _POINTS and len(self.points) % 2 == 0:
            self.points, self.share = _extremes(self.points, 2), 2 * self.share

    def save(self, path: Path) -> None:
        """Draw it in a file."""
        with _style():
            figure = self.figure()
            metadata = {".pdf": {"CreationDate": None}, ".svg": {"Date": None}}.get(path.suffix)
            write_whole(
                path,
                lambda partial: figure.savefig(
                    partial, format=path.suffix[1:], dpi=160, metadata=metadata
                ),
            )

    def figure(self) -> Any:
        """Draw it."""
        rest = _extremes(self.rest, max(len(self.rest), 1))
        points = np.concatenate([self.points, rest])
        self.time, self.least, self.greatest = points[:, 0, 0], points[:, 0, 1:], points[:, 1, 1:]
        with _style():
            return self._figure(package("matplotlib.figure", "draw a plot"))

    def _figure(self, matplotlib: Any) -> Any:
        panels = self._panels()
        signals = self.estimation.alarms
        heights = [1.0] * len(panels) + ([0.16 + 0.17 * len(signals)] if signals else [])
        figure = matplotlib.Figure(figsize=(7.2, 1.1 + 1.55 * sum(heights)), layout="constrained")
        axes = figure.subplots(
            len(heights), 1, sharex=True, squeeze=False, height_ratios=heights
        )[:, 0]  # fmt: skip
        self.key: dict[str, Any] = {}  # of the legend of all panels
        for ax, columns in zip(axes, panels, strict=False):
            self._panel(ax, columns)
        if signals:
            self._alarm_panel(axes[-1])
        for ax in axes:
            self._grey(ax)
        self._time_axis(axes[-1])
        figure.align_ylabels()
        name = Path(self.estimation.place).name
        figure.suptitle(f"{name}, {type(self.estimation.observer).__name__}", fontsize=10)
        if self.key:
            figure.legend(self.key.values(), self.key, loc="outside lower center", ncols=4,
                          fontsize=8, markerscale=2.5)  # fmt: skip
        return figure

    def _at(self, time: Any) -> Any:
        """Times [s] as the axis has them, dates in days since 1970."""
        origin = self.estimation.report.origin
        return time if origin is None else (origin + time) / _DAY

    def _time_axis(self, ax: Any) -> None:
        report = self.estimation.report
        if len(self.time):
            ax.set_xlim(*self._at(self.time[[0, -1]])[: len(self.time)])
        if report.origin is None:
            ax.set_xlabel(f"time after {report.shift} s [s]" if report.shift else "time [s]")
            return
        dates = package("matplotlib.dates", "draw a plot")
        zone = time_zone(report.zone or "UTC")
        locator = dates.AutoDateLocator(tz=zone, maxticks=8)
        ax.xaxis.set_major_locator(locator)
        ax.xaxis.set_major_formatter(dates.ConciseDateFormatter(locator, tz=zone))
        ax.set_xlabel(f"time, {report.zone}" if report.zone else "time")

    def _panels(self) -> list[list[int]]:
        """Columns that share a panel: components of one estimate in one unit."""
        groups: dict[tuple[str, str], list[int]] = {}
        for c, column in self.drawn.items():
            if not column.deviation:
                groups.setdefault((column.estimate, column.unit), []).append(c)
        ordered = sorted(groups, key=lambda key: (key[0] == _INPUT, key[0] == RESIDUAL))
        return [groups[key][:_MOST_LINES] for key in ordered[:_MOST_PANELS]]

    def _panel(self, ax: Any, columns: list[int]) -> None:
        for line, c in enumerate(columns):
            colour, dashes = _COLOURS[line % len(_COLOURS)], _DASHES[line % len(_DASHES)]
            name = self.drawn[c].name if len(columns) > 1 else None
            width = 0.8 if self.drawn[c].estimate == RESIDUAL else 1.4
            solid = {"linewidth": width, "linestyle": dashes}
            self._curve(ax, self._broken(c), solid, color=colour, label=name)
            self._band(ax, c, colour)
            if (measured := self._measured(c)) is not None:
                dots = {"linestyle": "none", "marker": ".", "markersize": 2.0}
                drawn = self._curve(ax, measured, dots, color=_MEASURED, zorder=1)
                self.key["measured"] = drawn
        self._limit(ax, columns)
        for alarm in self.estimation.alarms:
            entry = self.estimation.report.alarms[alarm.rule.name]
            if alarm.column in columns:
                for bound in entry.bounds:
                    bottom, top = ax.get_ylim()  # which one far off would flatten
                    if bottom - top <= 2.0 * (bound - bottom) <= 3.0 * (top - bottom):
                        self.key["threshold of an alarm"] = ax.axhline(
                            bound, color=_THRESHOLD, linestyle="--", linewidth=0.8
                        )
                        ax.set_ylim(min(bottom, bound), max(top, bound))
        first = self.drawn[columns[0]]
        name = first.name if len(columns) == 1 else first.estimate.replace("_", " ")
        ax.set_ylabel(f"{name}\n[{first.unit}]" if first.unit else name)
        if len(columns) > 1:
            ax.legend(fontsize=8, ncols=len(columns), loc="lower right", bbox_to_anchor=(1, 0.97),
                      borderpad=0, handlelength=2.2)  # fmt: skip

    def _spread(self, c: int) -> int | None:
        """The place of the standard deviation of a column, if the observer has one."""
        column = self.drawn[c]
        if column.estimate == _INPUT:
            return None
        if column.estimate != RESIDUAL:
            return self.estimation.outputs.deviation_of(c)
        place = self.predicted + column.place
        return place if np.isfinite(self.greatest[:, place]).any() else None

    def _measured(self, c: int) -> tuple[Array, Array, Array] | None:
        """The measurement of an estimate, in its unit, if it is measured itself."""
        column = self.drawn[c]
        place = self.estimation.design.measured.get((column.estimate, column.place))
        if place is None:
            return None
        time, low, high = self._broken(self.measured + place)
        return time, column.conversion.of(low), column.conversion.of(high)

    def _curve(
        self, ax: Any, points: tuple[Array, Array, Array], line: dict[str, Any], **style: Any
    ) -> Any:
        """Draw a line, or the area between the minima and maxima of rows that share a point."""
        time, low, high = points
        if self.share > 1:
            return ax.fill_between(time, low, high, linewidth=0.6, **style)
        return ax.plot(time, low, **line, **style)[0]

    def _band(self, ax: Any, c: int, colour: str) -> None:
        """Draw the standard deviations to each side of an estimate, or of a residual of zero."""
        if (place := self._spread(c)) is not None:
            time, low, high = self._broken(c)
            _, _, sigma = self._broken(place)
            if self.drawn[c].estimate == RESIDUAL:
                low = high = np.zeros(len(time))
            self.key[f"±{_SIGMAS:g} standard deviations of the observer"] = ax.fill_between(
                time, low - _SIGMAS * sigma, high + _SIGMAS * sigma, color=colour, alpha=0.2,
                linewidth=0,
            )  # fmt: skip

    def _limit(self, ax: Any, columns: list[int]) -> None:
        """Let the axis follow the estimates and their usual bands, and not the first band."""
        low, high = np.inf, -np.inf
        for c in columns:
            band, place = 0.0, self._spread(c)
            if place is not None:
                sigma = self.greatest[:, place]
                band = _SIGMAS * float(np.nanmedian(sigma)) if np.isfinite(sigma).any() else 0.0
            low = min(low, float(np.nanmin(self.least[:, c], initial=np.inf)) - band)
            high = max(high, float(np.nanmax(self.greatest[:, c], initial=-np.inf)) + band)
            measured = self._measured(c)
            if measured is not None and np.isfinite(measured[1]).any():  # but a few outliers
                low = min(low, float(np.nanquantile(measured[1], 0.005)))
                high = max(high, float(np.nanquantile(measured[2], 0.995)))
        if np.isfinite(high - low) and high > low:
            ax.set_ylim(low - 0.05 * (high - low), high + 0.05 * (high - low))

    def _jumps(self) -> NDArray[np.int_]:
        """The points before which there is a gap."""
        longest = 1.5 * self.share * self.estimation.specification.sampling.period
        return np.flatnonzero(np.diff(self.time) > longest) + 1

    def _broken(self, c: int) -> tuple[Array, Array, Array]:
        """A column with a nan in each gap, so that no line crosses it."""
        at = self._jumps()
        return (
            self._at(np.insert(self.time, at, self.time[at])),
            np.insert(self.least[:, c], at, np.nan), np.insert(self.greatest[:, c], at, np.nan),
        )  # fmt: skip

    def _grey(self, ax: Any) -> None:
        for start, end in self.estimation.report.gaps:
            last = self.time[-1] if end is None and len(self.time) else end
            self.key["gap"] = ax.axvspan(
                self._at(start), self._at(last), color=_GAP, linewidth=0, zorder=0
            )

    def _alarm_panel(self, ax: Any) -> None:
        signals = self.estimation.alarms
        step = self.share * self.estimation.specification.sampling.period
        for row, _ in enumerate(signals):
            raised = self.greatest[:, self.alarmed + row]
            on = np.flatnonzero(raised == 1.0)
            for part in np.split(on, np.flatnonzero(np.diff(on) > 1) + 1) if len(on) else ():
                start, end = self._at(self.time[part[0]]), self._at(self.time[part[-1]] + step)
                ax.broken_barh([(start, end - start)], (row - 0.3, 0.6), color="#b2182b")
        ax.set_yticks(range(len(signals)), [alarm.rule.name for alarm in signals])
        ax.set_ylim(len(signals) - 0.5, -0.5)
        ax.set_ylabel("alarms")
        ax.grid(visible=False)
