"""Golden numbers hold on other processors: emulated ones, and what is said where they do not."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from reobserve.errors import ReobserveError
from reobserve.evidence.golden import elsewhere, processors
from reobserve.evidence.golden.digests import FILE
from reobserve.evidence.golden.elsewhere import compare_elsewhere, gate_parts
from reobserve.evidence.golden.files import folder, read_metrics
from reobserve.evidence.golden.job import MovedByOneUlp
from reobserve.evidence.golden.kept import kept_parts, part_names
from reobserve.evidence.golden.processors import ONE_ULP, PINNED, REFINED, Condition
from reobserve.evidence.golden.runs import run_all
from reobserve.numerics.code_paths import ENABLED, KERNEL, unpinned
from reobserve.replication.evaluation import Evaluator
from tests.pipeline.conftest import LEDGERS, PAPERS, ROOT, copy_project


@pytest.mark.parametrize("paper", PAPERS)
def test_designs_and_a_figure_of_each_paper_hold_elsewhere(paper: str) -> None:
    """The part that every change is tried on; every night there is the whole."""
    command = ("golden", "elsewhere", "--part", "gate", "--papers", paper, "--cores", "1")
    done = subprocess.run(
        [sys.executable, "-m", "reobserve", *command],
        cwd=ROOT, env=unpinned(dict(os.environ)), capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stdout + done.stderr
    rows = re.findall(r"^(.+?)  +\d+ s +(\d+) numbers, +0 off; at most", done.stdout, re.MULTILINE)
    assert [name for name, _ in rows] == [one.name for one in processors.processors()[:2]]
    assert all(int(count) > 10 for _, count in rows)


def test_the_gate_has_all_designs_and_a_figure_of_each_paper() -> None:
    for paper in PAPERS:
        parts, tree = gate_parts(LEDGERS[paper]), LEDGERS[paper].tree
        assert set(parts) <= set(part_names(tree))
        assert next(iter(tree["figures"])) in parts
    assert gate_parts(LEDGERS["eso"]) == part_names(LEDGERS["eso"].tree)
    assert "table_coefficients" in gate_parts(LEDGERS["lie"])
    assert "theory" not in gate_parts(LEDGERS["ilo"])


def test_every_processor_has_its_own_code_paths(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(KERNEL, "Barcelona")
    monkeypatch.setattr(processors, "_X86", True)
    monkeypatch.setattr(processors, "processor_flags", lambda: {"avx", "avx2", "fma"})
    found = {one.name: one.environment() for one in processors.processors()}
    assert [name for name in found if name[0].isupper()] == [
        "Haswell", "Nehalem", "Sandybridge", "Prescott",
    ]  # fmt: skip
    free = found["this processor, nothing pinned"]
    assert KERNEL not in free
    assert ENABLED not in free
    assert found["Nehalem"]["NUMBA_CPU_NAME"] == "generic"
    assert "-FMA" in found["Nehalem"]["GLIBC_TUNABLES"]
    assert {one["PYTHONHASHSEED"] for one in found.values()} == {"0", "1"}
    monkeypatch.setattr(processors, "_X86", False)
    assert [one.name for one in processors.processors()] == [
        "this processor, nothing pinned", "one unit in the last place",
    ]  # fmt: skip


def test_one_unit_in_the_last_place_is_what_it_says() -> None:
    evaluator = MovedByOneUlp(LEDGERS["ilo"])
    step = ("plant", "constant")
    moved, plant = evaluator.run(*step), super(MovedByOneUlp, evaluator).run(*step)
    for name, values in plant.flat().items():
        off = np.abs(moved.flat()[name] - values)
        whole = values == np.round(values)
        assert np.all(off[whole] == 0)
        np.testing.assert_array_less(0, off[~whole])
        assert np.all(off <= np.spacing(np.abs(values)))
    assert any(np.any(values != np.round(values)) for values in plant.flat().values())


def test_processes_give_what_this_one_gives() -> None:
    order = {"ilo": ["fig1"]}
    pinned, refined = run_all(ROOT, order, [PINNED, REFINED], cores=2)
    here = kept_parts(Evaluator(LEDGERS["ilo"]), "fig1")
    there = pinned.papers["ilo"].parts
    assert list(there) == list(here)
    for part, kept in here.items():
        assert list(there[part].series) == list(kept.series)
        for name, number in kept.series.items():
            np.testing.assert_allclose(there[part].series[name].values, number.values, atol=1e-9)
    halved = refined.papers["ilo"].parts["fig1"].metrics["continuous:rms_error"]
    assert halved.values != there["fig1"].metrics["continuous:rms_error"].values
    assert next(iter(pinned.papers["ilo"].digests)) == "plant constant"


def test_a_number_that_is_off_elsewhere_fails(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    project = copy_project(tmp_path).folder
    golden = folder(project, "ilo")
    value = read_metrics(golden, "fig1")["continuous:rms_error"].text[0]
    text = (golden / "fig1.metrics.csv").read_text()
    (golden / "fig1.metrics.csv").write_text(text.replace(value, f"{float(value) * 2:.14g}", 1))
    stages = (golden / FILE).read_text()
    (golden / FILE).write_text(re.sub('("observe constant sampled": ")', r"\1x", stages))
    monkeypatch.setattr(elsewhere, "processors", lambda: [PINNED, ONE_ULP])
    with pytest.raises(ReobserveError, match=r"^2 golden numbers are off on other processors$"):
        compare_elsewhere(project, ["ilo"], gate=True, cores=2)
    said = capsys.readouterr().out
    assert "1 off; at most" in said
    assert "tolerances: ilo fig1, continuous:rms_error" in said
    assert said.startswith(f"{len(gate_parts(LEDGERS['ilo']))} figures, tables and theories of ilo")
    assert "the first is `" in said  # here or before it, on another machine than the digests'


def test_what_cannot_be_evaluated_is_one_sentence(tmp_path: Path) -> None:
    with pytest.raises(ReobserveError, match=r"^Haswell: .*config\.yaml: cannot be read") as caught:
        run_all(tmp_path, {"ilo": None}, [Condition("Haswell")], cores=1)
    assert "\n" not in str(caught.value)
