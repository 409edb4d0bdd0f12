"""Verdicts: the rule, the table, the counts; every claim of the papers can be reversed."""

from __future__ import annotations

import copy
import json
import math
import re
from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path

import pytest

from reobserve.core.errors import InputError, ReobserveError
from reobserve.core.files import read_table, write_table
from reobserve_papers.claims.checks import Check, Reference
from reobserve_papers.claims.choices import find_choice
from reobserve_papers.claims.outcomes import Outcome, outcome
from reobserve_papers.claims.registry import Claim, Quantifier, read_registry
from reobserve_papers.claims.reversals import Reversal
from reobserve_papers.claims.robustness import Robustness, Trial
from reobserve_papers.claims.robustness_file import read_robustness, to_data
from reobserve_papers.claims.table import format_reversal, row
from reobserve_papers.claims.verdict_table import put_into, table, titles
from reobserve_papers.claims.verdicts import count, replicated, title_margin, verdict
from reobserve_papers.cli.stages.claims import HEADER
from reobserve_papers.cli.stages.verdicts import run as count_verdicts
from reobserve_papers.parameters.parameters import Parameters
from tests import ROOT

ILO = Parameters.load(ROOT, "ilo", seed=1)
GAIN = "observers.sampled.K2"


def test_readme_of_results_explains_all_columns() -> None:
    text = (ROOT / "results" / "README.md").read_text(encoding="utf-8")
    table = text.partition("## Columns of `claims.csv`")[2].partition("<!--")[0]
    first = [line.split("|")[1] for line in table.splitlines() if line.startswith("|")]
    assert sorted(re.findall("`(.*?)`", " ".join(first))) == sorted(HEADER)


def marked() -> Parameters:
    """The parameter file with the gain as a choice of the claim."""
    tree = copy.deepcopy(ILO.tree)
    tree["observers"]["sampled"]["K2"]["chosen_for"] = "it, found by trying"
    return Parameters("ilo", tree, 1)


DEPENDENT = Claim("ilo", "it", choices=(find_choice(ILO, GAIN),))
FREE = Claim("ilo", "it")


def drawn(held: int, samples: int, stated: bool = True, number: float = 0.0) -> Robustness:
    """Samples of one choice and one check, of which the first ones held."""
    trials = [Trial((float(k),), Outcome(k < held, (number + k,))) for k in range(samples)]
    return Robustness(Outcome(stated, (number,)), (GAIN,), trials)


@pytest.mark.parametrize(
    ("quantifier", "held", "share", "word"),
    [
        ("can", True, (0, 20), "reproduced"),  # the nominal settings are an example
        ("can", False, (1, 20), "reproduced"),
        ("can", False, (0, 36), "contradicted"),
        ("can", False, (0, 35), "undecided"),
        ("can", False, None, "contradicted"),
        ("always", True, (36, 36), "reproduced"),
        ("always", True, (35, 35), "undecided"),
        ("always", True, (35, 36), "contradicted"),
        ("always", False, (36, 36), "contradicted"),
        ("always", True, None, "reproduced"),
    ],
)
@pytest.mark.parametrize("parameters", [ILO, marked()])
def test_single_setting_decides_existence_and_always_claims(
    quantifier: Quantifier,
    held: bool,
    share: tuple[int, int] | None,
    word: str,
    parameters: Parameters,
) -> None:
    claim = replace(DEPENDENT, quantifier=quantifier)
    robustness = None if share is None else drawn(*share, stated=held)
    assert verdict(claim, parameters, held, robustness) == word


@pytest.mark.parametrize(
    ("claim", "parameters", "held", "share", "word"),
    [
        (FREE, ILO, True, None, "reproduced"),
        (FREE, ILO, False, None, "contradicted"),
        (DEPENDENT, ILO, True, (36, 36), "reproduced"),
        (DEPENDENT, ILO, True, (35, 35), "undecided"),
        (DEPENDENT, ILO, True, (70, 71), "reproduced"),
        (DEPENDENT, ILO, True, (69, 70), "undecided"),
        (DEPENDENT, ILO, True, (90, 100), "undecided"),
        (DEPENDENT, ILO, True, (10, 20), "depends on unstated choices"),
        (DEPENDENT, ILO, True, (0, 2), "depends on unstated choices"),
        (DEPENDENT, ILO, True, (0, 1), "undecided"),
        (DEPENDENT, ILO, False, (0, 36), "contradicted"),
        (DEPENDENT, ILO, False, (1, 71), "contradicted"),
        (DEPENDENT, ILO, False, (0, 35), "undecided"),
        (DEPENDENT, ILO, False, (10, 20), "depends on unstated choices"),
        (DEPENDENT, marked(), True, (36, 36), "reproduced only by calibration"),
        (DEPENDENT, marked(), True, (0, 36), "reproduced only by calibration"),
        (DEPENDENT, marked(), False, (0, 36), "contradicted"),
        (DEPENDENT, marked(), False, (20, 40), "depends on unstated choices"),
        (replace(FREE, testable=False), ILO, True, None, "not testable"),
    ],
)
def test_verdict_follows_the_rule(
    claim: Claim, parameters: Parameters, held: bool, share: tuple[int, int] | None, word: str
) -> None:
    robustness = None if share is None else drawn(*share, stated=held)
    assert verdict(claim, parameters, held, robustness) == word


def test_table_reports_the_findings(tmp_path: Path) -> None:
    checks = (Check.parse({"value": "fig1 a error", "below": 0.05}),)
    claim = replace(DEPENDENT, checks=checks, statement="It is small.", why="A twentieth.")
    reversal = Reversal(GAIN, "N m s/rad", 2000.0, 740.123, 0.4317)
    stands = replace(drawn(70, 71), reversal=reversal)
    reported = row(claim, ILO, {"fig1": {("a", "error"): 0.02}}, stands)
    assert reported["verdict"] == "reproduced"
    assert (reported["holds"], reported["measured"]) == (
        "yes",
        "fig1 a error = 0.02, must be below 0.05",
    )
    assert (reported["samples"], reported["held"], reported["share"]) == (71, 70, "0.9859")
    assert (reported["low"], reported["high"]) == ("0.9011", "1")
    assert reported["reversal"] == f"{GAIN} from 2000 to 740.1 N m s/rad (43 % of its range)"
    reported = row(claim, ILO, {"fig1": {("a", "error"): 0.06}}, stands)
    assert reported["holds"] == "no"
    reported = row(claim, ILO, {"fig1": {("a", "error"): 0.02}}, drawn(10, 20))
    assert reported["verdict"] == "depends on unstated choices"
    same = replace(stands, trials=stands.trials[:1] * 8)
    reported = row(claim, ILO, {"fig1": {("a", "error"): 0.02}}, same)
    assert reported["verdict"] == "broken"
    assert reported["problem"] == (
        "claims.ilo.it: all 8 samples give the same numbers, must name a choice that reaches them "
        "or depend on nothing"
    )
    reported = row(claim, ILO, {"fig1": {("a", "errors"): 0.02}}, stands)
    assert reported["verdict"] == "broken"
    assert reported["problem"] == (
        "claims.ilo.it: metric: fig1 has no 'error' of a; did you mean 'errors'?"
    )
    assert format_reversal(Reversal("a.b", "word", "A", "B", 1.0)) == "a.b from A to B"
    assert format_reversal(Reversal("a.b", "word", True, False, 1.0)) == "a.b from True to False"
    assert format_reversal(None) == ""
    pair = Reversal("a.b.1", "V, A", 1.0, 2.0, 0.5)
    assert format_reversal(pair) == "a.b.1 from 1 to 2 A (50 % of its range)"
    assert (
        format_reversal(replace(pair, key="a.b", unit="1")) == "a.b from 1 to 2 (50 % of its range)"
    )
    slow, fast, step = (
        [{"kind": "prbs", "size": 1.5}],
        [{"kind": "prbs", "size": 47}],
        [{"kind": "step"}],
    )
    assert format_reversal(Reversal("a.b", "V", slow, fast, 1.0)) == "a.b size from 1.5 to 47"
    assert format_reversal(Reversal("a.b", "V", slow, step, 1.0)) == "a.b from prbs 1.5 to step"
    path, reported = tmp_path / "robustness.json", {"a": to_data(stands)}
    path.write_text(json.dumps({"paper": "ilo", "seed": 1, "samples": 40, "claims": reported}))
    assert read_robustness(path, "ilo") == {"a": stands}


def made(*verdicts: str, promised: Iterable[int] = ()) -> list[dict[str, str]]:
    return [
        {
            "paper": "a", "claim": str(k), "verdict": word, "place": f"Fig. {k}",
            "promised": "abstract" * (k in promised), "threshold": "after",
        }
        for k, word in enumerate(verdicts)
    ]  # fmt: skip


def test_replication_depends_on_its_main_claims() -> None:
    good, other, bad = "reproduced", "reproduced only by calibration", "contradicted"
    assert replicated(made(good, good, bad, promised=[0, 1]))
    assert replicated(made(good, good, other, promised=[0, 1, 2]))
    assert not replicated(made(good, other, promised=[0, 1]))  # not more than half
    assert not replicated(made(good, good, bad, promised=[0, 1, 2]))
    assert not replicated(made(good, good, "broken", promised=[0, 1, 2]))
    assert not replicated(made(good))
    assert replicated(made(good, "not testable", "not testable", promised=[0, 1, 2]))
    assert not replicated(made(good, bad, promised=[0]), "all claims")
    assert replicated(made(good, bad, promised=[0]), "abstract")
    assert title_margin(made(good)) == ""


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (
            "rrr",
            "3 of 3 main claims are reproduced and 0 contradicted; it would be [¬Re] with one "
            "contradicted or 2 fewer reproduced",
        ),
        (
            "rrc",
            "2 of 3 main claims are reproduced and 1 contradicted; it would be [Re] with 1 "
            "fewer contradicted",
        ),
        (
            "rddc",
            "1 of 4 main claims are reproduced and 1 contradicted; it would be [Re] with 1 "
            "fewer contradicted and 2 more reproduced",
        ),
    ],
)
def test_title_margin_states_what_would_change_the_verdict(words: str, said: str) -> None:
    spelled = {"r": "reproduced", "c": "contradicted", "d": "depends on unstated choices"}
    rows = made(*(spelled[word] for word in words), promised=range(len(words)))
    assert title_margin(rows) == said


def test_verdict_under_other_choices_of_main_claims() -> None:
    rows = made("reproduced", "contradicted", "not testable", "reproduced", promised=[0, 2])
    rows[3] |= {"place": "Section 2", "promised": "conclusions"}
    head, _, reported = titles(rows).strip().splitlines()
    assert (
        head
        == "| paper | abstract and conclusions | abstract | conclusions | figures | all claims |"
    )
    assert reported == (
        "| `a` | [Re] 2 of 2, 0 contradicted | [Re] 1 of 1, 0 contradicted | [Re] 1 of 1, 0 "
        "contradicted | [¬Re] 1 of 2, 1 contradicted | [¬Re] 2 of 3, 1 contradicted |"
    )
    assert "| none | [Re] 1 of 1" in titles([row | {"promised": "abstract"} for row in rows[:1]])


def test_table_counts_verdicts_and_who_set_the_thresholds() -> None:
    rows = made("reproduced", "contradicted", "not testable", "reproduced", promised=[0])
    for each, who in zip(rows, ("stated", "after", "", "after"), strict=True):
        each["threshold"] = who
    head, line, reported = (text.split("|") for text in table(rows).splitlines())
    assert len(head) == len(line) == len(reported)
    cells = dict(zip(map(str.strip, head), map(str.strip, reported), strict=True))
    assert cells["paper"] == "`a`"
    assert (cells["replication"], cells["claims"]) == ("[Re]", "4")
    assert [cells[one] for one in ("reproduced", "contradicted", "not testable")] == ["2", "1", "1"]
    assert cells["thresholds"] == "1 stated, 0 before, 2 after"


def test_broken_claims_are_counted() -> None:
    good, bad = "reproduced", "contradicted"
    assert count(made(good, bad, bad))["a"]["contradicted"] == 2


def test_counts_are_written_and_broken_claims_fail(tmp_path: Path) -> None:
    rows = [dict.fromkeys(HEADER, "") | one for one in made("reproduced", "not testable")]
    rows[0] |= {"promised": "abstract", "threshold": "stated", "figures": "fig1 theory"}
    rows = [row | {"paper": "ilo"} for row in rows]
    write_table(tmp_path / "claims.csv", rows, HEADER)
    count_verdicts(tmp_path / "claims.csv", tmp_path / "verdicts.md")
    written = (tmp_path / "verdicts.md").read_text().splitlines()
    assert (
        written[2] == "| `ilo` | [Re] | 2 | 1 | 0 | 0 | 0 | 0 | 1 | 1 stated, 0 before, 1 after |"
    )
    assert len(written) == 3
    wrong = {"paper": "b", "claim": "all", "verdict": "broken", "problem": "No x."}
    rows.append(dict.fromkeys(HEADER, "") | wrong)
    write_table(tmp_path / "claims.csv", rows, HEADER)
    with pytest.raises(ReobserveError, match=r"^No x\.$"):
        count_verdicts(tmp_path / "claims.csv", tmp_path / "none.md")
    assert not (tmp_path / "none.md").exists()
    assert len(read_table(tmp_path / "claims.csv", HEADER)) == 3


# Every claim of the papers, with constructed results.

Numbers = dict[str, dict[tuple[str, str], float]]
PAPERS = [path.stem for path in sorted((ROOT / "config/claims").glob("*.yaml"))]
PARAMETER_FILES = {paper: Parameters.load(ROOT, paper) for paper in PAPERS}
CLAIMS = [
    pytest.param(claim, id=f"{paper}-{claim.name}")
    for paper in PAPERS
    for claim in read_registry(ROOT, PARAMETER_FILES[paper]).claims
    if claim.checks
]


def fed(claim: Claim, broken: Check | None = None) -> Numbers:
    """Results that satisfy every check but ``broken``; a single one may contradict another."""
    numbers: Numbers = {}

    def put(reference: Reference, value: float) -> None:
        numbers.setdefault(reference.figure, {})[reference[1:]] = value

    checks = [check for check in claim.checks if check is not broken]
    for check in [broken, *checks] if broken else checks:
        if check is not broken and broken and set(check.references) & set(broken.references):
            continue
        chain: dict[Reference, float] = {}  # of differences: a - b, then b - c or c - a
        for k, (reference, value) in enumerate(zip(check.value, goal(check), strict=True)):
            number = wrong(check, k, value) if check is broken else value
            if check.how == "minus":
                other = check.other[k]
                if reference in chain:
                    chain.setdefault(other, chain[reference] - number)
                else:
                    chain[reference] = chain.setdefault(other, 0.0) + number
                continue
            if check.how:
                put(check.other[k], 1.0)
            put(reference, number)
        for reference, number in chain.items():
            put(reference, number)
    for reference in (ref for check in claim.checks for ref in check.references):
        numbers.setdefault(reference.figure, {}).setdefault(reference[1:], 1.0)
    return numbers


def goal(check: Check) -> list[float]:
    """Numbers that satisfy a check by itself, relative to one or nothing."""
    count = len(check.value)
    if check.relation in ("rising", "falling"):
        return [float(k if check.relation == "rising" else -k) for k in range(count)]
    if check.relation == "within":
        return [sum(check.bound) / 2] * count
    if check.relation == "exists":
        return [1.0 if check.bound else math.nan] * count
    return [check.bound - 1.0 if check.relation == "below" else check.bound + 1.0] * count


def wrong(check: Check, k: int, value: float) -> float:
    """A number that just violates the check: beyond its bound, or in reversed order."""
    if check.relation in ("rising", "falling"):
        return -value
    if check.relation == "within":
        return math.nextafter(check.bound[k % 2], -math.inf if k % 2 == 0 else math.inf)
    if check.relation == "exists":
        return math.nan if check.bound else 1.0
    return float(check.bound)


def satisfied(claim: Claim, numbers: Numbers) -> list[bool]:
    return [check.holds(numbers) for check in claim.checks]


@pytest.mark.parametrize("claim", CLAIMS)
def test_each_check_of_a_claim_can_reverse_it(claim: Claim) -> None:
    """A check holds on satisfying results; on results that just fail, the claim is refuted."""
    for check in claim.checks:
        alone = replace(claim, checks=(check,), choices=())
        parameters = PARAMETER_FILES[claim.paper]
        good, bad = fed(alone), fed(alone, check)
        assert outcome(alone, good).held
        assert not outcome(alone, bad).held
        assert row(alone, parameters, good, None)["verdict"] == "reproduced"
        assert row(alone, parameters, bad, None)["verdict"] == "contradicted"
        # With all checks of the claim: a single failing one suffices.
        whole = fed(claim, check)
        assert satisfied(claim, whole)[claim.checks.index(check)] is False
        assert not outcome(claim, whole).held


def test_verdicts_are_inserted_between_markers_in_the_readme(tmp_path: Path) -> None:
    readme, verdicts = tmp_path / "README.md", tmp_path / "verdicts.md"
    readme.write_text("before\n<!-- verdicts -->\nold\n<!-- end -->\nafter\n")
    verdicts.write_text("| new |\n")
    for _ in range(2):
        put_into(readme, verdicts)
        reported = "before\n<!-- verdicts -->\n\n| new |\n\n<!-- end -->\nafter\n"
        assert readme.read_text() == reported
    readme.write_text("before\n<!-- verdicts -->\nold\n")
    with pytest.raises(InputError, match=r"must have the lines <!-- verdicts --> and <!-- end -->"):
        put_into(readme, verdicts)
    assert readme.read_text() == "before\n<!-- verdicts -->\nold\n"


REPORTED = """| paper | claims |
|---|---|
| `a` | 3 |
| `b` | 4 |
"""


def test_readme_keeps_rows_of_papers_not_evaluated(tmp_path: Path) -> None:
    readme, verdicts = tmp_path / "README.md", tmp_path / "verdicts.md"
    readme.write_text(f"<!-- verdicts -->\n\n{REPORTED}\n<!-- end -->\n")
    verdicts.write_text("| paper | claims |\n|---|---|\n| `b` | 5 |\n| `c` | 6 |\n")
    put_into(readme, verdicts, ["a", "b", "c"])
    reported = REPORTED.replace("| 4 |\n", "| 5 |\n| `c` | 6 |\n")
    assert readme.read_text() == f"<!-- verdicts -->\n\n{reported}\n<!-- end -->\n"
    put_into(readme, verdicts, ["b", "c"])  # a is no longer a paper
    assert readme.read_text() == f"<!-- verdicts -->\n\n{verdicts.read_text()}\n<!-- end -->\n"


@pytest.mark.parametrize(("place", "unit"), [(0, " V"), (1, " A"), (2, ""), (3, "")])
def test_position_beyond_the_units_has_no_unit(place: int, unit: str) -> None:
    reversal = Reversal(f"a.b.{place}", "V, A", 1.0, 2.0, 0.5)
    assert format_reversal(reversal) == f"a.b.{place} from 1 to 2{unit} (50 % of its range)"
