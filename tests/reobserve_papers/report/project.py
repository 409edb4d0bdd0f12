"""A made-up build for tests: the paper `toy` of the pipeline tests, without building it."""

from __future__ import annotations

import shutil
from dataclasses import replace
from pathlib import Path

from reobserve.core.files import write_table
from reobserve_papers.claims.claims_table import HEADER
from reobserve_papers.claims.sample_table import Samples, write_samples
from reobserve_papers.claims.title import row_as_stated, title_from, write_alternatives
from reobserve_papers.metrics.metrics import Metric, write_metrics
from reobserve_papers.parameters.parameters import Parameters
from tests import ROOT

TOY = ROOT / "tests/reobserve_papers/pipeline/toy"

SVG = """<svg xmlns="http://www.w3.org/2000/svg" width="300pt" height="150pt" viewBox="0 0 300 150">
<rect width="300" height="150" fill="#fff"/><path d="M0 150L300 0" stroke="#000"/></svg>
"""

CAPTION = """**A disturbance estimated** (Example 2000, Fig. 1). (a) The estimate errs by 0.1 %.
It lags.

**Left open by the paper**: the gains of *slow* <and more>. ``reobserve-papers params toy`` shows
them.
"""

_DRAWN = {
    "samples": 40, "held": 30, "tied": 4, "opposed": 3, "void": 2, "share": 0.75,
    "low": 0.598, "high": 0.858,
}  # fmt: skip

_STATED = row_as_stated("[Re?]", ["double_pole", "placed_is_better"])
_OF = {**_STATED, "claim": "placed_is_better", "verdict": "depends on unstated choices"}
ALTERNATIVES = [
    _STATED,
    {**_STATED, "kind": "main", "claim": "double_pole", "verdict": "reproduced"},
    {**_OF, "kind": "main", "held": "30 of 40"},
    {
        **_OF, "alternative": "less: <a tenth>", "kind": "convention", "why": "A tenth is <less>.",
        "held": "30 of 40", "other": "contradicted", "other_held": "1 of 40",
        "other_title": "[¬Re]", "chosen": "after",
    },
]  # fmt: skip
TITLE = title_from(ALTERNATIVES)

CLAIMS = [
    {
        "claim": "double_pole", "promised": "abstract", "place": "(3)",
        "statement": "Both poles are in one place.", "verdict": "reproduced", "holds": "yes",
        "measured": "theory gains discriminant = 0, within [-1e-09, 1e-09]", "why": "Rounding.",
        "figures": "theory",
    },
    {
        "claim": "placed_is_better", "promised": "abstract", "place": "Fig. 1",
        "statement": "Placed poles leave <less> of the error.",
        "verdict": "depends on unstated choices",
        "holds": "yes", "why": "What better means.", "figures": "fig1",
        "measured": "fig1 placed late_rms_error and so on: 2 of 2 are below 1; the worst is 0.4; "
        "fig1 slow late_rms_error = 0.4, must be below 1",
        "depends_on": "observers.slow.gains", **_DRAWN, "threshold": "after",
        "margin": "fig1 placed late_rms_error / fig1 slow late_rms_error below any number",
        "null": 0.025, "choice": "observers.slow.gains", "explained": "0.5",
        "separation": "holds with gains (observer slow) above 2 in 9 of 9, up to it in 2",
    },
    {
        "claim": "tuned", "place": "Fig. 1", "statement": "It is <script>alert(1)</script> tuned.",
        "verdict": "reproduced only by calibration", "holds": "yes", "figures": "fig1",
        "measured": "fig1 slow late_rms_error = 0.4, must be below 1", "why": "As `chosen`.",
        "depends_on": "observers.slow.gains seed", **_DRAWN, "void": 0,
        "setting": "the parameter file",
    },
    {
        "claim": "slow_is_good", "place": "Section 3",
        "statement": "The slow observer is good, too.",
        "verdict": "contradicted", "holds": "no", "figures": "fig1",
        "measured": "fig1 slow late_rms_error = 0.4, must be below 0.002", "why": "A thousandth.",
    },
    {
        "claim": "measured", "place": "Section 4", "statement": "It works in the laboratory.",
        "verdict": "not testable", "why": "There is no laboratory here.",
    },
]  # fmt: skip

BROKEN = {
    "claim": "amiss", "place": "Fig. 3", "statement": "Something else.", "verdict": "broken",
    "problem": "claims.toy.amiss: figure: there is no 'fig3'; did you mean 'fig1'?",
}  # fmt: skip


MEANINGS = {
    "late_<score>": "a score of the last second",
    "late_rms_error": "of the last second, |e|",
}


def configure(folder: Path, papers: str, formats: str) -> None:
    """Write a configuration with these papers and formats."""
    rest = "seed: 1\nsamples: 40\ncached: true\n"
    (folder / "config/config.yaml").write_text(f"papers: {papers}\nformats: {formats}\n{rest}")


def write_claims(folder: Path, rows: list[dict[str, object]]) -> None:
    """Write the table of claims like the build."""
    full = [{**dict.fromkeys(HEADER, ""), "paper": "toy", **row} for row in rows]
    write_table(folder / "results/claims.csv", full, HEADER)


def make_project(folder: Path) -> Path:
    """Write everything that a report reads, without errors."""
    built = folder / "results" / "toy"
    for name in ("config/papers", "config/claims", "config/errata", "workflow/report/toy"):
        (folder / name).mkdir(parents=True)
    built.mkdir(parents=True)
    configure(folder, "[toy]", "[svg]")
    shutil.copy(TOY / "toy.yaml", folder / "config/papers")
    shutil.copy(TOY / "claims.yaml", folder / "config/claims/toy.yaml")
    shutil.copy(TOY / "errata.yaml", folder / "config/errata/toy.yaml")
    shutil.copy(TOY / "fig1.rst", folder / "workflow/report/toy")
    shutil.copytree(ROOT / "workflow/report/replication", folder / "workflow/report/replication")
    shutil.copy(ROOT / "workflow/report/table.rst", folder / "workflow/report")
    (built / "parameters.json").write_text(Parameters.load(folder, "toy", seed=1).text())
    for picture in ("fig1", "alternatives", "sensitivity"):
        (built / f"{picture}.svg").write_text(SVG)
    (built / "fig1.caption.rst").write_text(CAPTION)
    numbers = [Metric("placed", "late_rms_error", 0.001, "1/s")]
    numbers += [
        Metric("slow", "late_rms_error", 0.4, "1/s"),
        Metric("slow", "lag", float("nan"), "s"),
    ]
    write_metrics(built / "fig1.metrics.csv", numbers)
    write_metrics(built / "theory.metrics.csv", [Metric("gains", "discriminant", -0.0, "1/s^2")])
    (built / "table1.csv").write_text("gain,computed,printed\nl1,7.5,7.5\nl2,16.0,15.9\n")
    write_claims(folder, CLAIMS)
    write_alternatives(built / "alternatives.csv", ALTERNATIVES)
    error = "fig1 slow late_rms_error"
    texts = ("0.4",) * 30 + ("1.5",) * 7 + ("-",) * 2 + (None,)
    drawn = Samples("", (error,), texts, cached=38)
    drawn_of = {"placed_is_better": drawn, "tuned": replace(drawn, cached=40)}
    write_samples(built / "robustness.json", Parameters.load(folder, "toy", seed=1), drawn_of)
    for name in ("fig1.plot", "theory"):
        log = folder / "logs" / "toy" / f"{name}.log"
        log.parent.mkdir(parents=True, exist_ok=True)
        log.write_text("+ reobserve-papers stage\n")
    return folder
