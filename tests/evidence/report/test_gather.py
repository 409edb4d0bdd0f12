"""What a report says, gathered from a made-up build; whatever is missing is a gap, and no more."""

from __future__ import annotations

import struct
import subprocess
import zlib
from dataclasses import replace
from pathlib import Path

import pytest

from reobserve.errors import InputError
from reobserve.evidence.claims.table import NOT_LOOKED_FOR
from reobserve.evidence.report.assumptions import range_lines, value_lines
from reobserve.evidence.report.environment import environment
from reobserve.evidence.report.gather import gather
from reobserve.evidence.report.jobs import outside_inputs
from reobserve.evidence.report.markup import first_sentence, without_title
from reobserve.evidence.report.model import Gap, Paper, Report, Table
from reobserve.evidence.report.numbers import MOST_ROWS, metrics_table
from reobserve.evidence.report.reading import Project
from reobserve.evidence.report.verdicts import counts, replicated
from reobserve.ledger.ledger import Ledger

from .project import BROKEN, CLAIMS, SVG, write_claims

PAGE = "results/report.html"


def gathered(folder: Path) -> tuple[Report, Paper]:
    report = gather(folder, folder / PAGE)
    return report, report.papers[0]


def sentences(report: Report) -> list[str]:
    return [gap.sentence for gap in report.gaps]


def test_a_whole_build_has_no_gaps(project: Path) -> None:
    report, paper = gathered(project)
    assert report.gaps == ()
    assert (paper.name, paper.short, paper.doi) == ("toy", "Example (2000)", "10.0000/toy")
    assert paper.obstacles == "The gains of one observer are not given."


def test_a_figure_is_told_with_its_caption_files_and_claims(project: Path) -> None:
    figure = gathered(project)[1].figures[0]
    assert figure.title == "A disturbance estimated"
    assert figure.source == "Example 2000, Fig. 1"
    assert figure.caption.startswith("<p>(a) The estimate errs by 0.1 %.\nIt lags.</p>")
    assert "<em>slow</em> &lt;and more&gt;" in figure.caption
    assert figure.alternative == "A disturbance estimated. (a) The estimate errs by 0.1 %."
    assert [(link.label, link.target) for link in figure.links] == [("SVG", "toy/fig1.svg")]
    assert figure.numbers_link.target == "toy/fig1.metrics.csv"
    assert figure.decides == ("placed_is_better", "tuned", "slow_is_good")
    assert (figure.image.width, figure.image.height) == (400, 200)  # 300 pt are 400 px


def test_numbers_stand_by_observer_with_what_they_mean(project: Path) -> None:
    table = gathered(project)[1].figures[0].numbers
    assert table.header == ("metric", "placed", "slow", "unit", "what it is")
    assert table.rows == (
        ("late_rms_error", "0.001", "0.4", "1/s", "of the last second, |e|"),
        ("lag", "", "nan", "s", ""),
    )
    assert table.numeric == (False, True, True, False, False)


def test_long_tables_are_cut_and_sparse_ones_are_lists(project: Path) -> None:
    path = project / "results/toy/many.csv"
    rows = [f"o{k},error_at_{k},{k},1" for k in range(MOST_ROWS + 7)]
    path.write_text("\n".join(["observer,metric,value,unit", *rows]) + "\n")
    table = metrics_table(Project(project, project / PAGE), "results/toy/many.csv", [])
    assert table.header == ("observer", "metric", "value", "unit")
    assert (len(table.rows), table.left_out) == (MOST_ROWS, 7)
    whole = metrics_table(Project(project, project / PAGE), "results/toy/many.csv", [], None)
    assert (len(whole.rows), whole.left_out) == (MOST_ROWS + 7, 0)


def test_the_jobs_behind_a_figure_come_in_order_with_their_commands(project: Path) -> None:
    paper = gathered(project)[1]
    jobs = paper.figures[0].jobs
    assert [(job.stage, job.name) for job in jobs] == [
        ("plant", "push"), ("design", "gains"), ("observe", "placed, push"),
        ("observe", "slow, push"), ("study", "faster"), ("metrics", "fig1"), ("plot", "fig1"),
    ]  # fmt: skip
    assert jobs[0].command.startswith("reobserve stage plant results/toy/parameters.json push ")
    assert "results/toy/gains.design.json" in jobs[2].inputs
    assert "results/toy/gains.design.json" not in jobs[3].inputs
    assert outside_inputs(jobs) == ["results/toy/parameters.json", "workflow/report/toy/fig1.rst"]
    assert [job.stage for job in paper.tables[0].jobs] == ["design", "table"]
    assert [job.stage for job in paper.theory_jobs] == ["design", "theory"]
    assert [job.stage for job in paper.claims_jobs] == ["robustness", "claims"]


def test_the_code_of_a_stage_is_named(project: Path) -> None:
    paper = gathered(project)[1]
    assert "reobserve.cli" not in paper.code[0].modules, "what all stages import stands once"
    assert "reobserve.__main__" in paper.shared_code
    plot = next(code for code in paper.code if code.stage == "plot")
    assert "reobserve.drawing.figures" in plot.modules
    assert len(plot.digest) == 16


def test_timings_are_summed_by_stage(project: Path) -> None:
    (project / "logs/toy/push/slow.tsv").write_text("s\th:m:s\tmax_rss\n4\t0:00:04\tNA\n")
    (project / "logs/toy/fig1.plot.tsv").unlink()
    report, _ = gathered(project)
    found = {row.stage: row for row in report.timings}
    assert "plot" not in found
    observe = found["observe"]
    assert (observe.jobs, observe.seconds, observe.longest, observe.memory) == (2, 5.5, 4, 100.5)
    assert found["design"].jobs == 1, "once, though the figure and the table need it"


def test_claims_come_with_checks_and_robustness(project: Path) -> None:
    claims = {claim.name: claim for claim in gathered(project)[1].known_claims}
    better = claims["placed_is_better"]
    assert better.measured == (
        "fig1 placed late_rms_error and so on: 2 of 2 are below 1; the worst is 0.4",
        "fig1 slow late_rms_error = 0.4, must be below 1",
    )
    found = better.robustness
    assert (found.draws, found.held, found.share, found.diverged) == (40, 30, 0.75, 2)
    assert (found.refused, found.kept) == (1, 38)
    assert found.flip_key == "observers.slow.gains.1"
    assert found.flip == "from 1 to 0.6 1/s^2 (0.1 of its range)"
    assert claims["double_pole"].robustness is None
    assert list(counts(list(claims.values())).values()) == [1, 1, 1, 1, 0, 1, 0]


def test_no_flip_found_is_told_from_none_looked_for(project: Path) -> None:
    for flip, looked in (("", True), (NOT_LOOKED_FOR, False)):
        write_claims(project, [CLAIMS[0], CLAIMS[1] | {"flip": flip}, *CLAIMS[2:]])
        claims = {claim.name: claim for claim in gathered(project)[1].known_claims}
        found = claims["placed_is_better"].robustness
        assert (found.flip_key, found.flip, found.looked) == ("", "", looked)


def test_a_paper_is_replicated_or_not(project: Path) -> None:
    assert replicated([]) is None
    claims = {claim.name: claim for claim in gathered(project)[1].known_claims}
    good, open_ = claims["double_pole"], claims["placed_is_better"]
    assert replicated([good])
    assert not replicated([good, open_]), "one of two is not more than half"
    assert replicated([good, good, open_, claims["slow_is_good"]]), "no headline fails"
    assert not replicated([good, good, good, replace(claims["slow_is_good"], headline=True)])


def test_assumptions_tell_equal_ones_once_and_what_depends_on_them(project: Path) -> None:
    paper = gathered(project)[1]
    entry = next(entry for entry in paper.entries if "observers.slow.gains" in entry.keys)
    assert entry.status == "assumed"
    assert entry.range == ("0.5 to 5 each",)
    assert entry.claims == ("placed_is_better", "tuned")
    assert paper.keys("assumed") == 1
    assert sum(len(entry.keys) for entry in paper.entries) == paper.keys("assumed", "stated")


def test_the_same_choice_of_two_observers_is_one_row(project: Path) -> None:
    path = project / "config/papers/toy.yaml"
    slow = path.read_text().partition("  slow:\n")[2].partition("\nstudies:")[0]
    path.write_text(path.read_text().replace("  slow:\n", f"  twin:\n{slow}  slow:\n"))
    (project / "results/toy/parameters.json").unlink()
    entries = gathered(project)[1].entries
    both = ("observers.twin.gains", "observers.slow.gains")
    assert [entry.keys for entry in entries if entry.status == "assumed"] == [both]


def test_values_and_ranges_read_well() -> None:
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


def test_captions_without_a_title_are_left_alone() -> None:
    assert without_title("<p>(a) The fault.</p>", "Other") == ("<p>(a) The fault.</p>", "")
    assert without_title("<p><strong>a &lt; b</strong> (Fig. 2), in full.</p>", "a < b") == (
        "<p>In full.</p>", "Fig. 2",
    )  # fmt: skip
    assert first_sentence("<p>See Fig. 2 for <em>it</em>.\nThen more.</p>") == "See Fig. 2 for it."


# What is taken away, what the page says of it, and where.
TAKEN = [
    ("results/toy/fig1.svg", "results/toy/fig1.svg: not built", "toy-fig1"),
    ("results/toy/fig1.caption.rst", "cannot be read", "toy-fig1"),
    ("results/toy/fig1.metrics.csv", "cannot be read", "toy-fig1"),
    ("results/toy/table1.csv", "cannot be read", "toy-table1"),
    ("results/toy/theory.metrics.csv", "cannot be read", "toy-theory"),
    ("results/toy/robustness.json", "cannot be read", "toy-claims"),
    ("results/toy/sensitivity.svg", "results/toy/sensitivity.svg: not built", "toy-claims"),
    ("results/toy/parameters.json", "cannot be read", "toy"),
    ("results/claims.csv", "cannot be read", "summary"),
    ("config/claims/toy.yaml", "cannot be read", "toy"),
    ("config/errata/toy.yaml", "cannot be read", "toy-errata"),
    ("logs/toy/push/slow.log", "cannot be read", "toy-made"),
]


def test_a_table_of_a_paper_is_shown_whole(project: Path) -> None:
    _, paper = gathered(project)
    tables = [table.content for table in paper.tables if isinstance(table.content, Table)]
    assert tables
    assert [table.left_out for table in tables] == [0] * len(tables)


@pytest.mark.parametrize(("path", "said", "place"), TAKEN)
def test_a_missing_file_is_one_gap_in_its_place(
    project: Path, path: str, said: str, place: str
) -> None:
    (project / path).unlink()
    report, paper = gathered(project)
    assert [(gap.number, gap.place) for gap in report.gaps] == [(1, place)]
    assert path in report.gaps[0].sentence
    assert said in report.gaps[0].sentence
    kept = [paper.figures[0].image, isinstance(paper.figures[0].numbers, Table)]
    kept += [paper.known_claims, not isinstance(paper.errata, Gap)]
    assert sum(map(bool, kept)) >= 3, "the rest is there"


@pytest.mark.parametrize(
    ("path", "content", "said"),
    [
        ("results/toy/fig1.svg", "<svg", "results/toy/fig1.svg: is no SVG"),
        ("results/toy/fig1.svg", "<svg/>", "is no SVG with a width and a height"),
        ("results/toy/fig1.caption.rst", "**bold", "is no reStructuredText"),
        ("results/toy/fig1.metrics.csv", "a,b\n1,2\n", "has the columns ['a', 'b']"),
        (
            "results/toy/fig1.metrics.csv",
            "observer,metric,value,unit\na,b,c,d\n",
            "line 2, value: 'c' must be a number",
        ),
        ("results/toy/table1.csv", "a,b\n1\n", "has rows that have not 2 cells"),
        ("results/toy/table1.csv", "", "is empty"),
        ("results/toy/table1.csv", 'a,b\n"1,2\n', "cannot be read (unexpected end of data)"),
        ("results/toy/robustness.json", "{", "is not JSON"),
        ("results/toy/robustness.json", "[]", "must be a mapping"),
        ("results/toy/parameters.json", "{}", "paper: is missing; the stored ledger needs it"),
        ("results/claims.csv", "a,b\n", "results/claims.csv: has the columns"),
        ("config/claims/toy.yaml", "claims: {}", "has no key 'obstacles'"),
        ("config/errata/toy.yaml", "errata: {sign: {place: a}}", "sign: has no key 'printed'"),
        ("config/errata/toy.yaml", "errata: [", "is not YAML"),
        ("config/errata/toy.yaml", "errata: [sign]", "must be a mapping of keys to values"),
        ("config/errata/toy.yaml", "errata: {sign: here}", "sign: must be a mapping of keys to"),
        ("logs/toy/push/slow.log", "nothing", "does not begin with the command that ran"),
    ],
)
def test_a_damaged_file_is_one_gap(project: Path, path: str, content: str, said: str) -> None:
    (project / path).write_text(content)
    report, _ = gathered(project)
    assert len(report.gaps) == 1
    assert path in report.gaps[0].sentence
    assert said in report.gaps[0].sentence


def test_a_job_that_refused_says_why_where_its_figure_is_missing(project: Path) -> None:
    (project / "results/toy/fig1.svg").unlink()
    log = project / "logs/toy/fig1.plot.log"
    log.write_text(f"{log.read_text()}reobserve: toy.figures.fig1.layout: cannot be drawn today\n")
    assert sentences(gathered(project)[0]) == [
        "results/toy/fig1.svg: not built; logs/toy/fig1.plot.log says: "
        "toy.figures.fig1.layout: cannot be drawn today"
    ]


def test_a_log_does_not_explain_numbers_that_are_there_and_damaged(project: Path) -> None:
    (project / "results/toy/fig1.metrics.csv").write_text("a,b\n1,2\n")
    for log in (project / "logs/toy").rglob("*.log"):
        log.write_text(f"{log.read_text()}reobserve: toy: it cannot be\n")
    (said,) = sentences(gathered(project)[0])
    assert "fig1.metrics.csv: has the columns" in said
    assert "it cannot be" not in said


@pytest.mark.parametrize("failed", ["theory", "gains.design"])
def test_the_job_that_fills_a_theory_says_why_it_is_missing(project: Path, failed: str) -> None:
    """The log of the theory counts, which is the last of its jobs, and not that of a design."""
    (project / "results/toy/theory.metrics.csv").unlink()
    log = project / f"logs/toy/{failed}.log"
    log.write_text(f"{log.read_text()}reobserve: toy: it cannot be\n")
    (said,) = {gap.sentence for gap in gathered(project)[0].gaps if gap.place == "toy-theory"}
    assert ("it cannot be" in said) == (failed == "theory")


def test_broken_claims_are_gaps_with_their_sentence(project: Path) -> None:
    write_claims(project, [*CLAIMS, BROKEN])
    report, paper = gathered(project)
    assert sentences(report) == [BROKEN["problem"]]
    assert report.gaps[0].place == "toy-claim-amiss"
    assert counts(paper.known_claims)["broken"] == 1


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"verdict": "fine"}, "'fine' is no verdict"),
        ({"held": "some"}, "toy.placed_is_better cannot be read"),
    ],
)
def test_a_damaged_row_of_claims_is_one_broken_claim(
    project: Path, change: dict[str, str], said: str
) -> None:
    write_claims(project, [row | change if "flip" in row else row for row in CLAIMS])
    report, paper = gathered(project)
    assert said in sentences(report)[0]
    assert len(report.gaps) == 1
    assert counts(paper.known_claims)["broken"] == 1


def test_a_paper_without_claims_in_the_table_is_a_gap(project: Path) -> None:
    write_claims(project, [])
    report, paper = gathered(project)
    assert sentences(report) == ["results/claims.csv: has no claim of toy"]
    assert paper.claims_jobs == ()


def png(width: int, height: int) -> bytes:
    """A white PNG, by the book."""

    def chunk(kind: bytes, body: bytes) -> bytes:
        check = zlib.crc32(kind + body)
        return struct.pack(">I", len(body)) + kind + body + struct.pack(">I", check)

    header = struct.pack(">IIBBBBB", width, height, 8, 0, 0, 0, 0)
    rows = zlib.compress((b"\0" + b"\xff" * width) * height)
    return (
        b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", header) + chunk(b"IDAT", rows) + chunk(b"IEND", b"")
    )


@pytest.mark.parametrize(
    ("formats", "kind"),
    [("[pdf, svg, png]", "image/svg+xml"), ("[pdf, png]", "image/png"), ("[pdf]", None)],
)
def test_vectors_are_preferred_then_png_then_a_link(
    project: Path, formats: str, kind: str | None
) -> None:
    (project / "config/config.yaml").write_text(f"papers: [toy]\nformats: {formats}\n")
    built = project / "results/toy"
    for picture in ("fig1", "specification", "sensitivity"):
        (built / f"{picture}.png").write_bytes(png(64, 32))
        (built / f"{picture}.pdf").write_bytes(b"%PDF-")
    report, paper = gathered(project)
    image = paper.figures[0].image
    assert report.gaps == ()
    assert (image.source.partition(";")[0] if image else None) == (kind and f"data:{kind}")
    assert kind != "image/png" or (image.width, image.height) == (40, 20)


def test_a_damaged_vector_falls_back_to_png_and_says_so(project: Path) -> None:
    (project / "config/config.yaml").write_text("papers: [toy]\nformats: [svg, png]\n")
    (project / "results/toy/fig1.svg").write_text(SVG[:40])
    for picture in ("fig1", "specification", "sensitivity"):
        (project / f"results/toy/{picture}.png").write_bytes(png(64, 32))
    report, paper = gathered(project)
    assert len(report.gaps) == 1
    assert paper.figures[0].image.source.startswith("data:image/png")


@pytest.mark.parametrize(("content", "taken"), [(b"no PNG" * 5, False), (23, False), (24, True)])
def test_a_png_needs_its_header(project: Path, content: bytes | int, taken: bool) -> None:
    (project / "config/config.yaml").write_text("papers: [toy]\nformats: [pdf, png]\n")
    for kind in ("pdf", "png"):
        whole = png(30, 20)
        kept = whole[:content] if isinstance(content, int) else content
        (project / f"results/toy/fig1.{kind}").write_bytes(kept)
    report, paper = gathered(project)
    assert ("results/toy/fig1.png: is no PNG" in sentences(report)) != taken
    assert (paper.figures[0].image is not None) == taken


def test_without_a_config_there_is_no_page(project: Path) -> None:
    (project / "config/config.yaml").unlink()
    with pytest.raises(InputError, match=r"config/config\.yaml: cannot be read"):
        gathered(project)


def test_a_config_that_says_too_little_is_named(project: Path) -> None:
    (project / "config/config.yaml").write_text("papers: [toy]\n")
    with pytest.raises(InputError, match=r"config/config\.yaml: has no key 'formats'"):
        gathered(project)


def test_what_was_built_may_differ_from_the_config(project: Path) -> None:
    (project / "config/config.yaml").write_text("papers: [other]\nformats: [svg, png]\n")
    report = gather(project, project / PAGE, ["toy"], ["svg"])
    assert [paper.name for paper in report.papers] == ["toy"]
    assert report.gaps == ()


def test_a_study_on_another_scenario_brings_its_plant(project: Path) -> None:
    other = {
        "scenarios": {"pull": {"like": "push"}},
        "studies": {"faster": {"scenario": "pull"}},
    }
    ledger = Ledger.load(project, "toy", other, seed=1)
    (project / "results/toy/parameters.json").write_text(ledger.text())
    jobs = gathered(project)[1].figures[0].jobs
    assert [job.name for job in jobs if job.stage == "plant"] == ["push", "pull"]


@pytest.mark.parametrize(
    ("told", "wanted"),
    [
        ("model name\t: One\nflags\t: x\nmodel name\t: Two\n", "One"),
        ("model name\t: Alone\n", "Alone"),
        ("Hardware\t: Board\n", "by itself"),  # not every kernel names a model
    ],
)
def test_the_processor_is_the_first_that_the_kernel_names(
    told: str, wanted: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "cpuinfo").write_text(told)
    monkeypatch.setattr(
        "reobserve.evidence.report.environment.Path", lambda _: tmp_path / "cpuinfo"
    )
    monkeypatch.setattr("platform.processor", lambda: "by itself")
    assert dict(environment(tmp_path))["processor"] == wanted


def test_the_commit_is_that_of_the_folder_and_not_of_one_around_it(tmp_path: Path) -> None:
    inner = tmp_path / "thesis" / "project"
    inner.mkdir(parents=True)
    (inner / "file").touch()
    git = ["git", "-c", "user.name=t", "-c", "user.email=t@example.org", "-C", str(inner.parent)]
    for words in (["init", "--quiet"], ["add", "--all"], ["commit", "--quiet", "-m", "all"]):
        subprocess.run([*git, *words], check=True)
    head = subprocess.run(
        [*git, "rev-parse", "HEAD"], check=True, capture_output=True, text=True
    ).stdout.strip()
    assert dict(environment(inner.parent))["commit"] == head
    assert "commit" not in dict(environment(inner))
    (inner / "file").write_text("changed")
    assert dict(environment(inner.parent))["commit"] == (
        f"{head}, with changes that are not committed"
    )
