"""Figures of the bench whose numbers move within their tolerances."""

from __future__ import annotations

from pathlib import Path

import pytest

from reobserve.core.files import write_table
from reobserve.tuning.results import CELLS
from reobserve.tuning.tuned_file import Cost, Repeat, TunedMethod, TunedOn
from reobserve_papers.cli.main import main
from reobserve_papers.figure_diff.build_comparison import compare_task
from reobserve_papers.figure_diff.pixels import read_pixels
from reobserve_papers.golden import golden_bench
from tests.reobserve.tuning.toy import cell, toy

MOVED = ("share", "error in noise, training nominal, given noise no")


def stated(project: Path) -> None:
    """A task with settings of no tuning."""
    folder = project / "config/bench"
    folder.mkdir(parents=True)
    task, repeat = toy(folder), Repeat({}, 0.0, {}, {"10": 0.5})
    for name in task.methods:
        kept = {one: TunedOn(task.digest(name, one), [repeat]) for one in task.training}
        TunedMethod(kept, Cost(1.0, 1.0)).write(folder / f"tuned/toy/{name}.json")


def number(path: Path, error: float) -> None:
    path.parent.mkdir(parents=True)
    cells = [cell("nominal", "share"), cell("noise", "share", error=error, first=0.2)]
    write_table(path, cells, CELLS)


def test_figure_agrees_if_it_is_that_of_numbers_that_agree(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The largest number moves by a fifth per cent: the end of the axis moves, and all lines."""
    made: dict[bytes, bytes] = {}

    def called(task: str, module: str, *command: object) -> None:
        """In this process, and once for each table."""
        assert (task, module) == ("toy", "reobserve_papers")
        table, output = command[4], command[8]
        numbers = Path(str(table)).read_bytes()
        if numbers not in made:
            assert main([str(one) for one in command]) == 0
            made[numbers] = Path(str(output)).read_bytes()
        Path(str(output)).write_bytes(made[numbers])

    def verdicts() -> dict[str, str]:
        found = compare_task(tmp_path, tmp_path / "tests/reference", tmp_path / "results", "toy")
        return {item.name: item.verdict for item in found}

    monkeypatch.setattr(golden_bench, "run_module", called)
    stated(tmp_path)
    golden = golden_bench.golden_table(tmp_path, "toy")
    built = golden_bench.built_table(tmp_path / "results", "toy")
    old, new = tmp_path / "tests/reference/bench/toy/levels.png", built.with_name("levels.png")
    old.parent.mkdir(parents=True)
    for table, error, image in ((golden, 0.5, old), (built, 0.501, new)):
        number(table, error)
        task, tuned = tmp_path / "config/bench/toy.yaml", tmp_path / "config/bench/tuned/toy"
        options = ("--table", table, "--tuned", tuned, "--outputs", image)
        called("toy", "reobserve_papers", "bench", "plot", task, *options)
    assert verdicts() == {"toy": "moved", "toy_levels": "moved"}
    golden_bench._write_tolerances(tmp_path, "toy", {MOVED: 0.01})
    assert verdicts() == {"toy": "agrees", "toy_levels": "agrees"}
    # Another picture in place of one of the two is noticed.
    for image in (old, new):
        right = image.read_bytes()
        mirrored(image)
        assert verdicts() == {"toy": "agrees", "toy_levels": "moved"}
        image.write_bytes(right)


def mirrored(path: Path) -> None:
    from PIL import Image

    Image.fromarray(read_pixels(path)[:, ::-1].copy()).save(path)
