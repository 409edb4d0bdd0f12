"""Commands: `reobserve-papers bench tune`, `score`, `moved`, `plot` and `table`."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from reobserve.core.errors import InputError
from reobserve.core.files import check_replaceable, write_text
from reobserve.tuning.tune_command import tell
from reobserve_papers.bench.packaged_task import PackagedTask
from reobserve_papers.parameters.config import refuse_unknown


def tune_command(
    task_file: Path, methods: Sequence[str], stored: Path | None, main_only: bool, output: Path
) -> None:
    """Tune methods on the training sets of a task, and write their settings into a folder."""
    from reobserve.tuning.task_tuning import tune_method
    from reobserve.tuning.tuned_file import TunedMethod

    task = PackagedTask.read(task_file)
    refuse_unknown("method", methods, task.methods)
    for name in methods or task.methods:
        check_replaceable(output / f"{name}.json")
    for name in methods or task.methods:
        path = stored / f"{name}.json" if stored else None
        known = TunedMethod.read(path) if path and path.exists() else None
        tune_method(task, name, tell, known, main_only=main_only).write(output / f"{name}.json")


def score_command(task_file: Path, tuned: Path, outputs: Sequence[Path]) -> None:
    """Score tuned methods on held-out records, and write scores and table."""
    from reobserve.tuning.results import write_cells, write_scores
    from reobserve.tuning.scoring import score_task
    from reobserve.tuning.tuned_file import read_tuned

    task = PackagedTask.read(task_file)
    settings = read_tuned(task, tuned)
    for name, method in settings.items():
        if missing := [training for training in task.training if training not in method.training]:
            tell(f"{name}: not tuned on {', '.join(missing)}, so these rows are left out")
    cells = score_task(task, settings)
    scores, table = outputs
    write_scores(task, cells, scores)
    write_cells(cells, table, seal=True)


def moved_command(task_file: Path, cached: Path, again: Path, output: Path) -> None:
    """Compare kept settings with those tuned again, with an error that names moved cells."""
    from dataclasses import astuple

    from reobserve.core.files import write_table
    from reobserve.tuning.scoring import moved
    from reobserve.tuning.tuned_file import read_tuned

    task = PackagedTask.read(task_file)
    moves = moved(task, read_tuned(task, cached), read_tuned(task, again))
    header = ("method", "condition", "ratio", "low", "high")
    write_table(output, [dict(zip(header, astuple(move), strict=True)) for move in moves], header)
    far = [f"{move.method} in {move.condition} by {move.ratio:.3f}" for move in moves if move.moved]
    if far:
        raise InputError(str(again), f"{len(far)} cells moved: {', '.join(far)}")


def plot_command(
    task_file: Path, table: Path, tuned: Path, outputs: Sequence[Path], style: Path | None
) -> None:
    """Draw the figures of a task. The name of an output, without its suffix, says which."""
    from reobserve.tuning.results import Results
    from reobserve_papers.bench.bench_figures import FIGURES
    from reobserve_papers.plotting.fitting import fix_layout
    from reobserve_papers.plotting.formats import save
    from reobserve_papers.plotting.style_sheet import use_sheet

    use_sheet(style)
    results = Results.read(PackagedTask.read(task_file), table, tuned)
    names = dict.fromkeys(output.stem for output in outputs)
    refuse_unknown("--outputs", names, FIGURES)
    for name in names:
        figure = FIGURES[name](results)
        fix_layout(figure)
        for output in outputs:
            if output.stem == name:
                save(figure, output)


def table_command(folders: Sequence[Path], tasks: Path, tuned: Path, output: Path) -> None:
    """Write the table of all methods in Markdown, from folders of results named like tasks."""
    from reobserve.tuning.results import Results, summary

    tables = []
    known = [path.stem for path in tasks.glob("*.yaml")]
    refuse_unknown("folders", [folder.name for folder in folders], known)
    for folder in folders:
        task = PackagedTask.read(tasks / f"{folder.name}.yaml")
        tables.append(summary(Results.read(task, folder / "table.csv", tuned / folder.name)))
    write_text(output, "\n".join(tables))
