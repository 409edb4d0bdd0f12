"""The figure diff from end to end, on a small made-up paper: what it says, and what it accepts."""

from __future__ import annotations

import json
import re
import shutil
import subprocess
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from playwright.sync_api import Browser

from reobserve.cli import main
from reobserve.drawing.figures import STYLES, new_figure
from reobserve.drawing.fitting import fix_layout
from reobserve.drawing.formats import save
from reobserve.errors import InputError, ReobserveError
from reobserve.evidence.claims.table import HEADER
from reobserve.evidence.figure_diff import commands, page, plot_moved
from reobserve.evidence.figure_diff.model import Diff, Item, MovedSeries, Origin
from reobserve.evidence.figure_diff.origin import origin_here, write_origin
from reobserve.evidence.figure_diff.project_copy import build, copy_project
from reobserve.evidence.golden import claims as golden_claims
from reobserve.evidence.golden import kept as golden_kept
from reobserve.evidence.golden import tables as golden_tables
from reobserve.evidence.golden.kept import kept_paper
from reobserve.evidence.golden.renewal import Evidence, prepare
from reobserve.ledger.ledger import Ledger
from reobserve.plain_data.files import write_table
from reobserve.replication.evaluation import Evaluator, Replication
from reobserve.scoring.metrics import Metric, write_metrics
from reobserve.timeseries.series import Channel, Series
from tests.browser import browser  # noqa: F401
from tests.pipeline.conftest import ROOT

TREE = {
    **{name: {} for name in ("about", "plant", "metrics", "theory")},
    "scenarios": {"slow": {}},
    "designs": {"gains": {}},
    "observers": {"watch": {"design": "gains"}},
    "figures": {
        name: {"scenario": "slow", "observers": ["watch"]} for name in ("fig1", "fig2")
    },
    "tables": {"table1": {"design": "gains"}},
}  # fmt: skip
LEDGER = Ledger("made", TREE, 0)
TIME = np.arange(41) * 0.05
TABLE = SimpleNamespace(HEADER=("term", "value"), KINDS={})


@dataclass
class Made(Evaluator):
    """A paper of two figures with the same series, a table and a theory."""

    ledger: Ledger = LEDGER
    _done: dict[str, Any] = field(default_factory=dict)

    def figure(self, figure: str) -> Replication:
        plant = Series(TIME, {"x": Channel(np.sin(TIME), "1")})
        watch = Series(TIME, {"x": Channel(np.cos(TIME), "1")})
        return Replication(
            self.ledger, figure, plant, {"watch": watch}, None, [Metric("watch", "rms", 0.5, "1")]
        )

    def table(self, table: str) -> list[dict[str, Any]]:
        return [{"term": "x1", "value": 2.5}]

    def theory(self) -> list[Metric]:
        return [Metric("law", "pole", -2.0, "1/s")]


def draw(path: Path, label: str = "state x") -> None:
    figure, (axes,) = new_figure((1.2,))
    axes.plot(TIME, np.sin(TIME), **STYLES[0].line())
    axes.set_ylabel(label)
    fix_layout(figure)
    save(figure, path)


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A project in which everything built is what was accepted."""
    project = tmp_path_factory.mktemp("project")
    made, kept, results = Made(), project / "tests/golden/made", project / "results/made"
    (project / "workflow/report").mkdir(parents=True)
    (project / "config/papers").mkdir(parents=True)  # or it is no project
    for template in ("workflow/report/figure_diff.html.jinja", "workflow/report/figure_diff.css"):
        shutil.copy2(ROOT / template, project / template)
    for name in TREE["figures"]:
        draw(results / f"{name}.png")
        write_metrics(results / f"{name}.metrics.csv", made.figure(name).numbers)
    write_metrics(results / "theory.metrics.csv", made.theory())
    write_table(results / "table1.csv", made.table("table1"), TABLE.HEADER)
    with pytest.MonkeyPatch.context() as patch:
        for module in (golden_kept, golden_tables):
            patch.setattr(module, "paper_module", lambda paper, stage: TABLE)
        found = kept_paper(made)
        prepare("made", Evidence(found, [], found), kept).write()
    evaluation = made.figure("fig1")
    evaluation.plant.write(results / "slow/plant.parquet")
    evaluation.estimates["watch"].write(results / "slow/watch.parquet")
    (results / "parameters.json").write_text(LEDGER.text())
    for name in TREE["figures"]:
        (project / "tests/reference/made").mkdir(parents=True, exist_ok=True)
        shutil.copy2(results / f"{name}.png", project / "tests/reference/made")
    write_origin(project / "tests/reference", origin_here(project))
    claim = {"paper": "made", "claim": "law_holds", "verdict": "reproduced", "holds": "yes"}
    write_table(project / "results/claims.csv", [dict.fromkeys(HEADER, "") | claim], HEADER)
    golden_claims.renew(project, project / "results")
    (project / "results/verdicts.md").write_text("| made | [Re] |\n")
    (project / "README.md").write_text("# Made\n<!-- verdicts -->\nold\n<!-- end -->\nmore\n")
    return project


@pytest.fixture
def project(whole: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A copy to damage, in which commands run."""
    copy = tmp_path / "project"
    shutil.copytree(whole, copy)
    monkeypatch.chdir(copy)
    for module in (golden_kept, golden_tables):
        monkeypatch.setattr(module, "paper_module", lambda paper, stage: TABLE)
    return copy


def summary(project: Path) -> dict[str, Any]:
    found: dict[str, Any] = json.loads((project / "figdiff/summary.json").read_text())
    return found


def verdicts(project: Path) -> dict[str, str]:
    """What does not agree."""
    items = {item["name"]: item["verdict"] for item in summary(project)["items"]}
    assert set(items) >= {"fig1", "fig2", "table1", "theory", "claims"}
    return {name: verdict for name, verdict in items.items() if verdict != "agrees"}


def test_what_agrees_is_quiet(project: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["figdiff"]) == 0
    said = capsys.readouterr()
    assert said.out == "5 figures, tables, theories and papers' claims: 5 agree\n"
    assert said.err == ""
    assert verdicts(project) == {}
    assert summary(project)["agrees"] is True
    assert "5 compared: 5 agree." in (project / "figdiff/summary.md").read_text()
    page = (project / "figdiff/index.html").read_text()
    assert page.count("the same, pixel by pixel") == 2
    assert page.count("data:image/png") == 2  # each once, as it was accepted
    assert not re.search(r"(?:src|href)=\"(?!data:|#)|https?:|url\(", page)
    assert "nothing to compare" not in page


def test_other_times_versions_and_processors_are_told_and_quiet(project: Path) -> None:
    kept = project / "tests/reference/versions.json"
    kept.write_text(json.dumps({**json.loads(kept.read_text()), "numpy": "1.2|3"}))
    assert main(["figdiff"]) == 0
    assert "- numpy: 1.2\\|3, now " in (project / "figdiff/summary.md").read_text()
    assert "numpy (different)" in (project / "figdiff/index.html").read_text()


def rewrite_metric(value: str) -> Callable[[Path], None]:
    def rewrite(project: Path) -> None:
        path = project / "results/made/fig1.metrics.csv"
        path.write_text(path.read_text().replace(",0.5,", f",{value},"))

    return rewrite


def move_series(project: Path) -> None:
    series = Series(TIME, {"x": Channel(np.cos(TIME) + 1e-6 * np.isclose(TIME, 1.5), "1")})
    series.write(project / "results/made/slow/watch.parquet")


def shorten_series(project: Path) -> None:
    series = Series(TIME[:21], {"x": Channel(np.cos(TIME[:21]), "1")})
    series.write(project / "results/made/slow/watch.parquet")


def relabel(project: Path) -> None:
    draw(project / "results/made/fig1.png", "state y")


def change_table(project: Path) -> None:
    write_table(project / "results/made/table1.csv", [{"term": "x1", "value": 2.6}], TABLE.HEADER)


def change_theory(project: Path) -> None:
    write_metrics(project / "results/made/theory.metrics.csv", [Metric("law", "pole", -3, "1/s")])


def add_figure(project: Path) -> None:
    draw(project / "results/made/fig3.png")


def fail_to_draw(project: Path) -> None:
    (project / "results/made/fig1.png").unlink()
    log = project / "logs/made/fig1.plot.log"
    log.parent.mkdir(parents=True)
    log.write_text(
        "+ reobserve stage plot --outputs results/made/fig1.png\n"
        "reobserve: made.figures.fig1: <label> has no glyph\n"
    )


def fail_to_observe(project: Path) -> None:
    """Everything behind the observer is gone, whose log says why; the plot's is not there."""
    for name in (
        "fig1.png",
        "fig1.metrics.csv",
        "fig2.png",
        "fig2.metrics.csv",
        "slow/watch.parquet",
    ):
        (project / "results/made" / name).unlink()
    (project / "results/made/gains.design.json").touch()
    log = project / "logs/made/slow/watch.log"
    log.parent.mkdir(parents=True)
    log.write_text(
        "+ reobserve stage observe --output results/made/slow/watch.parquet\n"
        "reobserve: made.observers.watch diverged\n"
    )


def fail_to_design(project: Path) -> None:
    """Nothing that needs the design is there; its log ends with the sentence."""
    for name in ("fig1", "fig2"):
        (project / f"results/made/{name}.png").unlink()
        (project / f"results/made/{name}.metrics.csv").unlink()
    (project / "results/made/slow/watch.parquet").unlink()
    (project / "logs/made").mkdir(parents=True)
    (project / "logs/made/gains.design.log").write_text(
        "+ reobserve stage design --output results/made/gains.design.json\n"
        "Of what a library said,\n\n"
        "reobserve: made.designs.gains: has no solution\n"
    )


def lose_the_reference_of_what_moved(project: Path) -> None:
    rewrite_metric("0.6")(project)
    (project / "tests/reference/made/fig1.png").unlink()


def resize(project: Path) -> None:
    figure, _ = new_figure((1.5,))
    save(figure, project / "tests/reference/made/fig1.png")


def corrupt(name: str, content: str) -> Callable[[Path], None]:
    def write_it(project: Path) -> None:
        (project / name).write_text(content)

    return write_it


def remove(name: str) -> Callable[[Path], None]:
    return lambda project: (project / name).unlink()


KEPT, BUILT = "tests/golden/made", "results/made"


@pytest.mark.parametrize(
    ("change", "found", "said"),
    [
        (rewrite_metric("0.500000002"), {"fig1": "moved"}, "watch:rms: golden 0.5, found 0.5"),
        (rewrite_metric("nan"), {"fig1": "moved"}, "watch:rms: golden 0.5, found nan"),
        (
            move_series,
            {"fig1": "moved", "fig2": "moved"},
            "slow/watch, x at 1.5 s: golden 0.0707372017, found 0.0707382017, off by 1e-06",
        ),
        (
            shorten_series,
            {"fig1": "moved", "fig2": "moved"},
            "slow/watch, rows of x: golden 21, found 11",
        ),
        (relabel, {"fig1": "moved"}, "made fig1: moved"),
        (change_table, {"table1": "moved"}, "value in row 1: golden 2.5, found 2.6"),
        (change_theory, {"theory": "moved"}, "law:pole: golden -2, found -3"),
        (remove(f"{BUILT}/fig1.png"), {"fig1": "missing"}, "was not built, and no log says why"),
        (remove(f"{BUILT}/table1.csv"), {"table1": "missing"}, "was not built"),
        (fail_to_draw, {"fig1": "missing"}, "made.figures.fig1: <label> has no glyph"),
        (
            fail_to_observe,
            {"fig1": "missing", "fig2": "missing"},
            "made.observers.watch diverged",
        ),
        (
            fail_to_design,
            {"fig1": "missing", "fig2": "missing"},
            "  made.designs.gains: has no solution\n",
        ),
        (add_figure, {"fig3": "extra"}, "made fig3: extra"),
        (lose_the_reference_of_what_moved, {"fig1": "extra"}, "watch:rms: golden 0.5, found 0.6"),
        (remove(f"{KEPT}/fig1.metrics.csv"), {"fig1": "gap"}, "fig1.metrics.csv: cannot be read"),
        (remove("tests/reference/made/fig1.png"), {"fig1": "extra"}, "made fig1: extra"),
        (remove(f"{KEPT}/table1.csv"), {"table1": "extra"}, "made table1: extra"),
        (resize, {"fig1": "gap"}, "fig1: has 1056 x 248 pixels, the reference figure has 1056 x"),
        (corrupt("tests/reference/made/fig1.png", "no"), {"fig1": "gap"}, "fig1.png: is no pict"),
        (corrupt(f"{BUILT}/fig1.png", "no"), {"fig1": "gap"}, "fig1.png: is no picture"),
        (
            corrupt(f"{KEPT}/slow/watch.series.csv", "no"),
            {"fig1": "gap", "fig2": "gap"},
            "has the columns ['no']",
        ),
        (corrupt(f"{KEPT}/fig1.metrics.csv", ""), {"fig1": "gap"}, "has the columns []"),
        (
            remove(f"{KEPT}/slow/plant.tolerances.csv"),
            {"fig1": "gap", "fig2": "gap"},
            "cannot be read (No such file",
        ),
        (corrupt(f"{KEPT}/table1.csv", "a,b\n"), {"table1": "gap"}, "has the columns ['a', 'b']"),
        (corrupt(f"{KEPT}/theory.metrics.csv", "x"), {"theory": "gap"}, "has the columns ['x']"),
        (
            rewrite_metric("half"),
            {"fig1": "gap"},
            "fig1.metrics.csv: line 2, value: 'half' must be a number",
        ),
        (
            corrupt(f"{BUILT}/slow/watch.parquet", "no"),
            {"fig1": "gap", "fig2": "gap"},
            "watch.parquet: is damaged",
        ),
        (
            corrupt(f"{BUILT}/parameters.json", "{"),
            {"fig1": "gap", "fig2": "gap"},
            "parameters.json: is not JSON",
        ),
    ],
)
def test_what_does_not_agree_is_said_and_shown(
    project: Path,
    capsys: pytest.CaptureFixture[str],
    change: Callable[[Path], None],
    found: dict[str, str],
    said: str,
) -> None:
    change(project)
    assert main(["figdiff"]) == 1
    printed = capsys.readouterr()
    assert said in printed.out
    assert printed.err == (
        f"reobserve: {len(found)} do not agree with what was accepted; see figdiff/index.html\n"
    )
    assert verdicts(project) == found
    assert summary(project)["agrees"] is False
    for item in summary(project)["items"]:
        assert bool(item["why_missing"]) == (item["verdict"] == "missing"), item["name"]
    page = (project / "figdiff/index.html").read_text()
    for name, verdict in found.items():
        assert f'<h2>made {name}: <span class="verdict">{verdict}</span></h2>' in page
        assert f"| made {name} | {verdict} |" in (project / "figdiff/summary.md").read_text()
    others = {"fig1", "fig2", "table1", "theory"} - set(found)
    assert all(f"<summary>made {name}</summary>" in page for name in others)


def test_the_same_picture_is_shown_once_where_numbers_moved(project: Path) -> None:
    rewrite_metric("0.6")(project)
    assert main(["figdiff"]) == 1
    assert (project / "figdiff/index.html").read_text().count("data:image/png") == 2  # of 2 figures


def test_numbers_within_tolerance_are_quiet(project: Path) -> None:
    rewrite_metric("0.5000000000004")(project)
    series = Series(TIME, {"x": Channel(np.cos(TIME) + 9e-13, "1")})
    series.write(project / "results/made/slow/watch.parquet")
    assert main(["figdiff"]) == 0


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (corrupt("tests/reference/versions.json", "[]"), "versions.json: must be a mapping"),
        (remove("tests/reference/versions.json"), "versions.json: cannot be read"),
        (lambda project: shutil.rmtree(project / "results"), "there is no folder results"),
    ],
)
def test_a_gap_of_the_whole_fails_and_stands_on_the_page(
    project: Path, capsys: pytest.CaptureFixture[str], change: Callable[[Path], Any], said: str
) -> None:
    change(project)
    assert main(["figdiff"]) == 1
    assert said in capsys.readouterr().err
    assert said in (project / "figdiff/index.html").read_text()
    assert said in (project / "figdiff/summary.md").read_text()
    assert summary(project)["agrees"] is False


def test_a_browser_shows_every_picture(project: Path, browser: Browser) -> None:  # noqa: F811
    move_series(project)
    relabel(project)
    resize_other = project / "tests/reference/made/fig2.png"
    resize_other.write_bytes(b"no picture")
    assert main(["figdiff"]) == 1
    page = browser.new_page(viewport={"width": 1400, "height": 900})
    try:
        asked: list[str] = []
        page.on("request", lambda request: asked.append(request.url))
        page.goto((project / "figdiff/index.html").as_uri())
        shown = page.evaluate("Array.from(document.images, i => [i.alt, i.naturalWidth])")
        assert asked == [(project / "figdiff/index.html").as_uri()]
        assert all(width > 100 for _, width in shown)
        names = [name for name, _ in shown if name.startswith("made fig1")]
        assert names == [
            f"made fig1, {what}" for what in ("reference", "new", "difference", "series that moved")
        ]
        assert "made fig2, new" in dict(shown)
        assert "made fig2, reference" not in dict(shown)
        tops = page.evaluate(
            "Array.from(document.querySelectorAll('#made-fig1 .side img'), "
            "i => i.getBoundingClientRect().top)"
        )
        assert len(tops) == 3
        assert len(set(tops)) == 1  # side by side
    finally:
        page.close()


def git(project: Path, *arguments: str) -> str:
    return subprocess.run(
        ["git", "-c", "user.name=t", "-c", "user.email=t@example.org", *arguments],
        cwd=project, check=True, capture_output=True, text=True,
    ).stdout  # fmt: skip


@pytest.fixture
def checkout(project: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The project under git, with a build that takes what stands in a folder beside it."""
    monkeypatch.setenv("CI", "")
    (project / ".gitignore").write_text("results\nlogs\nfigdiff\n")
    git(project, "init", "--quiet")
    git(project, "add", "--all")
    git(project, "commit", "--quiet", "--message", "all")

    def stand_in(folder: Path, project: Path, cores: int, log: Path, papers: Sequence[str]) -> bool:
        assert not (folder / "results").exists()
        shutil.copytree(project / "results", folder / "results")
        return (folder / "results/made/fig1.png").exists()

    monkeypatch.setattr(commands, "build", stand_in)
    monkeypatch.setattr(commands, "known_papers", lambda project: ["made"])
    monkeypatch.setattr(commands, "write_lists", lambda project: None)
    monkeypatch.setattr(commands.Ledger, "load", lambda *arguments, **options: LEDGER)
    monkeypatch.setattr(commands, "renew", lambda project, papers, cores: ["made fig1, x: moved"])
    return project


def temporary(folder: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Where this process puts its temporary folders from now on."""
    folder.mkdir()
    monkeypatch.setattr("tempfile.tempdir", str(folder))
    return folder


def test_a_build_elsewhere_is_compared_and_leaves_nothing(
    checkout: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:  # fmt: skip
    folder = temporary(tmp_path / "temporary", monkeypatch)
    assert main(["figdiff", "--build", "--cores", "1"]) == 0
    (checkout / "results/made/fig1.png").unlink()
    assert main(["figdiff", "--build"]) == 1
    assert "the build failed in part; figdiff/build.log" in capsys.readouterr().err
    assert verdicts(checkout) == {"fig1": "missing"}
    assert list(folder.iterdir()) == []


def test_accepting_is_guarded(
    checkout: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    relabel(checkout)

    def refused(reason: str = "a good reason") -> str:
        assert main(["accept", "--reason", reason]) == 1
        assert git(checkout, "status", "--porcelain", "tests") == ""
        return capsys.readouterr().err

    assert "must say in three words" in refused("because")
    with monkeypatch.context() as context:
        context.setenv("CI", "true")
        assert "not renewed in CI" in refused()
    (checkout / "new.txt").touch()
    assert "1 uncommitted changes, the first is 'new.txt'" in refused()
    (checkout / "new.txt").unlink()
    (checkout / "results/made/fig1.png").unlink()
    assert "nothing is accepted: the build failed" in refused()


def test_accepting_renews_and_keeps_the_reason(
    checkout: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    relabel(checkout)
    kept = checkout / "tests/reference/versions.json"
    kept.write_text("{}")
    (checkout / "results/made/fig2.png").unlink()
    (checkout / "tests/golden/made/slow/gone.series.csv").touch()
    git(checkout, "add", "--all")
    git(checkout, "commit", "--quiet", "--message", "gone")
    assert main(["accept", "--reason", "the axis has another name"]) == 0
    said = capsys.readouterr().out
    assert "made fig1, x: moved\n" in said
    assert re.search(r"made fig1: RMS [\d.]+ grey levels, least local similarity [-\d.]+\n", said)
    assert "made fig2: taken out, it is built no longer\n" in said
    reference = checkout / "tests/reference/made"
    assert [path.name for path in reference.iterdir()] == ["fig1.png"]
    built = checkout / "results/made/fig1.png"
    assert (reference / "fig1.png").read_bytes() == built.read_bytes()
    assert not (checkout / "tests/golden/made/slow/gone.series.csv").exists()
    assert (checkout / "tests/golden/made/slow/watch.series.csv").exists()
    log = (checkout / "tests/golden/REASONS.md").read_text()
    assert log.endswith("the axis has another name (1 numbers and 2 figures moved)\n")
    assert Origin(json.loads(kept.read_text())) == origin_here(checkout)
    readme = (checkout / "README.md").read_text()
    assert readme == "# Made\n<!-- verdicts -->\n\n| made | [Re] |\n\n<!-- end -->\nmore\n"


def test_one_paper_is_accepted_and_the_others_left(
    checkout: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Another one has figures, golden numbers and verdicts, and nothing built."""
    monkeypatch.setattr(commands, "known_papers", lambda project: ["made", "other"])
    relabel(checkout)
    told = "| paper |\n|---|\n| `made` | [Re] |\n\n`made`\n\na picture\n"
    (checkout / "results/verdicts.md").write_text(told)
    others = [checkout / f"tests/{kind}/other/fig1.{kind}" for kind in ("reference", "golden")]
    for path in others:
        path.parent.mkdir()
        path.touch()
    verdicts = checkout / "tests/golden/claims.csv"
    verdicts.write_text(verdicts.read_text() + "other,a_claim,contradicted,no\n")
    git(checkout, "add", "--all")
    git(checkout, "commit", "--quiet", "--message", "another paper")
    before = verdicts.read_text()
    assert main(["accept", "nobody", "--reason", "there is no such paper"]) == 1
    assert "paper: there is no 'nobody'" in capsys.readouterr().err
    assert main(["accept", "made", "--reason", "the axis has another name"]) == 0
    said = capsys.readouterr().out
    assert "building made from nothing" in said
    assert "made fig1: RMS " in said
    assert "other" not in said
    assert all(path.exists() for path in others)
    assert verdicts.read_text() == before
    (checkout / "tests/reference/versions.json").write_text('{"numpy": "1.2"}')
    git(checkout, "add", "--all")
    git(checkout, "commit", "--quiet", "--message", "another origin")
    assert main(["accept", "made", "--reason", "the axis has another name"]) == 1
    said = capsys.readouterr().err
    assert "the reference figures were made under numpy 1.2, not " in said
    assert "accept all papers together" in said


def rewrite(path: Path, old: str, new: str) -> None:
    text = path.read_text(encoding="utf-8")
    assert old in text
    path.write_text(text.replace(old, new), encoding="utf-8")


@pytest.mark.parametrize(
    ("file", "old", "new", "verdict", "said"),
    [
        (
            "results/claims.csv", "reproduced", "contradicted", "moved",
            "made claims, verdict of law_holds: golden 'reproduced', found 'contradicted'",
        ),
        (
            "tests/golden/claims.csv", "law_holds", "other", "moved",
            "made claims, verdict of other: golden 'reproduced', found 'none'",
        ),
        ("results/claims.csv", "paper,", "papers,", "missing", "claims.csv: has the columns"),
        ("tests/golden/claims.csv", "paper,", "papers,", "gap", "claims.csv: has the columns"),
    ],
)  # fmt: skip
def test_a_verdict_that_moves_is_seen(
    project: Path, capsys: pytest.CaptureFixture[str],
    file: str, old: str, new: str, verdict: str, said: str,
) -> None:  # fmt: skip
    rewrite(project / file, old, new)
    assert main(["figdiff"]) == 1
    assert verdicts(project) == {"claims": verdict}
    assert said in capsys.readouterr().out
    golden_claims.golden_file(project).unlink()
    if file.startswith("tests"):
        assert main(["figdiff"]) == 1
        assert verdicts(project) == {"claims": "extra"}


def test_a_build_goes_on_past_what_fails(tmp_path: Path) -> None:
    """Snakemake itself, on a copy of what git knows or would know of."""
    source, copy = tmp_path / "source", tmp_path / "copy"
    source.mkdir()
    (source / ".gitignore").write_text("kept_back\n")
    (source / "kept_back").touch()
    (source / "Snakefile").write_text(
        "rule all:\n    input: 'bad', 'good'\n"
        "rule good:\n    output: 'good'\n    shell: 'touch {output}'\n"
        "rule bad:\n    output: 'bad'\n    shell: 'false'\n"
    )
    git(source, "init", "--quiet")
    copy_project(source, copy)
    assert sorted(path.name for path in copy.iterdir()) == [".gitignore", "Snakefile"]
    assert not build(copy, copy, 1, tmp_path / "build.log")
    assert (copy / "good").exists()
    assert "Error in rule bad" in (tmp_path / "build.log").read_text()


@pytest.mark.parametrize(
    ("folder", "said"),
    [
        (BUILT, "the figure was not built."),
        ("tests/reference/made", "there is no reference figure."),
    ],
)
def test_where_one_figure_is_lacking_the_page_says_which(
    project: Path, folder: str, said: str
) -> None:
    (project / folder / "fig1.png").unlink()
    assert main(["figdiff"]) == 1
    page = (project / "figdiff/index.html").read_text()
    assert page.count(f"There is nothing to compare: {said}") == 1
    assert page.count("nothing to compare") == 1


def test_the_nightly_workflow_runs_what_a_person_runs() -> None:
    text = (ROOT / ".github/workflows/nightly.yml").read_text()
    assert "make figdiff" in text
    assert 'figdiff/summary.md >> "$GITHUB_STEP_SUMMARY"' in text
    assert text.count("if: always()") == 2
    for event in ("schedule:", "workflow_dispatch:"):
        assert event in text
    pinned = set(re.findall(r"uses: (\S+)", text))
    assert pinned <= set(
        re.findall(r"uses: (\S+)", (ROOT / ".github/workflows/ci.yml").read_text())
    )


def test_origins_differ_also_in_what_only_one_of_them_has() -> None:
    here = Origin({"numpy": "1", "scipy": "2", "numba": "3"})
    there = Origin({"numpy": "1", "scipy": "4", "flint": "5"})
    assert here.differing(there) == [
        ("scipy", "2", "4"),
        ("numba", "3", ""),
        ("flint", "", "5"),
    ]


def test_the_worst_series_are_drawn_and_the_worst_first(monkeypatch: pytest.MonkeyPatch) -> None:
    """By tolerances, up or down; nan and other lengths are worse than any number."""
    drawn: list[str] = []

    def draw_moved(series: list[MovedSeries]) -> bytes:
        drawn.extend(one.name for one in series)
        return b"<svg/>"

    monkeypatch.setattr(plot_moved, "draw_moved", draw_moved)
    golden = np.zeros(3)
    moved = {
        "up": MovedSeries("up", "1", golden, golden + 2e-6, 1e-6),
        "down": MovedSeries("down", "1", golden, golden - 4e-6, 1e-6),
        "wide": MovedSeries("wide", "1", golden, golden + 3.0, 1.0),
        "nan": MovedSeries("nan", "1", golden, golden + np.nan, 1.0),
    }
    page._show(Item("made", "fig1", series=list(moved.values())))
    assert drawn == ["nan", "down", "wide"]
    drawn.clear()
    short = MovedSeries("short", "1", golden, golden[:2], 1.0)
    page._show(Item("made", "fig1", series=[moved["up"], moved["wide"], short]))
    assert drawn == ["short", "wide", "up"]


def test_the_difference_is_drawn_over_time() -> None:
    golden = np.zeros(3)
    drawing = plot_moved.draw_moved([MovedSeries("up", "N m", golden, golden + 2e-6, 1e-6)])
    found = re.findall(r"<!-- (.*?) -->", drawing.decode())
    assert "time [s]" in found


def test_a_page_that_cannot_be_filled_is_named(tmp_path: Path) -> None:
    empty = Diff([], Origin({}), Origin({}), [])
    with pytest.raises(InputError, match=rf"{page.STYLE}: cannot be read$"):
        page.render(empty, tmp_path)
    (tmp_path / page.STYLE).write_text("p { color: red }")
    with pytest.raises(InputError, match=rf"{page.TEMPLATE}: cannot be read$"):
        page.render(empty, tmp_path)
    template = tmp_path / page.TEMPLATE
    for text, said in (
        ("{{ nowhere }}", "'nowhere' is undefined"),
        ("{% if %}", "Expected"),
    ):
        template.write_text(text)
        with pytest.raises(InputError, match=rf"{page.TEMPLATE}: cannot be filled: {said}"):
            page.render(empty, tmp_path)
    template.write_text("{{ counts }}")
    assert page.render(empty, tmp_path) == "nothing"


def test_only_a_checkout_can_be_copied(project: Path, tmp_path: Path) -> None:
    with pytest.raises(ReobserveError, match="only a git checkout can be copied: "):
        copy_project(project, tmp_path / "copy")
    assert not (tmp_path / "copy").exists()
