"""The commands `figdiff` and `accept` on a small made-up paper."""

from __future__ import annotations

import re
import shutil
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from reobserve.core.errors import ReobserveError
from reobserve.core.files import read_rows, write_table, write_text
from reobserve_papers.claims.claims_table import HEADER
from reobserve_papers.claims.title import row_as_stated, write_alternatives
from reobserve_papers.cli.main import main
from reobserve_papers.figure_diff import build_comparison, figdiff_commands
from reobserve_papers.figure_diff.build_comparison import Item
from reobserve_papers.figure_diff.page import render, summary
from reobserve_papers.golden import acceptance, golden_bench
from reobserve_papers.golden.comparison import Moved
from reobserve_papers.golden.values import built_numbers, part_names
from reobserve_papers.metrics.metrics import Metric, write_metrics
from reobserve_papers.parameters.parameters import Parameters
from reobserve_papers.plotting.figures import new_figure
from reobserve_papers.plotting.formats import save
from reobserve_papers.signals.series import Channel, Series
from tests.reobserve_papers.pipeline.conftest import ROOT

TREE = {
    "about": {"title": "Made", "authors": [], "package": "made"},
    **{name: {} for name in ("plant", "metrics", "theory")},
    "scenarios": {"slow": {"title": ""}},
    "observers": {"watch": {"algorithm": "watch", "label": ""}},
    "figures": {
        "fig1": {
            "title": "", "source": "", "layout": "", "scenario": "slow", "observers": ["watch"],
        }
    },
    "designs": {"gains": {"title": ""}},
    "tables": {"table1": {"title": "", "source": "", "design": "gains"}},
}  # fmt: skip
PARAMETERS = Parameters("made", TREE, 0)
BUILD = figdiff_commands._build
TIME = np.arange(41) * 0.05
BUILT, GOLDEN, ACCEPTED = "results/made", "tests/golden/made", "tests/reference/made"


def draw(path: str, label: str = "state x") -> None:
    figure, (axes,) = new_figure((1.2,))
    axes.plot(TIME, np.sin(TIME))
    axes.set_ylabel(label)
    save(figure, Path(path))


def record(name: str, offset: float = 0.0) -> None:
    Series(TIME, {"x": Channel(np.cos(TIME) + offset, "1")}).write(f"{BUILT}/slow/{name}.parquet")


def git(*arguments: str) -> str:
    command = ["git", "-c", "user.name=t", "-c", "user.email=t@example.org", *arguments]
    return subprocess.run(command, check=True, capture_output=True, text=True).stdout


def commit() -> None:
    git("add", "--all")
    git("commit", "--quiet", "--message", "all")


@pytest.fixture(autouse=True)
def project(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A committed project in which everything built is accepted; commands run in it."""
    monkeypatch.chdir(tmp_path)
    for name in ("workflow/report/figure_diff.html.jinja", "workflow/report/figure_diff.css"):
        write_text(name, (ROOT / name).read_text(encoding="utf-8"))
    draw(f"{BUILT}/fig1.png")
    write_metrics(f"{BUILT}/fig1.metrics.csv", [Metric("watch", "rms", 0.5, "1")])
    write_metrics(f"{BUILT}/theory.metrics.csv", [Metric("gain", "pole", -2.0, "1/s")])
    write_table(f"{BUILT}/table1.csv", [{"term": "x1", "value": 2.5}], ("term", "value"))
    record("plant")
    record("watch")
    write_text(f"{BUILT}/parameters.json", PARAMETERS.text())
    claim = {
        "paper": "made",
        "claim": "is_stable",
        "verdict": "reproduced",
        "holds": "yes",
        "promised": "abstract",
    }
    write_table("results/claims.csv", [dict.fromkeys(HEADER, "") | claim], HEADER)
    stated = row_as_stated("[Re]", ["is_stable"])
    promised = {**stated, "kind": "main", "claim": "is_stable", "verdict": "reproduced"}
    write_alternatives(f"{BUILT}/alternatives.csv", [stated, promised])
    write_text("README.md", "# Made\n<!-- verdicts -->\nold\n<!-- end -->\nmore\n")
    write_text("config/papers/made.yaml", "")
    write_text("config/config.yaml", "seed: 0\n")
    write_text(".gitignore", "results\nfigdiff\n")
    git("init", "--quiet")
    commit()

    def measure(*arguments: object) -> object:
        same = {part: built_numbers(Path(BUILT), TREE, part) for part in part_names(TREE)}
        return [same, same]

    monkeypatch.setenv("CI", "")
    monkeypatch.setattr(figdiff_commands, "_build", lambda *arguments: None)
    monkeypatch.setattr(Parameters, "load", lambda *arguments, **options: PARAMETERS)
    monkeypatch.setattr(acceptance, "measure", measure)
    assert main(["accept", "--reason", "a paper is new"]) == 0
    commit()


def text(name: str) -> str:
    return Path(name).read_text(encoding="utf-8")


def rewrite(name: str, old: str, new: str) -> Callable[[], None]:
    def change() -> None:
        if "sha256:" not in text(name):
            write_text(name, text(name).replace(old, new))
            return
        header, lines = read_rows(name)
        rows = [[one.replace(old, new) for one in line] for line in lines]
        write_table(name, [dict(zip(header, row, strict=True)) for row in rows], header, seal=True)

    return change


def test_agreement_prints_nothing(capsys: pytest.CaptureFixture[str]) -> None:
    capsys.readouterr()
    rewrite(f"{BUILT}/fig1.metrics.csv", "0.5", "0.5000000000001")()
    assert main(["figdiff"]) == 0
    said = capsys.readouterr()
    lines = said.out.splitlines()
    assert lines[0] == "4 figures, tables, theories and papers' claims: 4 agree"
    assert lines[1:] == [
        "- not checked: whether these are up to date, which only a build in `results` tells"
    ]
    assert text("figdiff/summary.md") == said.out
    page = text("figdiff/index.html")
    assert "data:image/png" not in page
    assert "made fig1, made table1" in page
    assert not re.search(r"(?:src|href)=\"(?!data:|#)|https?:|url\(", page)


@pytest.mark.parametrize(
    ("change", "verdict", "said"),
    [
        (rewrite(f"{BUILT}/fig1.metrics.csv", "0.5", "0.6"), "fig1: moved",
         "made fig1, watch rms: golden 0.5, found 0.6 (+20 %, 2e+11 times what is allowed)"),
        (lambda: record("watch", 1e-6), "fig1: moved", "fig1, watch x at 0.05 s: golden 0.9987"),
        (lambda: draw(f"{BUILT}/fig1.png", "state y"), "fig1: moved", "    - RMS "),
        (lambda: write_text(f"{ACCEPTED}/fig1.png", "no"), "fig1: not compared", "no image"),
        (rewrite(f"{BUILT}/table1.csv", "2.5", "2.6"), "table1: moved", "row 1 value: golden 2.5"),
        (rewrite("results/claims.csv", "reproduced", "contradicted"), "claims: moved",
         "made is_stable, verdict: golden reproduced, found contradicted"),
        (lambda: Path(BUILT, "fig1.png").unlink(), "fig1: not compared", "figure was not built"),
        (lambda: Path(GOLDEN, "theory.csv").unlink(), "theory: not compared", "cannot be read"),
        (lambda: Path(BUILT, "parameters.json").unlink(), "theory: not compared", "parameters"),
        (lambda: shutil.copy(f"{GOLDEN}/fig1.csv", f"{GOLDEN}/old.csv"), "old: not compared",
         "is not in the parameter file"),
    ],
)  # fmt: skip
def test_differences_are_reported_and_plotted(
    capsys: pytest.CaptureFixture[str], change: Callable[[], object], verdict: str, said: str
) -> None:
    change()
    assert main(["figdiff"]) == 1
    printed = capsys.readouterr()
    assert said in printed.out
    assert text("figdiff/summary.md") == printed.out
    assert "not agree with what was accepted; see figdiff/index.html" in printed.err
    shown = verdict.replace(": ", ': <span class="verdict">')
    assert shown in text("figdiff/index.html")


def test_accept_refuses_unsafe_calls(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    def refused(reason: str = "a good reason", *papers: str) -> str:
        assert main(["accept", *papers, "--reason", reason]) == 1
        return capsys.readouterr().err

    assert "must say in three words" in refused("because")
    with pytest.raises(ReobserveError, match="nothing is accepted: the build failed"):
        BUILD(Path(), [], 1)  # there is no Snakefile
    assert "there is no 'nobody'" in refused("a good reason", "nobody")
    Path("new.txt").touch()
    assert "1 uncommitted changes, the first is 'new.txt'" in refused()
    Path(".git").rename("git")
    assert "accepted in a git checkout" in refused()
    Path("git").rename(".git")
    with monkeypatch.context() as without:
        without.setenv("PATH", "")
        assert "accepted with git, which is not on the PATH" in refused()
    monkeypatch.setenv("GIT_TEST_ASSUME_DIFFERENT_OWNER", "1")
    assert "1 uncommitted changes" in refused()
    monkeypatch.setenv("CI", "true")
    assert "nothing is accepted in CI" in refused()


def test_accept_updates_changed_numbers_and_stores_the_reason(
    capsys: pytest.CaptureFixture[str],
) -> None:
    draw(f"{BUILT}/fig1.png", "state y")
    assert main(["figdiff"]) == 1
    assert text("figdiff/index.html").count("data:image/png") == 3  # accepted, new, difference
    rewrite(f"{BUILT}/theory.metrics.csv", "-2.0", "-3")()
    for path in ("results/claims.csv", f"{BUILT}/alternatives.csv"):
        rewrite(path, "reproduced", "contradicted")()
    shutil.copy(f"{ACCEPTED}/fig1.png", f"{ACCEPTED}/old.png")
    commit()
    assert main(["accept", "made", "--reason", "the axis has another name"]) == 0
    said = capsys.readouterr().out
    for line in ("theory, gain pole: golden -2, found -3", "is_stable,", "fig1: RMS", "old: rem"):
        assert f"\nmade {line}" in said
    assert git("diff", "--name-only", "HEAD").split() == [
        "README.md", "tests/golden/REASONS.md", "tests/golden/claims.csv", f"{GOLDEN}/theory.csv",
        f"{ACCEPTED}/fig1.png", f"{ACCEPTED}/old.png",
    ]  # fmt: skip
    reasons = text("tests/golden/REASONS.md")
    assert reasons.endswith("the axis has another name (2 numbers and 2 figures moved)\n")
    assert "[Re]" in text("README.md")
    assert main(["figdiff"]) == 0


def test_accept_builds_the_bench_unless_papers_are_named(monkeypatch: pytest.MonkeyPatch) -> None:
    asked = []

    def run(command: list[str], **options: object) -> object:
        asked.append(command[5:])
        return subprocess.CompletedProcess(command, 0)

    monkeypatch.setattr(subprocess, "run", run)
    BUILD(Path(), [], 1)
    BUILD(Path(), ["made"], 1)
    BUILD(Path(), [], 1, [("made", "fig1"), ("made", "table1"), ("made", "theory")])
    files = ["fig1.metrics.csv", "fig1.png", "table1.csv", "theory.metrics.csv"]
    assert asked == [
        ["bench"], [], ["--config", "papers=[made]"], [f"{BUILT}/{name}" for name in files],
    ]  # fmt: skip


@pytest.mark.parametrize("failed", [0, 1])
@pytest.mark.parametrize(
    ("named", "built"),
    [
        ([], [["bench"], []]),
        (["made"], [["--config", "papers=[made]"]]),
        (["made/fig1"], [[f"{BUILT}/fig1.metrics.csv", f"{BUILT}/fig1.png"]]),
        (["made/table1"], [[f"{BUILT}/table1.csv"]]),
        (["made/theory"], [[f"{BUILT}/theory.metrics.csv"]]),
        (["made/tabel1"], []),
    ],
)
def test_comparison_builds_what_it_compares(
    named: list[str], built: list[list[str]], failed: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Also if a job fails: the rest is compared."""
    asked = []

    def run(command: list[str], **options: object) -> object:
        asked.append(command)
        return subprocess.CompletedProcess(command, failed)

    monkeypatch.setattr(figdiff_commands, "_build", BUILD)
    monkeypatch.setattr(subprocess, "run", run)
    assert main(["figdiff", *named, "--cores", "3"]) == (not built)
    start = [sys.executable, "-m", "snakemake", "--cores", "3", "--keep-going"]
    assert asked == [[*start, *one] for one in built]


def test_make_compares_what_is_named() -> None:
    for paper, words in {"": "", "PAPER=ilo": " ilo", "PAPER=ilo/fig2": " ilo/fig2"}.items():
        quiet = ("--dry-run", "--no-print-directory")
        command = ["make", *quiet, "figdiff", "CORES=3", *filter(None, [paper])]
        done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=True)
        last = done.stdout.rstrip().splitlines()[-1]
        assert " ".join(last.split()) == f"reobserve-papers figdiff{words} --cores 3"


def test_one_figure_is_compared_and_accepted_alone(capsys: pytest.CaptureFixture[str]) -> None:
    rewrite(f"{BUILT}/fig1.metrics.csv", "0.5", "0.6")()
    rewrite(f"{BUILT}/theory.metrics.csv", "-2.0", "-3")()
    assert main(["figdiff", "made/table1"]) == 0
    assert main(["figdiff", "made/fig1", "made/table1"]) == 1
    assert "1 moved, 1 agree" in capsys.readouterr().out
    Path("results/claims.csv").rename("claims.csv")  # which says nothing of a figure
    assert main(["figdiff", "made/table1"]) == 0
    Path("claims.csv").rename("results/claims.csv")
    assert main(["figdiff", "made/fig2"]) == 1
    assert "made: there is no 'fig2'; did you mean 'fig1'?" in capsys.readouterr().err
    assert main(["accept", "made/fig1", "--reason", "one figure is new"]) == 0
    assert git("diff", "--name-only", "HEAD").split() == [
        "tests/golden/REASONS.md", f"{GOLDEN}/fig1.csv",
    ]  # fmt: skip
    assert main(["figdiff", "made"]) == 1
    said = capsys.readouterr().out
    assert "1 moved, 3 agree" in said
    assert "theory: moved" in said


def test_result_that_a_build_would_make_again_agrees_with_nothing(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    Path("Snakefile").touch()
    stale = {Path(f"{BUILT}/fig1.metrics.csv"): "params changed"}
    monkeypatch.setattr(build_comparison, "out_of_date", lambda *arguments, **options: stale)
    assert main(["figdiff"]) == 1
    said = capsys.readouterr().out
    assert "2 not up to date, 2 agree" in said  # and the claims that it decides
    assert "made fig1: not up to date\n    - a build would make it again: params changed" in said
    assert "Not up to date: a build would make it again" in text("figdiff/index.html")
    stale.clear()
    stale[Path(f"{BUILT}/alternatives.csv")] = "code changed"
    assert main(["figdiff", "made"]) == 1
    assert "made claims: not up to date" in capsys.readouterr().out
    assert main(["figdiff", "--results", "./results/../results", "made/fig1"]) == 0
    stale[Path(f"{BUILT}/alternatives.csv")] = "updated input files"  # its samples were cached
    assert main(["figdiff", "made"]) == 0
    stale[Path(f"{BUILT}/theory.metrics.csv")] = "updated input files"
    assert main(["figdiff", "made"]) == 1
    assert "2 not up to date" in capsys.readouterr().out


def test_summary_is_short_and_has_the_largest_change_first(
    capsys: pytest.CaptureFixture[str],
) -> None:
    rows = [Metric("watch", f"score{k}", 1.0, "m/s") for k in range(12)]
    write_metrics(f"{BUILT}/fig1.metrics.csv", rows)
    assert main(["accept", "--reason", "many scores are new"]) == 0
    commit()
    rows[7] = Metric("watch", "score7", 4.3, "m/s")
    for k in (2, 3, 4):
        rows[k] = Metric("watch", f"score{k}", 1.02, "m/s")
    write_metrics(f"{BUILT}/fig1.metrics.csv", rows)
    rewrite(f"{BUILT}/theory.metrics.csv", "-2.0", "-2.0001")()
    capsys.readouterr()
    assert main(["figdiff"]) == 1
    lines = capsys.readouterr().out.splitlines()
    first = next(k for k, line in enumerate(lines) if line == "- made fig1: moved")
    assert "score7: golden 1, found 4.3 m/s (x 4.3, " in lines[first + 1]
    assert lines[first + 4] == "    - and 1 more number"
    assert lines[first + 5] == "- made theory: moved"
    many = [Item("made", f"fig{k}", moved=[Moved("a", "1", "2")]) for k in range(40)]
    assert len(summary(many, []).splitlines()) == 30
    assert summary(many, []).splitlines()[-1] == "- and 26 more, on the page"


def test_every_number_that_moved_is_on_the_page_by_its_name() -> None:
    """All items have their rows, also those that the summary leaves out."""
    moved = [Moved(f"made fig{k}, watch score{k}", "1", "2", "0.1", "m", k) for k in range(40)]
    parts = [Item("made", "fig0", moved=moved)]
    parts += [Item("made", f"fig{k}", moved=[moved[k]]) for k in range(1, 40)]
    page = render(parts, [], ROOT / "workflow/report")
    for k, one in enumerate(moved):
        assert page.count(f"<td>{one.place}</td>") == (2 if k else 1)
    assert page.count("<td>x 2</td>") == 79


def test_parameters_that_changed_since_the_acceptance_are_named(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Also after a revert, and where the history of git is lost."""

    def state(gain: float) -> None:
        entry = {"value": gain, "unit": "1", "source": "assumed"}
        tree = {**TREE, "plant": {"gain": entry, "linked": {"same_as": "plant.gain"}}}
        stated = Parameters("made", tree, 0)
        monkeypatch.setattr(
            figdiff_commands.Parameters, "load", lambda *arguments, **options: stated
        )

    def since() -> str:
        said = main(["figdiff"]), capsys.readouterr().out
        assert said[0] == 1
        return re.findall("made, since the acceptance: (.*)|$", said[1])[0]

    state(5000)
    assert main(["accept", "--reason", "the gain is stated"]) == 0
    commit()
    state(4900)
    rewrite(f"{BUILT}/theory.metrics.csv", "-2.0", "-3")()
    assert since() == "plant.gain 5000 -> 4900"
    assert main(["accept", "--reason", "the gain is smaller"]) == 0
    commit()
    rewrite(f"{BUILT}/theory.metrics.csv", "-3", "-4")()
    assert since() == ""
    git("revert", "--no-edit", "HEAD")
    assert since() == "plant.gain 5000 -> 4900"
    state(5000)
    assert since() == ""
    shutil.rmtree(".git")
    state(4900)
    assert since() == "plant.gain 5000 -> 4900"


def test_commit_is_said_to_be_changed(capsys: pytest.CaptureFixture[str]) -> None:
    rewrite(f"{BUILT}/theory.metrics.csv", "-2.0", "-3")()
    commit_line = r"computed at [0-9a-f]{12}{} on "
    for changed in ("", ", with changes that are not committed"):
        assert main(["figdiff"]) == 1
        pattern = commit_line.replace("{}", changed)
        assert re.search(pattern, capsys.readouterr().out)
        write_text("new.txt", "new")


def test_claims_that_lack_samples_come_last_and_keep_their_verdicts(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """A build with few samples decides less than what was accepted; that overturns nothing."""
    asked: list[set[str]] = []

    def sample(project: Path, parameters: Parameters, undecided: set[str], seconds: float) -> bool:
        asked.append(undecided)
        return True

    monkeypatch.setattr(figdiff_commands, "claims_file", lambda *arguments: Path("README.md"))
    monkeypatch.setattr(figdiff_commands, "sample_again", sample)
    rewrite("results/claims.csv", "reproduced", "undecided")()
    rewrite(f"{BUILT}/alternatives.csv", "reproduced", "undecided")()
    rewrite(f"{BUILT}/theory.metrics.csv", "-2.0", "-3")()
    lack = "1 claim lacks samples: `make samples PAPER=made` (is_stable)"
    for _ in range(2):
        assert main(["figdiff"]) == 1
        said = capsys.readouterr().out
        assert said.endswith(f"\n- made claims: {lack}\n")
        assert lack in text("figdiff/index.html")
        assert "undecided" not in said
        assert said.count("moved") == (2 if not asked else 0)
        if not asked:
            assert main(["accept", "--reason", "the gain is smaller"]) == 0
            assert "made is_stable: reproduced, not sampled since" in capsys.readouterr().out
            commit()
    assert asked == [{"is_stable"}]
    assert 'made,is_stable,"reproduced, not sampled since",yes' in text("tests/golden/claims.csv")
    assert "| `made` | [Re] | 1 of 1 | 0 |" in text("README.md")
    rewrite("results/claims.csv", "undecided", "reproduced")()
    assert main(["figdiff"]) == 0
    rewrite("results/claims.csv", "reproduced", "contradicted")()
    assert main(["figdiff"]) == 1
    said = capsys.readouterr().out
    assert "is_stable, verdict: golden reproduced, not sampled since, found contradicted" in said


def test_claim_that_enough_samples_leave_undecided_has_moved(
    capsys: pytest.CaptureFixture[str],
) -> None:
    """By the convention 400 are enough."""
    claim = {"paper": "made", "claim": "is_stable", "verdict": "undecided", "holds": "yes"}
    for samples, said in (("399", "1 claim lacks samples"), ("400", "found undecided")):
        row = dict.fromkeys(HEADER, "") | claim | {"samples": samples}
        write_table("results/claims.csv", [row], HEADER)
        assert main(["figdiff"]) == 1
        assert said in capsys.readouterr().out


def bench(error: str = "0.25", within: str = "yes") -> None:
    """A task of the bench with one method, built."""
    write_text("config/bench/level.yaml", "")
    header = "condition,method,training,given_noise,error,within,repeat_low"
    write_text(
        "results/bench/level/table.csv", f"{header}\nnominal,ekf,tuned,no,{error},{within},\n"
    )


def test_results_of_the_bench_are_compared_and_accepted(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(golden_bench, "measure", lambda *arguments: {})
    bench()
    draw("results/bench/level/heatmap.png")
    assert main(["figdiff"]) == 1
    assert "bench level_heatmap: not compared\n    - there is no accepted figure" in (
        capsys.readouterr().out
    )
    commit()
    assert main(["accept", "--reason", "a task is new"]) == 0
    assert "bench level: new\nbench/level heatmap: the figure is new" in capsys.readouterr().out
    commit()
    bench("0.25001")  # by rounding
    assert main(["figdiff"]) == 0
    bench("0.2501", "no")
    assert main(["figdiff"]) == 1
    said = capsys.readouterr().out
    place = "bench level, ekf {} in nominal, training tuned, given noise no: golden"
    assert f"{place.format('error')} 0.25, found 0.2501 (+0.04 %, 4 times" in said
    assert f"{place.format('within')} yes, found no" in said
    shutil.rmtree("results/bench")  # no build is no agreement
    assert main(["figdiff"]) == 1
    assert "bench level: not compared" in capsys.readouterr().out
    write_text("config/config.yaml", "seed: 0\npapers: [made]\n")  # then there is nothing to build
    assert main(["figdiff"]) == 0
    commit()
    assert main(["accept", "made", "--reason", "nothing is new here"]) == 0
    assert text("tests/golden/bench/level.csv").endswith("0.25,yes,\n")
