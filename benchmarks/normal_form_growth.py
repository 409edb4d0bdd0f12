"""How the cost of a normal form grows with the degree and with the number of states: a plot."""

from __future__ import annotations

from pathlib import Path

from benchmarks.normal_form_problems import dense_cubic, methods
from benchmarks.timing import interleaved

PLOT = Path(__file__).with_name("results") / "normal_forms.svg"

_HIGHEST = {2: 14, 3: 10, 4: 8}  # degree for each number of states
_MOST_STATES, _DEGREE = 7, 5
_METHODS = ("S", "T", "inverse of S", "Lie")

Times = dict[str, float]


def plot(quick: bool) -> str:
    """Measure, draw and say where the plot is."""
    rounds = 1 if quick else 5
    shorter = 3 if quick else 0
    panels: dict[str, dict[int, Times]] = {
        f"{n} states": {d: _times(n, d, rounds) for d in range(2, highest + 1 - shorter)}
        for n, highest in _HIGHEST.items()
    }
    panels[f"degree {_DEGREE}"] = {
        n: _times(n, _DEGREE, rounds) for n in range(1, _MOST_STATES + 1 - shorter)
    }
    _draw(panels)
    return f"time against degree and states: {PLOT.relative_to(Path(__file__).parents[1])}"


def _times(states: int, degree: int, rounds: int) -> Times:
    jobs = methods(dense_cubic(states, degree))
    return interleaved({name: jobs[name] for name in _METHODS}, rounds)


def _draw(panels: dict[str, dict[int, Times]]) -> None:
    # Late: drawing is no part of what is measured.
    from reobserve_papers.plotting.figures import STYLES, decades, new_figure
    from reobserve_papers.plotting.formats import save

    figure, axes = new_figure((1.55,) * len(panels), share_time=False)
    for panel, (title, measured) in zip(axes, panels.items(), strict=True):
        for name, style in zip(_METHODS, STYLES, strict=False):
            milliseconds = [1e3 * times[name] for times in measured.values()]
            panel.semilogy(list(measured), milliseconds, label=name, **style.points())
        decades(panel.yaxis)
        panel.minorticks_off()
        panel.set_title(f"dense cubic f and h, {title}")
        panel.set_ylabel("time [ms]")
        panel.set_xlabel("states" if title.startswith("degree") else "degree of the series")
        panel.set_xticks(list(measured))
    least, most = (end(panel.get_ylim()[k] for panel in axes) for k, end in ((0, min), (1, max)))
    for panel in axes:
        panel.set_ylim(least, most)
    axes[0].legend(loc="upper left", ncols=2)
    PLOT.parent.mkdir(parents=True, exist_ok=True)
    save(figure, PLOT)
