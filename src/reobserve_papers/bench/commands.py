"""Commands: `reobserve tune`, and `reobserve bench tune`, `score`, `moved`, `plot` and `table`."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from pathlib import Path

from reobserve.tuning.task import Task
from reobserve.core.errors import InputError, nearest
from reobserve.core.files import check_not_read, check_replaceable, read_text, write_text


def tune_command(
    task_file: Path, methods: Sequence[str], stored: Path | None, output: Path
) -> None:
    """Tune methods on the training sets of a task, and write their settings into a folder."""
    from reobserve.tuning.task_tuning import tune_method
    from reobserve.tuning.tuned_file import TunedMethod

    task = Task.read(task_file)
    for name in methods:
        if name not in task.methods:
            raise InputError("method", f"there is no {name!r}{nearest(name, task.methods)}")
    for name in methods or task.methods:
        path = stored / f"{name}.json" if stored else None
        known = TunedMethod.read(path) if path and path.exists() else None
        tune_method(task, name, _tell, known).write(output / f"{name}.json")


def tune_records_command(tune_file: Path, output: Path) -> None:
    """Tune specifications on records; write them, their scores on held-out segments and a table."""
    from reobserve.tuning.recorded import RecordedTask
    from reobserve.tuning.scoring import score_task
    from reobserve.tuning.table import Results, read_cells, summary, write_cells, write_scores
    from reobserve.tuning.task_tuning import objective, tune_method

    task = RecordedTask.read(tune_file)
    table, scores, text = (output / name for name in ("table.csv", "scores.csv", "table.md"))
    files = {name: output / f"{name}.yaml" for name in task.methods}
    written = [table, scores, text, *files.values()]
    for path in written:
        check_replaceable(path)
    check_not_read(written, task.reads)
    tuned, settings = {}, {}
    for name, method in task.methods.items():
        tuned[name] = tune_method(task, name, _tell)
        (found,) = tuned[name].training[task.main].repeats
        settings[name] = found.settings
        assert method.paper is not None  # the numbers as specified
        if found.objective >= objective(task, name, task.main, 0, method.paper.settings):
            _tell(f"{name}: not better than as specified; raise the budget, or change the ranges")
    cells = score_task(task, tuned)
    write_scores(task, cells, scores)
    write_cells(cells, table)
    for name, path in files.items():
        write_text(path, task.specifications[name].text(settings[name]))
    write_text(text, summary(Results(task, read_cells(table), tuned)))
    print(read_text(text), end="")


def score_command(task_file: Path, tuned: Path, outputs: Sequence[Path]) -> None:
    """Score tuned methods on held-out records; outputs are scores and table."""
    from reobserve.tuning.scoring import score_task
    from reobserve.tuning.table import write_cells, write_scores
    from reobserve.tuning.tuned_file import read_tuned

    task = Task.read(task_file)
    cells = score_task(task, read_tuned(task, tuned))
    scores, table = outputs
    write_scores(task, cells, scores)
    write_cells(cells, table)


def moved_command(task_file: Path, cached: Path, again: Path, output: Path) -> None:
    """Compare kept settings with those tuned again; an error names the cells that moved."""
    from dataclasses import astuple

    from reobserve.tuning.scoring import moved
    from reobserve.tuning.tuned_file import read_tuned
    from reobserve.core.files import write_table

    task = Task.read(task_file)
    found = moved(task, read_tuned(task, cached), read_tuned(task, again))
    header = ("method", "condition", "ratio", "low", "high")
    write_table(output, [dict(zip(header, astuple(one), strict=True)) for one in found], header)
    far = [f"{one.method} in {one.condition} by {one.ratio:.3f}" for one in found if one.moved]
    if far:
        raise InputError(str(again), f"{len(far)} cells moved: {', '.join(far)}")


def plot_command(
    task_file: Path, table: Path, tuned: Path, outputs: Sequence[Path], style: Path | None
) -> None:
    """Draw the figures of a task; the name of an output, without its suffix, says which."""
    from reobserve_papers.bench.plot import FIGURES
    from reobserve.tuning.table import Results
    from reobserve_papers.plotting.fitting import fix_layout
    from reobserve_papers.plotting.formats import save
    from reobserve_papers.plotting.look import use_sheet

    use_sheet(style)
    results = Results.read(Task.read(task_file), table, tuned)
    for name in dict.fromkeys(output.stem for output in outputs):
        if name not in FIGURES:
            raise InputError("--outputs", f"there is no figure {name!r}{nearest(name, FIGURES)}")
        figure = FIGURES[name](results)
        fix_layout(figure)
        for output in outputs:
            if output.stem == name:
                save(figure, output)


def table_command(folders: Sequence[Path], tasks: Path, tuned: Path, output: Path) -> None:
    """Write the table of all methods in Markdown, from folders of results named like tasks."""
    from reobserve.tuning.table import Results, summary

    parts = []
    for folder in folders:
        task = Task.read(tasks / f"{folder.name}.yaml")
        parts.append(summary(Results.read(task, folder / "table.csv", tuned / folder.name)))
    write_text(output, "\n".join(parts))


def _tell(line: str) -> None:
    print(line, file=sys.stderr, flush=True)
