"""How far each tuned number may move, alone, before a quoted value leaves its band."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure

from reobserve.papers.imm.study_rows import TUNED
from reobserve.papers.imm.styles import style_of
from reobserve.plotting.figures import add_note, few_ticks, headroom, new_figure
from reobserve.plotting.look import mark, thick
from reobserve.replication.parameters.figure_data import FigureData

_NAMES = {
    "process_noise_1": "Q, position",
    "process_noise_2": "Q, velocity",
    "process_noise_3": "Q, x₂",
    "process_noise_4": "Q, x₃",
    "process_noise_5": "Q, x₄",
    "measurement_noise_1": "R, position",
    "measurement_noise_2": "R, velocity",
    "measurement_noise_3": "R, acceleration",
    "leave": "probability to leave",
}


def draw(data: FigureData) -> Figure:
    """A bar a number, and below the mean probabilities while one number moves."""
    figure, (bars, curves) = new_figure((2.5, 2.3), share_time=True)
    job, numbers = data.job, data.metrics
    most = max(job.study.factors)
    for row, parameter in enumerate(TUNED):
        low = numbers[parameter, "least_factor"]
        high = numbers[parameter, "greatest_factor"]
        bars.plot((low, high), (row, row), color="0.35", linewidth=thick(5), solid_capstyle="butt")
        for end, side in ((low, -1), (high, 1)):
            open_end = abs(end - most ** float(side)) < 1e-9
            bars.plot(end, row, marker=("<" if side < 0 else ">") if open_end else "|",
                      color="0.1", markersize=mark(7))  # fmt: skip
    bars.axvline(1.0, color="0.4", linewidth=thick(0.8), linestyle=":")
    bars.set_yticks(range(len(TUNED)), [_NAMES[name] for name in TUNED])
    bars.invert_yaxis()
    bars.set_xscale("log")
    band = job.study.band
    bars.set_title(f"(a) factors that keep every quoted value within ±{band:g}")
    narrow = min(
        TUNED,
        key=lambda name: numbers[name, "greatest_factor"] / numbers[name, "least_factor"],
    )
    for name, body in job.observers.items():
        style = style_of(body)
        for quantity, width in (("normal_after", 1.2), ("leakage_after", 2.4)):
            mine = data.study.where(observer=name, quantity=quantity)
            rows = [mine.where(sweep=sweep) for sweep in (narrow, "stated")]
            level, value = (
                np.concatenate([one[part] for one in rows]) for part in ("level", "value")
            )
            order = np.argsort(level)
            curves.plot(
                level[order], value[order], color=style.color, linestyle=style.linestyle,
                linewidth=thick(width),
                label=f"{body.label}, {quantity.removesuffix('_after')}",
            )  # fmt: skip
    curves.set_ylim(-0.03, 1.03)
    headroom(curves, to=1.5)
    curves.set_yticks((0, 0.5, 1))
    curves.set_ylabel("mean probability")
    curves.set_title(f"(b) the number with the least room: {_NAMES[narrow]}")
    curves.legend(loc="upper left", ncols=2)
    curves.set_xlabel("factor to the tuned number")
    few_ticks(curves, (0.1, 0.2, 0.5, 1, 2, 5, 10))
    curves.set_xlim(0.93 / most, most / 0.93)
    add_note(
        figure,
        f"{numbers['search', 'tuned']:g} numbers tuned to {numbers['search', 'targets']:g} quoted "
        f"ones by {numbers['search', 'trials']:g} trials of three banks; "
        f"{numbers['search', 'distance']:.3f} is left (root mean square over time).\n"
        "Arrows: beyond the range of the study. States x₂ to x₄ of the scaled realisation.",
    )
    return figure
