"""The data report as a table for a terminal."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial
from typing import Any

from reobserve.estimation.data_report import AlarmReport, DataReport


def as_table(report: DataReport, period: float) -> str:
    """A few lines for a terminal: only what there is to tell."""
    lines = [("rows read", f"{report.rows}")]
    if report.left_out:
        listed = ", ".join(f"{count} {reason}" for reason, count in report.left_out.items())
        lines.append(("lines left out", listed))

    at = partial(report.said, digits=6)
    if report.first is not None and report.last is not None:
        lines.append(("time", _span(at(report.first), at(report.last))))
    if report.mean_interval is not None:
        text = f"{period:g} s, timestamps say {report.mean_interval:.6g} s on average"
        lines.append(("sampling period", text))
        if 1e-9 < report.jitter < 0.5:  # of rows that have places
            lines.append(("largest jitter", f"{100 * report.jitter:.3g} % of a period"))
    for name, value in (
        ("samples lost", report.lost),
        ("timestamps repeated", report.repeated),
        ("rows without timestamp, left out", report.unstamped),
        ("rows before all is measured", report.before_start),
        ("rows after all was measured", report.after_end),
    ):
        if value:
            lines.append((name, str(value)))
    for name, table in (
        ("values missing", report.missing),
        ("values filled", report.filled),
        ("values held until they change", report.held),
        ("values saturated", report.saturated),
        ("outliers beyond the gate", report.outliers),
    ):
        if table:
            listed = ", ".join(f"{column} {count}" for column, count in table.items())
            lines.append((name, listed))
    for start, end in report.gaps[:5]:
        begun = "the start" if start is None else at(start)
        ending = "the end" if end is None else at(end)
        lines.append(("gap", f"{begun} to {ending}"))
    if report.gap_count > 5:
        lines.append(("gaps in all", str(report.gap_count)))
    if report.restarts:
        lines.append(("restarts", str(report.restarts)))
    listed = ", ".join(f"{count} {word}" for word, count in report.statuses.items())
    lines.append(("estimates", f"{report.estimates}" + (f": {listed}" if listed else "")))
    for name, alarm in report.alarms.items():
        lines.append((f"alarm {name}", _alarm_line(alarm, at)))
        lines += [("", _size(each, alarm.unit, at)) for each in alarm.summary()["intervals"][:5]]
    width = max(len(name) for name, _ in lines)
    said = [f"  {name:<{width}}  {value}" for name, value in lines]
    return "\n".join(said + [f"  warning: {warning}" for warning in report.warnings])


def _span(start: str, end: str) -> str:
    """The time from one to another, in seconds if the second one is."""
    return f"{start.removesuffix(' s') if end.endswith(' s') else start} to {end}"


def _alarm_line(alarm: AlarmReport, at: Callable[[float], str]) -> str:
    said = _threshold(alarm)
    if not said:
        return f"no threshold: {alarm.learned} values until the end of the stretch that sets it"
    if alarm.start_up:
        said += f"; start-up {alarm.start_up:.6g} s"
        if alarm.hidden:
            said += f", in which {alarm.hidden} rows are beyond it and raise no alarm"
    if alarm.after_gap:
        said += f"; {alarm.after_gap} rows beyond it in or after gaps, as the observer predicts"
    if alarm.first is None:
        return f"none; {said}"
    count = alarm.summary()["interval_count"]
    times = "once" if count == 1 else f"{count} times"
    first = f"first at {at(alarm.first)}"
    if alarm.earlier is not None:
        first += f" or earlier (beyond the threshold from {at(alarm.earlier)} on, in start-up)"
    return f"{times}, {alarm.rows} rows, {first}; {said}"


def _threshold(alarm: AlarmReport) -> str:
    """The threshold in words, nothing if it is not known."""
    parts = [
        f"{side} {_amount(value, alarm.unit)}"
        for side, value in (("above", alarm.above), ("below", alarm.below)) if value is not None
    ]  # fmt: skip
    if alarm.threshold is not None:
        parts.append(_amount(alarm.threshold, alarm.unit))
    if alarm.learns and parts:
        parts[0] += f" from the mean {alarm.mean:.4g}, both of {alarm.learned} values"
    said = " or ".join(parts)
    if alarm.sigmas is not None:
        by = f"{alarm.sigmas:g} standard deviations of the observer"
        said = by if alarm.threshold == 0.0 else f"{said} by {by}"
    return f"threshold {said}" if said else ""


def _size(interval: Mapping[str, Any], unit: str, at: Callable[[float], str]) -> str:
    """The time and size of an excess."""
    said = f"{_span(at(interval['start']), at(interval['end']))}: mean "
    said += _amount(interval["mean"], unit)
    if interval["standard_deviation"] is not None:
        said += f", standard deviation {interval['standard_deviation']:.2g}"
    if interval["sigma"] is not None:
        said += f" (by the observer {interval['sigma']:.2g})"
    return f"{said}, peak {_amount(interval['peak'], unit)}"


def _amount(value: float, unit: str) -> str:
    return f"{value:.4g} {unit if unit != '1' else ''}".rstrip()
