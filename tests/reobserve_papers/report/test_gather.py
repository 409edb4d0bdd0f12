"""What a report says, gathered from a made-up build; whatever is missing is a gap, and no more."""

from __future__ import annotations

import io
import re
import subprocess
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from PIL import Image

from reobserve.core.errors import InputError
from reobserve_papers.claims.registry import claims_text
from reobserve_papers.parameters.parameters import Parameters
from reobserve_papers.report import gather as gather_module
from reobserve_papers.report.assumptions import range_lines, value_lines
from reobserve_papers.report.embedded_files import metrics_table
from reobserve_papers.report.environment import environment
from reobserve_papers.report.gather import MAX_ROWS, gather
from reobserve_papers.report.markup import first_sentence, without_title
from reobserve_papers.report.render import render
from reobserve_papers.report.report_gaps import Gap
from reobserve_papers.report.reported_claims import ReportedClaim
from tests import ROOT

from .project import BROKEN, CLAIMS, SVG, TITLE, configure, write_claims

PAGE = "results/report.html"
PICTURES = ("fig1", "alternatives", "sensitivity")


def gathered(folder: Path) -> tuple[dict[str, Any], dict[str, Any]]:
    report = gather(folder, folder / PAGE)
    return report, report["papers"][0]


def sentences(folder: Path) -> list[str]:
    return [gap.sentence for gap in gather(folder, folder / PAGE)["gaps"]]


def claims(folder: Path) -> dict[str, ReportedClaim]:
    return {claim.name: claim for claim in gathered(folder)[1]["claims"]}


def test_complete_build_has_no_gaps(project: Path) -> None:
    report, paper = gathered(project)
    assert report["gaps"] == []
    assert (paper["name"], paper["short"], paper["doi"]) == ("toy", "Example (2000)", "10.0000/toy")
    assert paper["limitations"] == "The gains of one observer are not given."
    assert list(paper["counts"].values()) == [1, 1, 1, 1, 0, 1, 0]
    assert paper["replication"] == TITLE
    assert paper["tables"][0]["content"]["left_out"] == 0


def test_figure_has_its_caption_files_and_claims(project: Path) -> None:
    figure = gathered(project)[1]["figures"][0]
    assert figure["title"] == "A disturbance estimated"
    assert figure["source"] == "Example 2000, Fig. 1"
    assert figure["caption"].startswith("<p>(a) The estimate errs by 0.1 %.\nIt lags.</p>")
    assert "<em>slow</em> &lt;and more&gt;" in figure["caption"]
    assert figure["alternative"] == "A disturbance estimated. (a) The estimate errs by 0.1 %."
    assert figure["links"] == [{"label": "SVG", "target": "toy/fig1.svg"}]
    assert figure["decides"] == ["placed_is_better", "tuned", "slow_is_good"]
    assert (figure["image"]["width"], figure["image"]["height"]) == (400, 200)  # 300 pt are 400 px


def test_figures_of_the_paper_have_their_settings_and_numbers_beside_ours(project: Path) -> None:
    drawn, rig = gathered(project)[1]["rows"]
    assert (drawn.name, drawn.ours, drawn.not_reproduced) == ("Fig. 1", ("fig1",), "")
    assert drawn.numbers == (
        ("placed poles, late", "0.2 %", "0.1 %"),
        ("slow poles, late", "390 mrad/s", "400 mrad/s"),
        ("discriminant", "0", "0 1/s^2"),
    )
    # Rate, horizon, disturbance and pole; the step of the integration is numerical.
    assert (drawn.printed, drawn.assumed, drawn.searched) == (4, 1, ())
    assert (rig.ours, rig.not_reproduced, rig.numbers) == ((), "a photograph", ())


def test_setting_chosen_for_what_a_figure_shows_is_searched(project: Path) -> None:
    path = project / "config/papers/toy.yaml"
    found = "source: assumed\n      chosen_for: Fig. 1"
    path.write_text(path.read_text().replace("source: assumed", found))
    (project / "results/toy/parameters.json").write_text(
        Parameters.load(project, "toy", seed=1).text()
    )
    drawn = gathered(project)[1]["rows"][0]
    assert (drawn.printed, drawn.assumed, drawn.searched) == (4, 0, ("observers.slow.gains",))


def test_missing_number_beside_a_printed_one_is_named_there(project: Path) -> None:
    (project / "results/toy/theory.metrics.csv").unlink()
    assert gathered(project)[1]["rows"][0].numbers[2][2] == "not there"


def test_numbers_are_listed_by_observer_with_their_meaning(project: Path) -> None:
    table = gathered(project)[1]["figures"][0]["numbers"]
    assert table["header"] == ["metric", "placed", "slow", "unit", "what it is"]
    assert table["rows"] == [
        ["late_rms_error", "0.001", "0.4", "1/s", "of the last second, |e|"],
        ["lag", "", "nan", "s", ""],
    ]
    assert table["numeric"] == [False, True, True, False, False]
    assert table["link"]["target"] == "toy/fig1.metrics.csv"


@pytest.mark.parametrize(("most", "shown"), [(MAX_ROWS, 40), (None, 47)])
def test_long_tables_are_shortened_and_sparse_ones_become_lists(
    tmp_path: Path, most: int | None, shown: int
) -> None:
    rows = [f"o{k},error_at_{k},{-k},1" for k in range(47)]
    (tmp_path / "many.csv").write_text("\n".join(["observer,metric,value,unit", *rows]) + "\n")
    table = metrics_table(tmp_path / "many.csv", [], most)
    assert table["header"] == ["observer", "metric", "value", "unit"]
    assert table["numeric"] == [False, False, True, False]
    assert table["rows"][1] == ["o1", "error_at_1", "−1", "1"]
    assert (len(table["rows"]), table["left_out"]) == (shown, 47 - shown)


def test_claims_include_checks_and_robustness(project: Path) -> None:
    better = claims(project)["placed_is_better"]
    assert better.measured == (
        "fig1 placed late_rms_error and so on: 2 of 2 are below 1; the worst is 0.4",
        "fig1 slow late_rms_error = 0.4, must be below 1",
    )
    found = better.robustness
    assert found
    assert (found.samples, found.held, found.share, found.whole) == (40, 30, 0.75, False)
    assert (found.tied, found.opposed, found.lost, found.cached) == (4, 3, 3, 38)
    assert found.held + found.tied + found.opposed + found.lost == found.samples
    assert (found.null, found.no_better) == (0.025, "")
    for null, said in ((found.share, True), (found.share - 0.01, False), (0.0, False), (1.0, True)):
        assert replace(found, null=null).no_better == "no better than the baseline" * said
    assert not replace(found, null=0.0, share=0.0).no_better
    tuned = claims(project)["tuned"]
    assert tuned.setting == "the parameter file"
    assert tuned.robustness
    assert tuned.robustness.null is None
    assert claims(project)["double_pole"].robustness is None


def test_settings_that_are_counted_are_all(project: Path) -> None:
    """Their share has no interval."""
    for low in (0.75, 0.7):
        rows = [{**row, **({"low": low, "high": 0.75} if "low" in row else {})} for row in CLAIMS]
        write_claims(project, rows)
        found = claims(project)["tuned"].robustness
        assert found
        assert found.whole is (low == 0.75)


def test_same_choice_of_two_observers_is_one_row(project: Path) -> None:
    path = project / "config/papers/toy.yaml"
    slow = path.read_text().partition("  slow:\n")[2].partition("\nstudies:")[0]
    path.write_text(path.read_text().replace("  slow:\n", f"  twin:\n{slow}  slow:\n"))
    (project / "results/toy/parameters.json").unlink()
    paper = gathered(project)[1]
    (entry,) = (entry for entry in paper["entries"] if entry.status == "assumed")
    assert entry.keys == ("observers.twin.gains", "observers.slow.gains")
    assert entry.range == ("0.5 to 5 each",)
    assert entry.claims == ("placed_is_better", "tuned")
    assert paper["statuses"]["assumed"] == 2
    assert sum(paper["statuses"].values()) == len(paper["known_keys"])


def test_values_and_ranges_are_formatted() -> None:
    assert value_lines(-1e7) == ("−1e+07",)
    assert value_lines(0.000125) == ("0.000125",)
    assert value_lines(1.5707963267948966) == ("1.57079632679",)
    assert value_lines([[1.0, 2], [3, 4.5]]) == ("(1, 2)", "(3, 4.5)")
    assert value_lines([{"kind": "sine", "axis": 1, "amplitude": 0.5}]) == (
        "sine: axis 1, amplitude 0.5",
    )
    assert value_lines(True) == ("yes",)
    assert range_lines({"choices": ["CLARABEL", "SCS"]}) == ("one of CLARABEL, SCS",)
    assert range_lines({"*.from": [5.0, 5.0], "0": [0.0, 1e-4]}) == ("*.from: 5", "0: 0 to 0.0001")


def test_captions_without_a_title_are_unchanged() -> None:
    assert without_title("<p>(a) The fault.</p>", "Other") == ("<p>(a) The fault.</p>", "")
    assert without_title("<p><strong>a &lt; b</strong> (Fig. 2), in full.</p>", "a < b") == (
        "<p>In full.</p>", "Fig. 2",
    )  # fmt: skip
    assert first_sentence("<p>See Fig. 2 for <em>it</em>.\nThen more.</p>") == "See Fig. 2 for it."


# What is taken away, and where the page shows it.
TAKEN = {
    "results/toy/fig1.svg": "toy-fig1", "results/toy/fig1.caption.rst": "toy-fig1",
    "results/toy/fig1.metrics.csv": "toy-fig1", "results/toy/table1.csv": "toy-table1",
    "results/toy/theory.metrics.csv": "toy-theory", "results/toy/robustness.json": "toy-claims",
    "results/toy/sensitivity.svg": "toy-claims", "results/toy/parameters.json": "toy",
    "results/toy/alternatives.svg": "toy-claims", "results/toy/alternatives.csv": "toy-title",
    "results/claims.csv": "summary", "config/claims/toy.yaml": "toy",
}  # fmt: skip


@pytest.mark.parametrize("path", TAKEN)
def test_missing_file_is_one_gap_in_its_place(project: Path, path: str) -> None:
    (project / path).unlink()
    report, paper = gathered(project)
    (gap,) = report["gaps"]
    assert (gap.number, gap.place) == (1, TAKEN[path])
    assert gap.sentence.startswith((f"{path}: not built", f"{path}: cannot", f"{path}: has no"))
    kept = [paper["figures"][0]["image"], not isinstance(paper["figures"][0]["numbers"], Gap)]
    kept += [paper["verdicts"], not isinstance(paper["errata"], Gap)]
    assert sum(map(bool, kept)) >= 3, "the rest is there"


HEAD = "observer,metric,value,unit\n"

DAMAGED = [
    ("results/toy/fig1.svg", "<svg", "is no SVG with a width and a height in points"),
    ("results/toy/fig1.svg", "<svg/>", "is no SVG with a width and a height in points"),
    ("results/toy/fig1.caption.rst", "**bold", "is no reStructuredText"),
    ("results/toy/fig1.metrics.csv", "a,b\n1,2\n", "has the columns ['a', 'b']"),
    ("results/toy/fig1.metrics.csv", f"{HEAD}a,b,c,d\n", "line 2, value: 'c' must be a number"),
    ("results/toy/table1.csv", "a,b\n1\n", "line 2 has not 2 cells"),
    ("results/toy/table1.csv", "", "is empty"),
    ("results/toy/table1.csv", 'a,b\n"1,2\n', "cannot be read (unexpected end of data)"),
    ("results/toy/robustness.json", "{", "is not JSON"),
    ("results/toy/robustness.json", "[]", "must be a mapping"),
    ("results/toy/parameters.json", "{}", "is not what was written"),
    ("results/claims.csv", "a,b\n", "has the columns"),
    ("config/claims/toy.yaml", "claims: {}", "has no claims, results/claims.csv has"),
    ("config/claims/toy.yaml", "claims: {a: {}}", "claims.toy.limitations: is missing"),
    ("config/errata/toy.yaml", "errata: {sign: {place: a}}", "errata.toy.sign.printed: is missing"),
    ("config/errata/toy.yaml", "errata: [", "is not YAML"),
    ("config/errata/toy.yaml", "errata: {sign: here}", "errata.toy.sign: 'here' must be a"),
]


@pytest.mark.parametrize(("path", "content", "said"), DAMAGED)
def test_damaged_file_is_one_gap(project: Path, path: str, content: str, said: str) -> None:
    (project / path).write_text(content)
    (sentence,) = sentences(project)
    assert sentence.startswith((path, said))
    assert said in sentence


@pytest.mark.parametrize(
    ("change", "said"),
    [({"verdict": "fine"}, "'fine' must be a verdict"), ({"held": "some"}, "'some' must be a wh")],
)
def test_damaged_table_of_claims_is_one_gap(
    project: Path, change: dict[str, str], said: str
) -> None:
    write_claims(project, [row | change if "separation" in row else row for row in CLAIMS])
    (sentence,) = sentences(project)
    assert sentence.startswith("results/claims.csv: line 3, ")
    assert said in sentence


def test_paper_without_claims_in_the_table_is_a_gap(project: Path) -> None:
    write_claims(project, [])
    assert sentences(project) == ["results/claims.csv: has no claim of toy"]


@pytest.mark.parametrize("kind", ["claims", "errata"])
@pytest.mark.parametrize("text", [None, "", "{kind}: {{}}", "{kind}: []"])
def test_no_claims_and_no_errata_are_no_gaps(project: Path, kind: str, text: str | None) -> None:
    path = project / f"config/{kind}/toy.yaml"
    path.unlink()
    if text is not None:
        path.write_text(text.format(kind=kind))
    if kind == "claims":
        write_claims(project, [])
        for name in ("robustness.json", "alternatives.csv"):
            (project / "results/toy" / name).unlink()
    claims_text.cache_clear()
    report, paper = gathered(project)
    assert report["gaps"] == []
    assert not paper[kind]
    page = render(report, ROOT / "workflow/report/replication")
    assert ("None stated." if kind == "claims" else "None found.") in page


def test_broken_claims_are_gaps_with_their_message(project: Path) -> None:
    write_claims(project, [*CLAIMS, BROKEN])
    report, paper = gathered(project)
    assert [(gap.place, gap.sentence) for gap in report["gaps"]] == [
        ("toy-claim-amiss", BROKEN["problem"])
    ]
    assert paper["counts"]["broken"] == 1


@pytest.mark.parametrize(
    ("missing", "step"),
    [("fig1.svg", "fig1.plot"), ("theory.metrics.csv", "theory")],
)
def test_missing_file_quotes_the_error_of_its_job(project: Path, missing: str, step: str) -> None:
    (project / "results/toy" / missing).unlink()
    for log in (project / "logs/toy").iterdir():
        log.write_text(f"{log.read_text()}reobserve-papers: toy: {log.stem} cannot be made\n")
    reported = f"not built; logs/toy/{step}.log says: toy: {step} cannot be made"
    assert sentences(project) == [f"results/toy/{missing}: {reported}"]


def test_damaged_numbers_do_not_quote_the_log(project: Path) -> None:
    (project / "results/toy/theory.metrics.csv").write_text("a,b\n1,2\n")
    log = project / "logs/toy/theory.log"
    log.write_text(f"{log.read_text()}reobserve-papers: toy: it cannot be\n")
    (said,) = sentences(project)
    assert "it cannot be" not in said


def png(width: int, height: int) -> bytes:
    stream = io.BytesIO()
    Image.new("L", (width, height)).save(stream, "png")
    return stream.getvalue()


@pytest.mark.parametrize(
    ("formats", "kind"),
    [("[pdf, png, svg]", "image/svg+xml"), ("[pdf, png]", "image/png"), ("[pdf]", None)],
)
def test_vector_formats_are_preferred_to_png_and_links(
    project: Path, formats: str, kind: str | None
) -> None:
    configure(project, "[toy]", formats)
    for picture in PICTURES:
        (project / f"results/toy/{picture}.png").write_bytes(png(64, 32))
        (project / f"results/toy/{picture}.pdf").write_bytes(b"%PDF-")
    report, paper = gathered(project)
    figure = paper["figures"][0]
    assert report["gaps"] == []
    assert len(figure["links"]) == len(formats.split(","))
    image = figure["image"]
    assert (re.split("[;,]", image["source"])[0] if image else None) == (kind and f"data:{kind}")
    assert kind != "image/png" or (image["width"], image["height"]) == (40, 20)


def test_damaged_vector_falls_back_to_png_then_to_a_link(project: Path) -> None:
    configure(project, "[toy]", "[svg, png]")
    (project / "results/toy/fig1.svg").write_text(SVG[:40])
    for picture in PICTURES:
        (project / f"results/toy/{picture}.png").write_bytes(png(64, 32))
    report, paper = gathered(project)
    assert len(report["gaps"]) == 1
    assert paper["figures"][0]["image"]["source"].startswith("data:image/png")
    (project / "results/toy/fig1.png").write_bytes(png(30, 20)[:20])
    report, paper = gathered(project)
    assert report["gaps"][1].sentence == "results/toy/fig1.png: is no PNG"
    assert paper["figures"][0]["image"] is None


@pytest.mark.parametrize(
    ("text", "said"), [(None, "cannot be read"), ("papers: [toy]\n", "formats: is missing")]
)
def test_missing_config_is_refused(project: Path, text: str | None, said: str) -> None:
    path = project / "config/config.yaml"
    path.unlink()
    if text:
        path.write_text(text)
    with pytest.raises(InputError, match=rf"config/config\.yaml[.:] ?{said}"):
        gathered(project)


def test_build_may_differ_from_the_config(project: Path) -> None:
    configure(project, "[other]", "[svg, png]")
    report = gather(project, project / PAGE, ["toy"], ["svg"])
    assert [paper["name"] for paper in report["papers"]] == ["toy"]
    assert report["gaps"] == []


@pytest.mark.parametrize(
    ("reported", "wanted"),
    [
        ("model name\t: One\nflags\t: x\nmodel name\t: Two\n", "One"),
        ("Hardware\t: Board\n", "by itself"),  # not every kernel names a model
    ],
)
def test_processor_name_is_the_first_in_cpuinfo(
    reported: str, wanted: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "cpuinfo").write_text(reported)
    monkeypatch.setattr("reobserve_papers.report.environment.Path", lambda _: tmp_path / "cpuinfo")
    monkeypatch.setattr("platform.processor", lambda: "by itself")
    assert environment(tmp_path)["processor"] == wanted


@pytest.mark.parametrize("owner", ["0", "1"])
def test_commit_is_that_of_the_project_folder(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, owner: str
) -> None:
    inner = tmp_path / "thesis" / "project"
    inner.mkdir(parents=True)
    (inner / "file").touch()
    git = ["git", "-c", "user.name=t", "-c", "user.email=t@example.org", "-C", str(inner.parent)]
    for words in (["init", "--quiet"], ["add", "--all"], ["commit", "--quiet", "-m", "all"]):
        subprocess.run([*git, *words], check=True)
    git[1:1] = ["-c", "safe.directory=*"]
    monkeypatch.setenv("GIT_TEST_ASSUME_DIFFERENT_OWNER", owner)
    head = subprocess.run(
        [*git, "rev-parse", "HEAD"], check=True, capture_output=True, text=True
    ).stdout.strip()
    assert environment(inner.parent)["commit"] == head
    assert "commit" not in environment(inner)
    (inner / "file").write_text("changed")
    assert environment(inner.parent)["commit"] == f"{head}, with changes that are not committed"


def test_the_bench_is_shown_with_its_gaps_where_it_was_built(project: Path) -> None:
    for name in ("config/bench", "workflow/report/bench", "results/bench/level"):
        (project / name).mkdir(parents=True)
    (project / "config/bench/level.yaml").write_text("title: Level of a tank\n")
    for figure in ("heatmap", "levels", "evaluations"):
        (project / f"workflow/report/bench/{figure}.rst").write_text("Errors.\n")
    for figure in ("heatmap", "levels"):
        (project / f"results/bench/level/{figure}.svg").write_text(SVG)
    (project / "results/bench/level/table.csv").write_text("condition,method\n")
    assert gather(project, project / PAGE)["bench"] == []  # papers are limited to one
    report = gather(project, project / PAGE, bench=["level", "tank"])
    (task,) = report["bench"]
    assert (task["title"], task["link"]["target"]) == ("Level of a tank", "bench/level/table.csv")
    assert [figure["name"] for figure in task["figures"]] == ["heatmap", "levels", "evaluations"]
    assert [figure["image"] is not None for figure in task["figures"]] == [True, True, False]
    sentence = "results/bench/level/evaluations.svg: not built"
    assert [gap.sentence for gap in report["gaps"]] == [sentence]
    page = render(report, project / "workflow/report/replication")
    assert page.count('alt="Level of a tank: ') == 2
    assert '<article class="drawn" id="bench-level-evaluations">' in page


def test_report_is_complete_without_the_bench(project: Path) -> None:
    report = gather(project, project / PAGE, bench=["level"])
    assert (report["bench"], report["gaps"]) == ([], [])
    page = render(report, project / "workflow/report/replication")
    assert "No gaps" in page
    assert "#bench" not in page


def test_what_a_build_would_make_again_is_marked(
    project: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (project / "Snakefile").write_text("")
    drawing, claims = project / "results/toy/fig1.svg", project / gather_module.CLAIMS_FILE
    stale = {drawing: "code has changed since last execution", claims: "its inputs are"}
    monkeypatch.setattr(gather_module, "out_of_date", lambda *_, bench: stale)
    found = gather(project, project / "results/report.html", fresh=False)
    sentence = (
        "results/toy/fig1.svg: not up to date, a build would make it again "
        "(code has changed since last execution)"
    )
    assert [gap.sentence for gap in found["gaps"]] == [sentence]
    assert [gap.sentence for gap in found["papers"][0]["figures"][0]["gaps"]] == [sentence]
    assert found["papers"][0]["figures"][0]["image"]
    assert gather(project, project / "results/report.html")["gaps"] == []
