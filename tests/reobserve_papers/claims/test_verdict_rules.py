"""Verdicts: the rule, titles, table and counts; every claim of the papers can be reversed."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
import pytest

from reobserve.core.errors import InputError, ReobserveError
from reobserve.core.files import read_table, write_table, write_text
from reobserve_papers.claims.checks import Check, Numbers, Reference
from reobserve_papers.claims.claims_table import HEADER, row
from reobserve_papers.claims.decider import Decider
from reobserve_papers.claims.entries import Quantifier, Result
from reobserve_papers.claims.inquiry import Robustness, Trial
from reobserve_papers.claims.outcomes import outcome
from reobserve_papers.claims.registry import Claim, Registry, read_registry
from reobserve_papers.claims.sequential import ERROR
from reobserve_papers.claims.title import Title, row_as_stated, write_alternatives
from reobserve_papers.claims.verdict_rules import (
    CALIBRATED,
    CONTRADICTED,
    DEPENDS,
    NOT_TESTABLE,
    REPRODUCED,
    UNDECIDED,
    Counted,
    Judged,
    count,
    main_claims,
    open_verdicts,
    possible,
    title_by,
)
from reobserve_papers.claims.verdict_table import (
    counts_table,
    dissent,
    put_into,
    titles_table,
)
from reobserve_papers.cli.stages.verdicts import run as count_verdicts
from reobserve_papers.parameters.parameters import Parameters
from tests import ROOT

from .stub import GAIN, claim


def test_readme_of_results_explains_all_columns() -> None:
    text = (ROOT / "results" / "README.md").read_text(encoding="utf-8")
    table = text.partition("## Columns of `claims.csv`")[2].partition("<!--")[0]
    first = [line.split("|")[1] for line in table.splitlines() if line.startswith("|")]
    assert sorted(re.findall("`(.*?)`", " ".join(first))) == sorted(HEADER)


# The rule.

OPEN_ABOVE = (REPRODUCED, DEPENDS)
OPEN_BELOW = (DEPENDS, CONTRADICTED)
ANY = (REPRODUCED, DEPENDS, CONTRADICTED)


@pytest.mark.parametrize(
    ("held", "samples", "allowed"),
    [
        (36, 36, (REPRODUCED,)),
        (35, 35, OPEN_ABOVE),
        (35, 36, OPEN_ABOVE),
        (70, 71, (REPRODUCED,)),
        (69, 70, OPEN_ABOVE),
        (10, 20, (DEPENDS,)),  # decided by both lines: below nine tenths and above one
        (90, 100, OPEN_ABOVE),
        (10, 100, OPEN_BELOW),
        (1, 1, ANY),
        (0, 1, ANY),
        (0, 0, ANY),
        (0, 35, OPEN_BELOW),
        (0, 36, (CONTRADICTED,)),  # at most a tenth
        (1, 36, OPEN_BELOW),
        (1, 71, (CONTRADICTED,)),
    ],
)
@pytest.mark.parametrize("quantifier", ["can", "is"])
def test_share_of_samples_decides(
    quantifier: Quantifier, held: int, samples: int, allowed: tuple[str, ...]
) -> None:
    """Of what can be so as of what is so: four samples in twenty reproduce neither."""
    assert possible(quantifier, Counted(held, samples), 0.9) == allowed


@pytest.mark.parametrize(
    ("held", "samples", "allowed"),
    [
        (36, 36, (REPRODUCED,)),
        (35, 35, (REPRODUCED, CONTRADICTED)),
        (35, 36, (CONTRADICTED,)),  # one counterexample
        (999, 1000, (CONTRADICTED,)),
        (0, 0, (REPRODUCED, CONTRADICTED)),
    ],
)
def test_one_counterexample_contradicts_what_is_always_so(
    held: int, samples: int, allowed: tuple[str, ...]
) -> None:
    assert possible("always", Counted(held, samples), 0.9) == allowed


@pytest.mark.parametrize(
    ("share", "held", "samples", "allowed"),
    [
        (0.8, 17, 17, (REPRODUCED,)),
        (0.8, 16, 16, OPEN_ABOVE),
        (0.95, 77, 77, OPEN_ABOVE),
        (0.95, 78, 78, (REPRODUCED,)),
    ],
)
def test_other_shares_need_other_numbers_of_samples(
    share: float, held: int, samples: int, allowed: tuple[str, ...]
) -> None:
    assert possible("is", Counted(held, samples), share) == allowed


@pytest.mark.parametrize(
    ("held", "whole", "share", "word"),
    [
        (29, 32, 0.9, REPRODUCED),  # 0.906
        (29, 32, 0.95, DEPENDS),
        (28, 32, 0.9, DEPENDS),
        (9, 10, 0.9, REPRODUCED),  # not 9.000000000000002
        (1, 10, 0.9, CONTRADICTED),
        (2, 10, 0.9, DEPENDS),
        (2, 10, 0.8, CONTRADICTED),
        (1, 1, 0.9, REPRODUCED),
        (0, 1, 0.9, CONTRADICTED),
    ],
)
def test_counts_of_all_settings_are_exact(held: int, whole: int, share: float, word: str) -> None:
    counted = Counted(held, whole, whole=True)
    assert possible("is", counted, share) == (word,)
    assert possible("always", counted, share) == (REPRODUCED if held == whole else CONTRADICTED,)
    assert counted.interval() == (held / whole, held / whole)


def test_setting_at_which_it_holds_makes_it_no_contradiction() -> None:
    for held, samples in ((0, 36), (1, 71)):
        assert possible("can", Counted(held, samples), 0.9, fitted=True) == (CALIBRATED,)
    assert possible("can", Counted(0, 35), 0.9, fitted=True) == (DEPENDS, CALIBRATED)
    assert possible("can", Counted(10, 20), 0.9, fitted=True) == (DEPENDS,)
    assert possible("can", Counted(36, 36), 0.9, fitted=True) == (REPRODUCED,)


@pytest.mark.parametrize("share", [0.95, 0.5, 0.05])
def test_wrong_verdicts_are_rare_however_often_one_looks(share: float) -> None:
    """In sequences of samples that end when decided, one in twenty or fewer ends wrong."""
    true = {0.95: REPRODUCED, 0.5: DEPENDS, 0.05: CONTRADICTED}[share]
    runs, most = 300, 400
    stream, wrong, right = np.random.default_rng(round(100 * share)), 0, 0
    for _ in range(runs):
        held = np.cumsum(stream.random(most) < share)
        for samples in range(1, most + 1):
            allowed = possible("is", Counted(int(held[samples - 1]), samples), 0.9)
            if len(allowed) == 1:
                wrong, right = wrong + (allowed != (true,)), right + (allowed == (true,))
                break
    assert wrong <= ERROR * runs
    assert right >= 0.7 * runs


def test_interval_of_a_share_is_that_of_the_rest_turned_over() -> None:
    low, high = Counted(3, 40).interval()
    other_low, other_high = Counted(37, 40).interval()
    assert (low, high) == (1 - other_high, 1 - other_low)
    assert low < 3 / 40 < high
    assert Counted(40, 40).interval()[1] == 1
    assert Counted(0, 40).interval()[0] == 0


# By a decider, who sees the parameter file, too.

RELATION = {"value": "fig1 a gain", "above": 1.0}
SAMPLED = claim("fig1 a gain", GAIN, above=1.0)
FREE = claim("fig1 a gain", above=1.0)


def drawn(held: int, samples: int, whole: int | None = None) -> Robustness:
    """Samples of one choice and one check, of which the first ones held."""
    gain = Reference("fig1", "a", "gain")
    trials = [
        Trial(partial(tuple, [float(k)]), {gain: 2.0 if k < held else 0.5}) for k in range(samples)
    ]
    return Robustness((GAIN,), trials, whole)


def stated(gain: float) -> Numbers:
    return {"fig1": {("a", "gain"): gain}}


def judged(one: Claim, gain: float, samples: Robustness | None = None) -> Decider:
    known = {} if samples is None else {one.name: samples}
    return Decider(Registry(claims=[one]), stated(gain), known, seed=1)


@pytest.mark.parametrize("gain", [2.0, 0.5])
@pytest.mark.parametrize(
    ("held", "word"), [(36, REPRODUCED), (0, CONTRADICTED), (18, DEPENDS), (34, UNDECIDED)]
)
def test_parameter_file_has_no_vote(gain: float, held: int, word: str) -> None:
    found = judged(SAMPLED, gain, drawn(held, 36))
    assert found.judged["it"].verdict == word
    assert found.holds(SAMPLED) is (gain > 1)


def test_parameter_file_decides_what_depends_on_nothing() -> None:
    assert judged(FREE, 2.0).judged["it"].verdicts == (REPRODUCED,)
    assert judged(FREE, 0.5).judged["it"].verdicts == (CONTRADICTED,)
    assert judged(replace(FREE, testable=False), 2.0).judged["it"].verdict == NOT_TESTABLE


def test_parameter_file_is_a_counterexample_as_any_other() -> None:
    always = replace(SAMPLED, quantifier="always")
    assert judged(always, 0.5, drawn(36, 36)).judged["it"].verdict == CONTRADICTED
    assert judged(always, 2.0, drawn(36, 36)).judged["it"].verdict == REPRODUCED
    assert judged(always, 2.0, drawn(35, 36)).judged["it"].verdict == CONTRADICTED


CAN = replace(SAMPLED, quantifier="can")
SHOWN = replace(SAMPLED, quantifier="shown")
PRINTED = replace(SAMPLED, printed=True)
SEARCHED = "at 4711, of 300 tries between 500 and 5000, seed 1"


@pytest.mark.parametrize(
    ("one", "gain", "held", "word", "setting"),
    [
        (CAN, 2.0, 0, CALIBRATED, "the parameter file"),
        (PRINTED, 2.0, 0, CALIBRATED, "the parameter file"),
        (CAN, 0.5, 1, CALIBRATED, f"{GAIN} 0"),
        (CAN, 0.5, 0, CONTRADICTED, ""),
        (replace(CAN, setting=SEARCHED), 0.5, 0, CALIBRATED, SEARCHED),
        (SAMPLED, 2.0, 1, CONTRADICTED, "the parameter file"),  # asks for no setting
        (replace(SAMPLED, setting=SEARCHED), 0.5, 0, CONTRADICTED, SEARCHED),
        (CAN, 2.0, 36, DEPENDS, "the parameter file"),
        (SHOWN, 2.0, 0, REPRODUCED, "the parameter file"),
        (SHOWN, 0.5, 1, REPRODUCED, f"{GAIN} 0"),
        (SHOWN, 0.5, 0, CONTRADICTED, ""),
        (replace(SHOWN, setting=SEARCHED), 0.5, 0, REPRODUCED, SEARCHED),
    ],
)
def test_known_setting_makes_what_can_be_or_is_printed_calibrated_and_shows_the_shown(
    one: Claim, gain: float, held: int, word: str, setting: str
) -> None:
    found = judged(one, gain, drawn(held, 72))
    assert found.judged["it"].verdict == word
    assert found.setting(one) == setting


def test_setting_of_what_is_always_so_is_a_counterexample() -> None:
    always = replace(SAMPLED, quantifier="always")
    assert judged(always, 0.5, drawn(36, 36)).setting(always) == "the parameter file"
    assert judged(always, 2.0, drawn(35, 36)).setting(always) == f"{GAIN} 35"
    assert judged(always, 2.0, drawn(36, 36)).setting(always) == ""


def test_counted_settings_are_exact_for_a_decider() -> None:
    assert judged(SAMPLED, 2.0, drawn(29, 32, whole=32)).judged["it"].verdicts == (REPRODUCED,)
    assert judged(SAMPLED, 2.0, drawn(29, 32)).judged["it"].verdicts == OPEN_ABOVE


# Titles.


def main(word: str, name: str = "", **parts: tuple[str, ...] | str) -> Judged:
    """A main claim with a verdict."""
    body = {"place": "Fig. 1", "promised": ("abstract",), "purpose": (), **parts}
    return Judged(name, verdicts=(word,), **body)  # type: ignore[arg-type]


SPELT = {"r": REPRODUCED, "k": CALIBRATED, "d": DEPENDS, "c": CONTRADICTED, "u": UNDECIDED}


@pytest.mark.parametrize(
    ("words", "title"),
    [
        ("r", "[Re]"),
        ("rrd", "[Re]"),
        ("rrk", "[Re]"),
        ("rru", "[Re]"),
        ("rd", "[Re?]"),  # not more than half
        ("rkk", "[Re?]"),
        ("", "[Re?]"),
        ("ru", "[Re?]"),
        ("rrrc", "[¬Re]"),
        ("c", "[¬Re]"),
        ("dc", "[¬Re]"),
    ],
)
def test_title_follows_from_the_verdicts_on_main_claims(words: str, title: str) -> None:
    assert title_by([SPELT[letter] for letter in words], 0.5) == title


def test_title_asks_for_another_majority_where_that_is_the_convention() -> None:
    two_of_three = [REPRODUCED, REPRODUCED, DEPENDS]
    assert title_by(two_of_three, 0.5) == "[Re]"
    assert title_by(two_of_three, 0.6667) == "[Re?]"
    assert title_by([*two_of_three, REPRODUCED], 0.6667) == "[Re]"


def test_broken_main_claim_is_no_replication() -> None:
    assert title_by([REPRODUCED, REPRODUCED, "broken"], 0.5) == "[¬Re]"


def test_open_interval_of_a_main_claim_is_named_where_it_would_change_the_title() -> None:
    sure = [main(REPRODUCED, "a"), main(REPRODUCED, "b")]
    short = replace(main("", "c"), verdicts=OPEN_ABOVE)
    assert list(open_verdicts([*sure, short], 0.5)) == []  # [Re] with either
    seldom = replace(short, verdicts=OPEN_BELOW)
    assert list(open_verdicts([*sure, seldom], 0.5)) == [("c", CONTRADICTED, "[¬Re]")]
    half = [main(REPRODUCED, "a"), short]
    assert list(open_verdicts(half, 0.5)) == [("c", REPRODUCED, "[Re]")]


def test_main_claims_follow_two_conventions() -> None:
    claims = [
        main(REPRODUCED, "abstract"),
        main(REPRODUCED, "both", promised=("abstract", "conclusions"), place="Section 2"),
        main(REPRODUCED, "conclusions", promised=("conclusions",), place="Figs 2 and 3"),
        main(REPRODUCED, "purpose", promised=(), purpose=("abstract",), place="Section I"),
        main(REPRODUCED, "none", promised=(), place="(3)"),
        main(NOT_TESTABLE, "untestable"),
    ]

    def names(convention: str, purpose: str = "ignored") -> list[str]:
        return [one.name for one in main_claims(claims, convention, purpose)]

    assert names("abstract and conclusions") == ["abstract", "both", "conclusions"]
    assert names("abstract") == ["abstract", "both"]
    assert names("conclusions") == ["both", "conclusions"]
    assert names("figures") == ["abstract", "conclusions"]
    assert names("all claims") == ["abstract", "both", "conclusions", "purpose", "none"]
    assert names("abstract", "counts") == ["abstract", "both", "purpose"]


# The table.


def test_table_reports_the_findings() -> None:
    one = replace(SAMPLED, statement="It is large.", why="So.")
    samples = drawn(70, 71)
    found = row(one, judged(one, 2.0, samples), stated(2.0), samples)
    assert found["verdict"] == REPRODUCED
    assert (found["holds"], found["measured"]) == ("yes", "fig1 a gain = 2, must be above 1")
    numbers = [found[key] for key in ("samples", "held", "tied", "opposed")]
    assert numbers == [71, 70, 0, 1]
    assert (found["share"], found["low"], found["high"]) == ("0.9859", "0.9011", "1")
    assert "setting" not in found
    assert "null" not in found
    other = row(one, judged(one, 0.5, samples), stated(0.5), samples)
    assert (other["verdict"], other["holds"]) == (REPRODUCED, "no")


def test_table_reports_a_setting_of_what_is_calibrated_or_contradicted() -> None:
    for one, word in ((CAN, CALIBRATED), (SAMPLED, CONTRADICTED)):
        found = row(one, judged(one, 0.5, drawn(1, 72)), stated(0.5), drawn(1, 72))
        assert (found["verdict"], found["setting"]) == (word, f"{GAIN} 0")


def test_table_says_what_separates_the_outcomes_of_what_depends() -> None:
    samples = drawn(40, 80)
    found = row(SAMPLED, judged(SAMPLED, 2.0, samples), stated(2.0), samples)
    assert (found["verdict"], found["choice"]) == (DEPENDS, GAIN)
    assert 0.8 < float(found["explained"]) <= 1
    said = rf"holds with {GAIN} up to [\d.]+ in \d+ of \d+ samples, above it in \d+ of \d+"
    assert re.fullmatch(said, found["separation"])
    assert found["share"] == "0.5"
    for held, one in ((80, SAMPLED), (1, CAN)):
        found = row(one, judged(one, 0.5, drawn(held, 80)), stated(0.5), drawn(held, 80))
        assert not {"choice", "explained", "separation"} & set(found)


@pytest.mark.parametrize("void", [0, 1, 9])
def test_table_counts_ties_and_the_null(void: int) -> None:
    """Of 40 cases 24 hold, 8 are tied, 7 opposed and one is lost; the null always holds.

    Samples that are no case change nothing.
    """
    a, b = Reference("fig1", "a", "error"), Reference("fig1", "b", "error")
    idle = Reference("fig1", "idle", "error")
    one = claim("fig1 a error", GAIN, over="fig1 b error", below=0.9)
    one = replace(one, null={"a": "idle"})
    errors = [0.5] * 24 + [1.0] * 8 + [2.0] * 7
    found = [{a: error, b: 1.0, idle: 0.1} for error in errors]
    found += [{a: 0.1, b: math.nan, idle: 0.1}] * void
    trials = [Trial(partial(tuple, [float(k)]), each) for k, each in enumerate([*found, None])]
    samples = Robustness((GAIN,), trials)
    numbers = {"fig1": {("a", "error"): 0.5, ("b", "error"): 1.0, ("idle", "error"): 0.1}}
    decider = Decider(Registry(claims=[one]), numbers, {"it": samples}, 1)
    cells = row(one, decider, numbers, samples)
    assert [cells[key] for key in ("samples", "held", "tied", "opposed")] == [40, 24, 8, 7]
    assert cells["null"] == f"{39 / 40:.4g}"
    assert cells["share"] == f"{24 / 40:.4g}"
    assert cells["margin"] == "below any number from 0.5 to 1"
    assert cells["separation"] == "40 samples are too few to tell which choice decides"


def test_claim_that_no_choice_reaches_is_broken() -> None:
    samples = drawn(8, 8)
    found = row(SAMPLED, judged(SAMPLED, 2.0, samples), stated(2.0), samples)
    assert found["verdict"] == "broken"
    assert found["problem"] == (
        "claims.ilo.it: all 8 samples give the same numbers, must name a choice that reaches them "
        "or depend on nothing"
    )


def test_claim_that_names_an_unknown_number_is_broken() -> None:
    numbers = {"fig1": {("a", "gains"): 0.02}}
    decider = Decider(Registry(claims=[FREE]), numbers, {}, 1)
    assert decider.judged["it"].verdict == "broken"
    found = row(FREE, decider, numbers, None)
    assert found["verdict"] == "broken"
    assert found["problem"] == (
        "claims.ilo.it: metric: fig1 has no 'gain' of a; did you mean 'gains'?"
    )


def test_claim_without_samples_is_broken() -> None:
    one = replace(SAMPLED, null={"a": "idle"})
    decider = judged(one, 2.0)
    assert decider.judged["it"].verdict == "broken"
    found = row(one, decider, stated(2.0), None)
    assert found["verdict"] == "broken"
    assert found["problem"] == "claims.ilo.it: has no samples, must be sampled again"


def made(*verdicts: str, promised: Iterable[int] = ()) -> list[dict[str, str]]:
    return [
        {
            "paper": "a", "claim": str(k), "verdict": word, "place": f"Fig. {k}",
            "promised": "abstract" * (k in promised), "threshold": "after",
        }
        for k, word in enumerate(verdicts)
    ]  # fmt: skip


TITLE = Title("[Re?]", {"a": REPRODUCED, "b": DEPENDS}, ("[Re]: It is so.",), (), 3, 1)


def cells_of(text: str) -> dict[str, str]:
    """The cells of the only row of a table."""
    head, line, reported = (line.split("|")[1:-1] for line in text.splitlines())
    assert len(head) == len(line) == len(reported)
    return dict(zip(map(str.strip, head), map(str.strip, reported), strict=True))


def test_table_counts_verdicts_and_who_set_the_thresholds() -> None:
    rows = made("reproduced", "contradicted", "not testable", "reproduced", promised=[0])
    for each, who in zip(rows, ("stated", "after", "", "after"), strict=True):
        each["threshold"] = who
    cells = cells_of(counts_table(rows))
    assert (cells["paper"], cells["claims"]) == ("`a`", "4")
    assert [cells[one] for one in ("reproduced", "contradicted", "not testable")] == ["2", "1", "1"]
    assert cells["thresholds"] == "1 stated, 0 before, 2 after"


def test_table_of_titles_has_a_sentence_that_was_written_for_it() -> None:
    result = Result(written_for=TITLE.in_words, sentence="Half of it holds.")
    cells = cells_of(titles_table({"a": TITLE}, {"a": result}))
    assert list(cells.values()) == ["`a`", "[Re?]", "1 of 2", "0", "Half of it holds."]
    for other in (replace(TITLE, word="[Re]"), replace(TITLE, mains={"a": CONTRADICTED})):
        assert cells_of(titles_table({"a": other}, {"a": result}))["result"] == ""
    assert cells_of(titles_table({"a": TITLE}, {}))["result"] == ""
    with pytest.raises(ValueError, match="has 26 words, must have 25 at most"):
        Result(written_for="[Re]", sentence="word " * 26)


def test_dissent_is_counted_and_listed() -> None:
    assert dissent(TITLE) == (
        "Of 3 readings of main claims, 1 would give another title, and 1 lack samples.\n\n"
        "- [Re]: It is so.\n"
    )
    none = "Of 0 readings of main claims, none would give another title, and none lack samples.\n"
    plain = Title("[Re]", {"a": REPRODUCED})
    assert dissent(plain) == none
    assert dissent(replace(plain, undecided=("so",))) == f"{none}\n- Undecided: so.\n"
    nothing = Title("[Re?]")
    assert dissent(nothing) == "No claim is a main claim.\n"
    assert cells_of(titles_table({"a": nothing}, {}))["replication"] == "no main claim"


def test_broken_claims_are_counted() -> None:
    assert count(made("reproduced", "broken", "broken"))["a"]["broken"] == 2


def test_counts_are_written_and_broken_claims_fail(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    rows = [dict.fromkeys(HEADER, "") | one for one in made("reproduced", "not testable")]
    rows[0] |= {"promised": "abstract", "threshold": "stated", "figures": "fig1 theory"}
    rows = [row | {"paper": "ilo"} for row in rows]
    parameters = tmp_path / "results/ilo/parameters.json"
    write_text(parameters, Parameters.load(ROOT, "ilo").text())
    claims, verdicts = tmp_path / "results/claims.csv", tmp_path / "results/verdicts.md"
    write_table(claims, rows, HEADER)
    stated = row_as_stated("[Re]", ["0"])
    main = {**stated, "kind": "main", "claim": "0", "verdict": "reproduced"}
    write_alternatives(tmp_path / "results/ilo/alternatives.csv", [stated, main])
    count_verdicts([parameters])
    written = verdicts.read_text().splitlines()
    assert written[2] == "| `ilo` | [Re] | 1 of 1 | 0 |  |"
    assert written[6] == "| `ilo` | 2 | 1 | 0 | 0 | 0 | 0 | 1 | 1 stated, 0 before, 1 after |"
    assert written[8].startswith("`ilo`: Of 0 readings of main claims, none would")
    verdicts.unlink()
    monkeypatch.chdir(tmp_path)
    count_verdicts([])  # of the folder where it is typed
    assert verdicts.read_text().splitlines() == written
    verdicts.unlink()
    wrong = {"paper": "b", "claim": "all", "verdict": "broken", "problem": "No x."}
    rows.append(dict.fromkeys(HEADER, "") | wrong)
    write_table(claims, rows, HEADER)
    with pytest.raises(ReobserveError, match=r"^No x\.$"):
        count_verdicts([parameters])
    assert not verdicts.exists()
    assert len(read_table(claims, HEADER)) == 3


# Every claim of the papers, with constructed results.

PAPERS = [path.stem for path in sorted((ROOT / "config/claims").glob("*.yaml"))]
CLAIMS = [
    pytest.param(claim, id=f"{paper}-{claim.name}")
    for paper in PAPERS
    for claim in read_registry(ROOT, Parameters.load(ROOT, paper)).claims
    if claim.checks
]


def fed(claim: Claim, broken: Check | None = None) -> dict[str, dict[tuple[str, str], float]]:
    """Results that satisfy every check but ``broken``; a single one may contradict another."""
    numbers: dict[str, dict[tuple[str, str], float]] = {}

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
        good, bad = fed(alone), fed(alone, check)
        assert outcome(alone, good) == "holds"
        assert outcome(alone, bad) != "holds"
        assert verdict_on(alone, good) == "reproduced"
        assert verdict_on(alone, bad) == "contradicted"
        # With all checks of the claim: a single failing one suffices.
        whole = fed(claim, check)
        assert satisfied(claim, whole)[claim.checks.index(check)] is False
        assert outcome(claim, whole) != "holds"


def verdict_on(claim: Claim, numbers: Numbers) -> str:
    """The verdict in the table, with nothing left open."""
    claim = replace(claim, null={}, setting="")
    decider = Decider(Registry(claims=[claim]), numbers, {}, 1)
    return str(row(claim, decider, numbers, None)["verdict"])


def test_verdicts_are_inserted_between_markers_in_the_readme(tmp_path: Path) -> None:
    readme, verdicts = tmp_path / "README.md", tmp_path / "verdicts.md"
    readme.write_text("before\n<!-- verdicts -->\nold\n<!-- end -->\nafter\n")
    verdicts.write_text("| paper |\n|---|\n| `a` |\n")
    for _ in range(2):
        put_into(readme, verdicts.read_text(), ["a"])
        table = verdicts.read_text()
        reported = f"before\n<!-- verdicts -->\n\n{table}\n<!-- end -->\nafter\n"
        assert readme.read_text() == reported
    readme.write_text("before\n<!-- verdicts -->\nold\n")
    with pytest.raises(InputError, match=r"must have the lines <!-- verdicts --> and <!-- end -->"):
        put_into(readme, verdicts.read_text(), ["a"])
    assert readme.read_text() == "before\n<!-- verdicts -->\nold\n"


REPORTED = """| paper | claims |
|---|---|
| `a` | 3 |
| `b` | 4 |
"""


def test_readme_keeps_rows_of_papers_not_evaluated(tmp_path: Path) -> None:
    readme, verdicts = tmp_path / "README.md", tmp_path / "verdicts.md"
    readme.write_text(f"<!-- verdicts -->\n\n{REPORTED}\n<!-- end -->\n")
    rows = "| paper | claims |\n|---|---|\n| `b` | 5 |\n| `c` | 6 |\n"
    verdicts.write_text(f"{rows}\n- `b` [Re]: y.\n- `c` [Re]: z.\n")
    put_into(readme, verdicts.read_text(), ["a", "b", "c"])
    reported = REPORTED.replace("| 4 |\n", "| 5 |\n| `c` | 6 |\n")
    assert readme.read_text() == f"<!-- verdicts -->\n\n{reported}\n<!-- end -->\n"
    put_into(readme, verdicts.read_text(), ["b", "c"])  # a is no longer a paper
    assert readme.read_text() == f"<!-- verdicts -->\n\n{rows}\n<!-- end -->\n"


def test_refused_settings_are_no_counterexamples() -> None:
    """But they do not support what is always so either, and a share counts them as failures."""
    assert possible("always", Counted(36, 38, refused=2), 0.9) == ("reproduced",)
    assert possible("always", Counted(35, 71, refused=36), 0.9) == ("reproduced", "contradicted")
    assert possible("always", Counted(36, 38, refused=1), 0.9) == ("contradicted",)
    assert possible("is", Counted(36, 72, refused=36), 0.9) == ("depends on unstated choices",)
