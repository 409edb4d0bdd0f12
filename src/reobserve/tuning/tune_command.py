"""The command `reobserve tune`."""

from __future__ import annotations

import sys
from pathlib import Path

from reobserve.core.files import check_not_read, check_replaceable, read_text, write_text


def run(tune_file: Path, output: Path) -> None:
    """Tune specifications on records. Write them, their scores on held-out segments and a table."""
    from reobserve.tuning.recorded import RecordedTask
    from reobserve.tuning.results import Results, read_cells, summary, write_cells, write_scores
    from reobserve.tuning.scoring import score_task
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
        tuned[name] = tune_method(task, name, tell)
        (repeat,) = tuned[name].training[task.main].repeats
        settings[name] = repeat.settings
        assert method.paper is not None  # the numbers as specified
        if repeat.objective >= objective(task, name, task.main, 0, method.paper.settings):
            tell(f"{name}: not better than as specified; raise the budget, or change the ranges")
    cells = score_task(task, tuned)
    write_scores(task, cells, scores)
    write_cells(cells, table)
    for name, path in files.items():
        write_text(path, task.specifications[name].text(settings[name]))
    write_text(text, summary(Results(task, read_cells(table), tuned)))
    print(read_text(text), end="")


def tell(line: str) -> None:
    """Report progress on standard error."""
    print(line, file=sys.stderr, flush=True)
