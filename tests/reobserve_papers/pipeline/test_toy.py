"""Adding a paper: `toy`, with every stage, built, edited and stored as golden numbers.

Design: l1 = 2 pole - rate = 7.5 and l2 = pole^2 = 16, while the table of the paper prints 15.9.
"""

from __future__ import annotations

import json
import re
import shutil
from html import unescape
from pathlib import Path

import pytest
from rocrate.rocrate import ROCrate

from reobserve.core.errors import InputError
from reobserve.core.files import read_table
from reobserve_papers.claims.claims_table import HEADER
from reobserve_papers.signals.series import Series
from reobserve_papers.steps.compute import read_design

from .conftest import Project, copy_toy
from .test_staleness import REPORTED, edited

EVIDENCE = {
    "robustness": 1, "alternatives": 1, "sensitivity": 1, "claims": 1, "report": 1, "verdicts": 1,
}  # fmt: skip
ALL = {
    "design": 1, "plant": 1, "observe": 2, "study": 1, "table": 1, "metrics": 1, "plot": 1,
    "theory": 1, **EVIDENCE,
}  # fmt: skip
FROM_DESIGN = {key: min(number, 1) for key, number in ALL.items() if key != "plant"}
STATIC = ("design", "table", "theory")  # without the plant's record
PARAMETERS = "results/toy/parameters.json"
DESIGN = "results/toy/gains.design.json"
PLANT = "results/toy/push/plant.parquet"


@pytest.fixture(scope="module")
def toy(tmp_path_factory: pytest.TempPathFactory) -> Project:
    """A copy of the project with `toy` as its only paper, built and committed."""
    project = copy_toy(tmp_path_factory.mktemp("toy"))
    git = ("git", "-c", "user.name=t", "-c", "user.email=t@example.org")
    project.run("git", "init", "--quiet")
    project.run("git", "add", "--all")
    project.run(*git, "commit", "--quiet", "--message", "all")
    project.snakemake()
    return project


def refused(project: Project, *command: str, output: bool = True) -> str:
    """Run a sub-command that must fail; returns its one-line message."""
    written = ("--output", "no/file") if output else ()
    done = project.run("reobserve-papers", *command, *written, check=False)
    assert done.returncode == 1
    assert done.stderr.count("\n") == 1, done.stderr
    assert not (project.folder / "no").exists()
    return done.stderr.strip()


def test_default_build_makes_the_table_and_the_figure(toy: Project) -> None:
    built = {name for name in toy.results() if name.startswith("toy/")}
    assert built == {
        "toy/parameters.json", "toy/gains.design.json", "toy/table1.csv", "toy/faster.study.csv",
        "toy/theory.metrics.csv", "toy/robustness.json",
        "toy/sensitivity.svg", "toy/alternatives.svg", "toy/alternatives.csv",
        *(f"toy/push/{name}.parquet" for name in ("plant", "placed", "slow")),
        *(f"toy/fig1.{suffix}" for suffix in ("svg", "caption.rst", "metrics.csv")),
    }  # fmt: skip
    header, *lines = (toy.folder / "results/toy/table1.csv").read_text().splitlines()
    assert header.startswith("gain,printed,computed,sha256:")
    assert lines == ["l1,7.5,7.5,", "l2,15.9,16.0,"]
    caption = (toy.folder / "results/toy/fig1.caption.rst").read_text()
    assert "both poles at 4.0 1/s" in caption
    assert toy.stale() == {}


@pytest.mark.nightly
def test_user_defined_figure_uses_a_user_defined_style(toy: Project) -> None:
    """Three inches wide, caption and numbers in LaTeX; other figures are unchanged."""
    sheet = toy.folder / "config/styles/mine.mplstyle"
    own = "toy={figures: {fig2: {like: fig1, title: Ours & 5 %, source: none}}}"
    wanted = [f"results/toy/fig2.{kind}" for kind in ("eps", "pgf", "metrics.tex", "caption.tex")]
    config = ("--config", "style=mine", "formats=[eps,pgf]", "notes=false", own)
    sheet.write_text("figure.figsize: 3, 3\nfont size: 7\n")
    said = toy.snakemake(*wanted, *config, check=False).stderr.rstrip().splitlines()[-1]
    place = (
        "reobserve-papers: config/styles/mine.mplstyle: line 2: there is no parameter 'font size'"
    )
    assert said.startswith(place)
    sheet.write_text("figure.figsize: 3, 3\nfont.size: 7\n")
    toy.snakemake(*wanted, *config)
    eps, pgf, metrics, caption = ((toy.folder / path).read_text("latin-1") for path in wanted)
    assert re.search(r"^%%HiResBoundingBox: 0\.0+ 0\.0+ 216\.0+ ", eps, re.MULTILINE)
    assert r"\pgfqpoint{3.000000in}" in pgf
    assert r"metric & placed & slow & unit \\" in metrics
    assert caption.startswith(r"\caption[Ours \& 5 \% (none), scenario")
    sheet.write_text("figure.figsize: 4, 3\n")
    assert toy.stale(*wanted[:1], config=config[1:]) == {"plot": 1}
    for path in [sheet, *(toy.folder / "results/toy").glob("fig2.*")]:
        path.unlink()
    assert toy.stale() == {}


def claims(toy: Project) -> dict[str, dict[str, str]]:
    rows = read_table(toy.folder / "results/claims.csv", HEADER)
    return {row["claim"]: row for row in rows}


def test_claims_get_their_verdicts(toy: Project) -> None:
    """The double pole is exact; the slow observer is neither better nor good with any gains."""
    found = claims(toy)
    assert {name: row["verdict"] for name, row in found.items()} == {
        "double_pole": "reproduced",
        "placed_is_better": "reproduced",
        "slow_is_good": "contradicted",
        "measured": "not testable",
    }
    assert found["double_pole"]["measured"].startswith("theory gains discriminant = ")
    assert found["placed_is_better"]["held"] == "36"
    reported = (toy.folder / "results/verdicts.md").read_text()
    assert "| `toy` | [Re] | 2 of 2 | 0 |" in reported
    assert reported.endswith(
        "| `toy` | 4 | 2 | 0 | 0 | 1 | 0 | 1 | 2 stated, 0 before, 1 after |\n\n"
        "`toy`: Of 10 readings of main claims, none would give another title, and 5 lack samples.\n"
    )
    page = (toy.folder / "results/report.html").read_text()
    for text in ("The slow observer errs by less than a thousandth, too.", "l₂ = 15.9", "[Re]"):
        assert text in page


ARCHIVE = "results/archive.zip"


@pytest.mark.nightly
def test_build_is_archived_with_its_provenance(toy: Project) -> None:
    """Each job with its logged command, its inputs and its outputs."""
    assert f"{ARCHIVE}: " in toy.snakemake(ARCHIVE).stderr
    crate = ROCrate(toy.folder / ARCHIVE)
    actions = {one.id: one for one in crate.get_by_type("CreateAction")}
    assert len(actions) == 1 + sum(ALL.values())
    placed = actions["#toy-push-placed"]
    assert {one.id for one in placed["object"]} == {PARAMETERS, PLANT, DESIGN}
    assert "results/report.html" in {one.id for one in actions["#build"]["result"]}
    (toy.folder / ARCHIVE).unlink()


@pytest.mark.nightly
def test_bench_is_reported_and_archived_once_it_is_built(toy: Project) -> None:
    toy.snakemake("bench")
    try:
        assert toy.stale() == REPORTED
        toy.snakemake(ARCHIVE)
        assert toy.stale(ARCHIVE) == {}
        page = (toy.folder / "results/report.html").read_text()
        assert '<article class="drawn" id="bench-torque-heatmap">' in page
        actions = {one.id: one for one in ROCrate(toy.folder / ARCHIVE).get_by_type("CreateAction")}
        scored = {one.id for one in actions["#bench-torque-scores"]["result"]}
        assert scored == {f"results/bench/torque/{name}.csv" for name in ("scores", "table")}
    finally:
        shutil.rmtree(toy.folder / "results/bench")
        (toy.folder / ARCHIVE).unlink(missing_ok=True)
        toy.snakemake()


CLAIM = """
  {name}:
    place: Nowhere
    statement: {statement}
    checks: [{{value: {value}, below: 1}}]
    threshold: after
    why: To see.
    depends_on: [{key}]
"""
STATEMENT, VALUE, KEY = "A number that nobody has.", "fig1 slow late_rms_error", "gains"


@pytest.mark.parametrize(
    ("statement", "value", "key", "said"),
    [
        (
            STATEMENT, "fig1 slow late_error", KEY,
            "checks.0.value.metric: there is no 'late_error'; did you mean 'late_rms_error'?",
        ),
        (
            STATEMENT, "fig3 slow late_rms_error", KEY,
            "checks.0.value.figure: there is no 'fig3'; did you mean 'fig1'?",
        ),
        (
            STATEMENT, VALUE, "observers.slow.gain",
            "depends_on: there is no 'observers.slow.gain'; did you mean 'observers.slow.gains'?",
        ),
        (
            "Both poles are in one place.", VALUE, KEY,
            "statement: is that of double_pole, must be another claim",
        ),
    ],
)  # fmt: skip
def test_invalid_claim_is_refused_before_the_first_job(
    toy: Project, statement: str, value: str, key: str, said: str
) -> None:
    path = toy.folder / "config/claims/toy.yaml"
    more = CLAIM.format(name="wrong", statement=statement, value=value, key=key)
    with edited(path, path.read_text(), path.read_text() + more):
        done = toy.snakemake("--dry-run", check=False)
    assert done.returncode == 1
    assert done.stderr.rstrip().splitlines()[-1] == f"reobserve-papers: claims.toy.wrong.{said}"


@pytest.mark.nightly
def test_broken_claims_fail_the_build_and_appear_in_the_report(toy: Project) -> None:
    """The metrics of a figure are known only once it exists."""
    path = toy.folder / "config/claims/toy.yaml"
    more = CLAIM.format(name="nobody", statement=STATEMENT, value="fig1 slow discriminant", key=KEY)
    with edited(path, path.read_text(), path.read_text() + more):
        done = toy.snakemake(check=False)
        assert done.returncode != 0
        assert "Traceback" not in done.stderr
        # The failing command is before a pipe: the job fails, not only its output.
        assert "latency" not in done.stderr
        sentence = "claims.toy.nobody: metric: fig1 has no 'discriminant' of slow"
        assert sentence in (toy.folder / "logs/verdicts.log").read_text()
        assert sentence in done.stderr
        assert sentence in unescape((toy.folder / "results/report.html").read_text())
        found = claims(toy)
        assert found["nobody"]["verdict"] == "broken"
        assert found["double_pole"]["verdict"] == "reproduced"
        assert not (toy.folder / "results/verdicts.md").exists()
    toy.snakemake()


@pytest.mark.nightly
def test_paper_without_claims_and_errata_is_archived(tmp_path: Path) -> None:
    project = copy_toy(tmp_path)
    (project.folder / "config/claims/toy.yaml").write_text("claims: []\n")
    (project.folder / "config/errata/toy.yaml").unlink()
    project.snakemake()
    page = (project.folder / "results/report.html").read_text()
    assert "No gaps: " in page
    project.snakemake(ARCHIVE)
    assert (project.folder / ARCHIVE).is_file()
    assert project.stale() == {}


@pytest.mark.nightly
def test_failing_figure_is_a_gap_in_the_report(toy: Project) -> None:
    """The build stops with the message of its stage, and the page shows the rest."""
    refusing = """from reobserve.core.errors import InputError


def lines(data):
    raise InputError("layout", "cannot be drawn today")


LAYOUTS = {"lines": lines}
"""
    plot = toy.folder / "src/toy_paper/plot.py"
    (toy.folder / "results/report.html").unlink()
    with edited(plot, plot.read_text(), refusing):
        assert toy.snakemake("results/toy/fig1.svg", check=False).returncode != 0
        assert not (toy.folder / "results/report.html").exists(), "one figure asks for no report"
        done = toy.snakemake(check=False)
        assert done.returncode != 0
        assert "reobserve-papers: toy.figures.fig1.layout: cannot be drawn today" in done.stderr
        page = (toy.folder / "results/report.html").read_text()
        assert "fig1" in page
        assert "Both poles are in one place." in page
        assert page.count("data:image/svg+xml") == 2  # of the job for samples, none of figures
    toy.snakemake()
    assert "data:image/svg+xml" in (toy.folder / "results/report.html").read_text()


def test_stored_design_has_its_provenance(toy: Project) -> None:
    path = toy.folder / DESIGN
    assert read_design(path, "toy", "gains") == {"gains": [7.5, 16.0], "names": ["l1", "l2"]}
    made = json.loads(path.read_text())["provenance"]
    assert (made["paper"], made["stage"], made["job"]) == ("toy", "design", "gains")
    assert made["settings"]["design"] == {"pole": 4.0}
    placed = Series.read(toy.folder / "results/toy/push/placed.parquet")
    assert placed.provenance["settings"]["design"] == {"pole": 4.0}
    assert placed["d"][-1] == pytest.approx(2.0, abs=1e-3)


IN_PROCESS = """
from pathlib import Path
from reobserve_papers.steps.evaluation import Evaluator
from reobserve_papers.parameters.parameters import Parameters
from reobserve_papers.metrics.metrics import write_metrics
from reobserve.core.files import write_table

evaluator = Evaluator(Parameters.load(Path(), "toy", seed=1))
figure = evaluator.figure("fig1")
write_metrics("mine/metrics.csv", figure.numbers)
write_table("mine/study.csv", figure.rows, list(figure.rows[0]), seal=True)
rows = evaluator.table("table1")
write_table("mine/table.csv", rows, list(rows[0]), seal=True)
"""


def test_single_process_agrees_with_the_pipeline(toy: Project) -> None:
    toy.run("python", "-c", IN_PROCESS)
    results, mine = toy.folder / "results/toy", toy.folder / "mine"
    for name, other in (
        ("metrics.csv", "fig1.metrics.csv"),
        ("study.csv", "faster.study.csv"),
        ("table.csv", "table1.csv"),
    ):
        assert (mine / name).read_text() == (results / other).read_text()
    shutil.rmtree(mine)


@pytest.mark.nightly
@pytest.mark.parametrize(
    ("module", "stale"),
    [
        ("toy_paper/design.py", FROM_DESIGN),
        # The robustness evaluates in its own process, but starts from the study.
        ("toy_paper/table.py", {"table": 1, **REPORTED}),
        ("toy_paper/plant.py", {k: n for k, n in ALL.items() if k not in STATIC}),
        ("reobserve_papers/steps/compute.py", ALL),
    ],
)
def test_edited_design_stage_makes_its_dependents_stale(
    toy: Project, module: str, stale: dict[str, int]
) -> None:
    with edited(toy.folder / "src" / module):
        assert toy.stale() == stale


@pytest.mark.nightly
@pytest.mark.parametrize(
    ("config", "stale"),
    [
        ("{designs: {gains: {pole: 5}}}", FROM_DESIGN),
        ("{designs: {gains: {title: other words}}}", {"plot": 1, **REPORTED}),
        ("{tables: {table1: {printed: [7.5, 16]}}}", {"table": 1, **EVIDENCE}),
        ("{tables: {table1: {title: other words}}}", {}),
        # A second design for one observer leaves the first to the study and the table.
        (
            "{designs: {new: {like: gains, pole: 3}}, observers: {placed: {design: new}}}",
            {"design": 1, "observe": 1, "metrics": 1, "plot": 1, "theory": 1, **EVIDENCE},
        ),
    ],
)  # fmt: skip
def test_changed_value_makes_its_dependents_stale(
    toy: Project, config: str, stale: dict[str, int]
) -> None:
    assert toy.stale(config=[f"toy={config}"]) == stale


@pytest.mark.nightly
def test_changed_seed_makes_its_samples_stale(toy: Project) -> None:
    """Records and later results, and every sample of open choices."""
    assert toy.stale(config=["seed=2"]) == {k: n for k, n in ALL.items() if k not in STATIC}


@pytest.mark.nightly
@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("depends_on: [gains]", "depends_on: [gains, seed]"),
        ("gains: [observers.slow.gains]", "gains: [observers.*.gains]"),
        ("below: 1}", "below: 0.9}"),
        ("why: What better means.", "why: What better means.\n    quantifier: always"),
    ],
)
def test_changed_choices_of_a_claim_make_its_robustness_stale(
    toy: Project, old: str, new: str
) -> None:
    with edited(toy.folder / "config/claims/toy.yaml", old, new):
        assert toy.stale() == EVIDENCE


def test_missing_or_wrong_design_is_reported_in_one_sentence(toy: Project) -> None:
    text = (toy.folder / DESIGN).read_text()
    tree = json.loads(text)
    del tree["sha256"]
    other = json.dumps(tree).replace('"job": "gains"', '"job": "others"')
    commands = [
        ("observe", PARAMETERS, "push", "placed"), ("study", PARAMETERS, "faster"),
        ("table", PARAMETERS, "table1"),
    ]  # fmt: skip
    with edited(toy.folder / DESIGN, text, other):
        for command in commands:
            said = f"reobserve-papers: {DESIGN}: is 'others' of toy, must be 'gains' of toy"
            assert refused(toy, "stage", *command, output=False) == said


def test_failing_design_is_reported_in_one_sentence(toy: Project) -> None:
    overrides = ("--overrides", '{"designs": {"gains": {"pole": -1}}}')
    said = refused(toy, "stage", "parameters", "toy", *overrides)
    assert said == "reobserve-papers: toy.designs.gains.pole: -1 must be greater than zero"
    overrides = ("--overrides", '{"designs": {"gains": {"pole": 1e200}}}')
    said = refused(toy, "stage", "parameters", "toy", *overrides)
    assert said == (
        "reobserve-papers: toy.designs.gains.pole: gives a number that is not finite "
        "(src/toy_paper/checks.py, line 13)"
    )
    said = refused(toy, "stage", "design", PARAMETERS, "gain", output=False)
    assert said == "reobserve-papers: toy.designs: there is no 'gain'; did you mean 'gains'?"
    said = refused(toy, "stage", "table", PARAMETERS, "table2", output=False)
    assert said == "reobserve-papers: toy.tables: there is no 'table2'; did you mean 'table1'?"


@pytest.mark.parametrize(
    ("content", "said"),
    [
        (None, "cannot be read (No such file or directory)"),
        ('{"design": {}, "prov', "is not JSON: Unterminated string starting at: line 1 column 16"),
        ('{"paper": "toy", "parameters": {}}', "paper: unknown key; there are: design, provenance"),
        ('{"design": 1, "provenance": {}}', "provenance.paper: is missing; the provenance"),
        ('{"design": {}, "provenance": []}', "[] must be a mapping of keys to values"),
        ('{"design": {}, "provenance": {"paper": "a", "job": "b"}}', "stage: is missing; the"),
        ("[]", "must be a mapping of keys to values"),
        (b"\xff\xfe", "cannot be read (byte 1 is not UTF-8)"),
    ],
)
def test_invalid_design_file_is_named(
    tmp_path: Path, content: str | bytes | None, said: str
) -> None:
    path = tmp_path / "gains.design.json"
    if content is not None:
        path.write_bytes(content if isinstance(content, bytes) else content.encode())
    with pytest.raises(InputError) as caught:
        read_design(path, "toy", "gains")
    assert str(caught.value).startswith(str(path))
    assert said in str(caught.value)


@pytest.mark.nightly
def test_listing_and_report_show_the_table(toy: Project) -> None:
    listing = toy.run("reobserve-papers", "list", "toy").stdout
    assert "table1  Gains  built" in listing
    assert "gains  gains that put both poles in one place  built" in listing
    assert "designs.gains.pole" in toy.run("reobserve-papers", "params", "toy").stdout
    report = toy.folder / "report.html"
    toy.snakemake("--report", "report.html")
    assert "A table of the paper, computed again" in report.read_text()
    own = toy.folder / "workflow/report/toy/table1.rst"
    own.write_text("The gains of *toy*, printed and computed.\n")
    toy.snakemake("results/toy/table1.csv")
    toy.snakemake("--report", "report.html")
    assert "The gains of <em>toy</em>, printed and computed" in report.read_text()
    own.unlink()
    report.unlink()


@pytest.mark.nightly
def test_golden_numbers_cover_the_table(toy: Project) -> None:
    """Accepted, verified, detected when changed, and accepted with old value, new value and
    reason."""
    accept = ("env", "CI=", "reobserve-papers", "accept", "toy")
    said = toy.run(*accept, "--reason", "a paper is added").stdout
    assert "toy fig1: new" in said
    assert "toy table1: new" in said
    assert ": 4 agree" in toy.run("reobserve-papers", "figdiff").stdout
    kept = toy.folder / "tests/golden/toy/table1.csv"
    before = kept.read_text()
    kept.write_text(before.replace(",16.0,", ",16.1,"))
    done = toy.run("reobserve-papers", "figdiff", check=False)
    moved = (
        "toy table1, row 2 computed: golden 16.1, found 16 (-0.62 %, 6.3e+09 times what is allowed)"
    )
    assert done.returncode == 1
    assert moved in done.stdout
    toy.run("git", "add", "--all")
    git = ("git", "-c", "user.name=t", "-c", "user.email=t@example.org")
    toy.run(*git, "commit", "--quiet", "--message", "a wrong cell")
    said = toy.run(*accept, "--reason", "the cell was wrong").stdout
    assert [line for line in said.splitlines() if "golden" in line] == [moved]
    assert kept.read_text() == before
    log = (toy.folder / "tests/golden/REASONS.md").read_text()
    assert log.splitlines()[-1].endswith(": the cell was wrong (1 number and 0 figures moved)")
