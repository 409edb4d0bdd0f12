"""Alternatives with known answers: what each changes of verdicts and of the title."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from reobserve.core.errors import InputError
from reobserve_papers.claims.conventions import SingleAlternative
from reobserve_papers.claims.decider import Decider
from reobserve_papers.claims.inquiry import Robustness
from reobserve_papers.claims.plot_alternatives import alternatives_curve
from reobserve_papers.claims.registry import Registry
from reobserve_papers.claims.restrictions import kept_by, narrower
from reobserve_papers.claims.title import (
    CLAIMS,
    LACKS,
    NOT_COMPUTED,
    TITLE,
    Row,
    Title,
    read_alternatives,
    title_from,
    write_alternatives,
)
from reobserve_papers.claims.verdict_rules import (
    CONTRADICTED,
    DEPENDS,
    REPRODUCED,
    UNDECIDED,
    Counted,
    possible,
)
from reobserve_papers.metrics.metrics import lookup
from reobserve_papers.steps.evaluation import Evaluator

from .stub import GAIN, ILO, SHARE, VARIANT, VARIANTS, Code, assess, registry

PLAIN = "fig1 sampled relative_rms_error"


def above(bound: Any, **entry: Any) -> dict[str, Any]:
    """An entry of a claim that the gain is above a bound: it is between 500 and 5000."""
    return {"checks": [{"value": PLAIN, "above": bound}], **entry}


def below(bound: float, **entry: Any) -> dict[str, Any]:
    """The same of the place of a word among `VARIANTS`."""
    return {"checks": [{"value": "fig1 sampled rms_error", "below": bound}], **entry}


SURE, HALF, NEVER, NEAR = above(400), above(1600), above(6000), above(630)


@pytest.fixture(autouse=True)
def code(code: Code) -> Code:
    """The replaced computation, which knows the gain without its lag, too: a quarter."""
    code.also = {
        "relative_rms_error lag=counted": 1.0,
        "relative_rms_error lag=removed": 0.25,
    }
    return code


def sampled(found: Registry, samples: int = 400) -> dict[str, Robustness]:
    share = found.conventions.values["share"]
    return assess(Evaluator(ILO), found.claims, lambda _: samples, share)


def decider(
    code: Code, found: Registry, samples: Mapping[str, Robustness] | None = None
) -> Decider:
    numbers = {figure: lookup(code(Evaluator(ILO), figure)) for figure in ("fig1", "fig2")}
    return Decider(found, numbers, sampled(found) if samples is None else samples, seed=1)


def decide(judged: Decider) -> tuple[list[Row], Title]:
    """What alternatives change, and the title."""
    rows = list(judged.rows())
    return [row for row in rows if row["kind"] in ("convention", "claim", "samples")], title_from(
        rows
    )


def by_name(changes: list[Row]) -> dict[str, Row]:
    return {row["alternative"]: row for row in changes}


# Titles.


def test_title_that_nothing_changes_has_no_dissent(code: Code, tmp_path: Path) -> None:
    good = decide(decider(code, registry(tmp_path, {"one": SURE, "two": above(450)})))[1]
    assert (good.word, good.dissent, good.undecided) == ("[Re]", (), ())
    assert good.in_words == "[Re], 2 of 2 main claims reproduced, 0 contradicted"
    bad = decide(decider(code, registry(tmp_path, {"one": SURE, "never": NEVER})))[1]
    assert bad.in_words == "[¬Re], 1 of 2 main claims reproduced, 1 contradicted"


def test_title_of_half_is_open(code: Code, tmp_path: Path) -> None:
    changes, title = decide(decider(code, registry(tmp_path, {"one": SURE, "half": HALF})))
    assert title.mains == {"one": REPRODUCED, "half": DEPENDS}
    assert (title.word, title.dissent) == ("[Re?]", ())
    assert all(row["other_title"] == "[Re?]" for row in changes)


def test_title_stays_as_stated_beside_dissent_in_words(code: Code, tmp_path: Path) -> None:
    less = {"value": 400, "alternatives": {"much": 6000, "hardly": 450},
            "reasons": {"much": "It must be much."}}  # fmt: skip
    found = registry(tmp_path, {"one": above("$less"), "two": SURE}, {"less": less})
    changes, title = decide(decider(code, found))
    assert title.word == "[Re]"
    assert title.dissent == (
        "[¬Re]: It must be much. `one` is then contradicted (0 of 36, 36 of 36 as stated). "
        "The reading taken was chosen after its numbers were known.",
    )
    much = by_name(changes)["less: much"]
    assert (much["claim"], much["verdict"], much["other"]) == ("one", REPRODUCED, CONTRADICTED)
    assert (much["title"], much["other_title"], much["note"]) == ("[Re]", "[¬Re]", "")
    assert much["change"] == "less from 400 to 6000"
    assert by_name(changes)["less: hardly"]["claim"] == ""
    assert (title.tried, title.lacking) == (len(by_name(changes)), 4)


@pytest.mark.parametrize(
    ("claim", "changes", "said"),
    [
        (SURE, {"checks.0.above": 6000}, "The reading taken is the paper's own."),
        (
            HALF,
            {"quantifier": "always"},
            "The reading taken was chosen after its numbers were known.",
        ),
    ],
)
def test_dissent_says_when_the_reading_was_chosen(
    code: Code, tmp_path: Path, claim: dict[str, Any], changes: dict[str, Any], said: str
) -> None:
    claim = {**claim, "threshold": "stated"}
    alternatives = {"other": {"claims": {"one": changes}}}
    (dissent,) = decide(decider(code, registry(tmp_path, {"one": claim}, {}, alternatives)))[
        1
    ].dissent
    assert dissent.endswith(said)


def test_reading_that_touches_no_main_claim_stays_with_its_claim(
    code: Code, tmp_path: Path
) -> None:
    claims = {"one": SURE, "minor": {**SURE, "promised": []}}
    alternatives = {
        "of minor": {"claims": {"minor": {"checks.0.above": 6000}}},
        "of one": {"claims": {"one": {"checks.0.above": 401}}},
        "promise": {"claims": {"minor": {"promised": ["abstract"]}}},
    }
    share = {"value": 0.9, "alternatives": {"four_fifths": 0.8}}
    found = registry(tmp_path, claims, {"share": share}, alternatives)
    changes, title = decide(decider(code, found))
    touches = {name: row["touches"] for name, row in by_name(changes).items()}
    assert touches.pop("of minor") == CLAIMS
    assert set(touches.values()) == {TITLE}
    assert title.tried == len(touches)
    assert by_name(changes)["of minor"]["other"] == CONTRADICTED
    assert by_name(changes)["promise"]["mains"] == "one minor"


def test_open_interval_that_could_change_the_title_is_said_apart(
    code: Code, tmp_path: Path
) -> None:
    found = registry(tmp_path, {"one": SURE, "two": SURE, "rare": above(4550)})
    samples = sampled(found, 60)
    (rare,) = (one for one in found.claims if one.name == "rare")
    counted = samples["rare"].counted(samples["rare"].outcomes(rare))
    assert possible("is", counted, 0.9) == (DEPENDS, CONTRADICTED)
    judged = decider(code, found, samples)
    assert judged.judged["rare"].verdict == UNDECIDED
    _, title = decide(judged)
    held = f"it holds in {counted.held} of 60"
    reason = f"[¬Re] if `rare` is contradicted, which its samples allow: {held}"
    assert (title.word, title.undecided) == ("[Re]", (reason,))


def test_open_interval_that_changes_no_title_leaves_it(code: Code, tmp_path: Path) -> None:
    """Two of three are reproduced, whether the third is or depends on choices."""
    found = registry(tmp_path, {"one": SURE, "two": SURE, "near": NEAR})
    judged = decider(code, found, sampled(found, 60))
    assert judged.judged["near"].verdict == UNDECIDED
    assert decide(judged)[1].undecided == ()


# Verdicts.


def test_verdict_that_only_lacks_samples_changes_nothing_and_is_marked(
    code: Code, tmp_path: Path
) -> None:
    """At nineteen in twenty 36 of 36 samples do not decide."""
    share = {"value": 0.9, "alternatives": {"nineteen_of_twenty": 0.95, "four_fifths": 0.8}}
    found = registry(tmp_path, {"one": SURE, "two": SURE}, {"share": share})
    changes, title = decide(decider(code, found))
    rows = [one for one in changes if one["alternative"] == "share: nineteen_of_twenty"]
    assert [(one["claim"], one["verdict"], one["other"], one["note"]) for one in rows] == [
        (name, REPRODUCED, REPRODUCED, LACKS) for name in ("one", "two")
    ]
    assert {one["other_title"] for one in rows} == {"[Re]"}
    assert by_name(changes)["share: four_fifths"]["claim"] == ""
    assert (title.word, title.dissent) == ("[Re]", ())


def test_measure_is_evaluated_from_the_same_samples(code: Code, tmp_path: Path) -> None:
    """The gain is above 400 with its lag counted; a quarter of it is in half of the samples."""
    lag = {"value": "counted", "alternatives": {"removed": "removed"}}
    checks = [{"value": f"{PLAIN} lag=$lag", "above": 400}]
    found = registry(tmp_path, {"one": {"checks": checks}}, {"lag": lag})
    samples = sampled(found)
    code.asked.clear()
    changes, title = decide(decider(code, found, samples))
    assert len(code.asked) == 2  # the numbers of two figures
    removed = by_name(changes)["lag: removed"]
    quarters = [float(trial.values[0]) / 4 for trial in samples["one"].trials]
    counted = Counted(sum(gain > 400 for gain in quarters), len(quarters))
    assert possible("is", counted, 0.9) == (DEPENDS,)
    assert (removed["verdict"], removed["other"]) == (REPRODUCED, DEPENDS)
    assert [said[:5] for said in title.dissent] == ["[Re?]"]


def test_measure_that_samples_do_not_have_is_not_computed(code: Code, tmp_path: Path) -> None:
    changes = {"checks.0.value": f"{PLAIN} lag=removed"}
    found = registry(tmp_path, {"one": SURE}, {}, {"mine": {"claims": {"one": changes}}})
    (one,) = found.claims
    short = replace(one, wanted=tuple(one.checks[0].references))
    samples = assess(Evaluator(ILO), [short], lambda _: 40, 0.9)
    made, title = decide(decider(code, found, samples))
    mine = by_name(made)["mine"]
    assert (mine["verdict"], mine["other"], mine["note"]) == (REPRODUCED, REPRODUCED, NOT_COMPUTED)
    assert (title.word, title.dissent) == ("[Re]", ())


def test_quantifier_and_promise_can_be_read_otherwise(code: Code, tmp_path: Path) -> None:
    claims = {"one": SURE, "two": SURE, "rare": {**HALF, "quantifier": "is"}}
    alternatives = {
        "always": {"claims": {"rare": {"quantifier": "always"}}},
        "no promise": {"claims": {"one": {"promised": []}}},
        "nothing else": {"claims": {"one": {"why": "Another."}}},
    }
    made, title = decide(decider(code, registry(tmp_path, claims, {}, alternatives)))
    found = by_name(made)
    assert (found["always"]["claim"], found["always"]["other"]) == ("rare", CONTRADICTED)
    assert (found["no promise"]["other"], found["no promise"]["note"]) == (
        REPRODUCED,
        "no main claim",
    )
    assert found["no promise"]["other_title"] == "[Re?]"  # one of two
    assert found["nothing else"]["claim"] == ""
    assert [said[:5] for said in title.dissent] == ["[¬Re]", "[Re?]"]
    assert "`one` is then no main claim." in title.dissent[1]


def test_alternative_that_leaves_no_main_claim_says_nothing_of_the_title(
    code: Code, tmp_path: Path
) -> None:
    main = {"value": "abstract and conclusions", "alternatives": {"end": "conclusions"}}
    made, title = decide(decider(code, registry(tmp_path, {"one": SURE}, {"main": main})))
    assert by_name(made)["main: end"]["other_title"] == "[Re]"
    assert (title.word, title.dissent) == ("[Re]", ())


def test_conventions_say_which_claims_are_main(code: Code, tmp_path: Path) -> None:
    claims = {
        "one": SURE,
        "aim": {**NEVER, "promised": [], "purpose": ["abstract"]},
        "end": {**SURE, "promised": ["conclusions"]},
        "half": {**HALF, "promised": ["conclusions"]},
    }
    conventions = {
        "purpose": {"value": "ignored", "alternatives": {"counted": "counts"}},
        "main": {
            "value": "abstract and conclusions",
            "alternatives": {"a": "abstract", "c": "conclusions", "all": "all claims"},
        },
        "majority": {"value": 0.5, "alternatives": {"two_thirds": 0.6667}},
    }
    made, title = decide(decider(code, registry(tmp_path, claims, conventions)))
    found = {name: one["other_title"] for name, one in by_name(made).items()}
    assert found["purpose: counted"] == "[¬Re]"
    assert (found["main: a"], found["main: c"], found["main: all"]) == ("[Re]", "[Re?]", "[¬Re]")
    assert found["majority: two_thirds"] == "[Re?]"
    words = [found[name] for name in found if found[name] != "[Re]"]
    assert [said.partition(":")[0] for said in title.dissent] == words
    assert (
        "Then 1 of 2 main claims reproduced, 0 contradicted; as stated 2 of 3 main claims"
        in title.dissent[1]
    )


def test_alternatives_of_other_papers_are_not_tried(code: Code, tmp_path: Path) -> None:
    other = {"theirs": {"paper": "imm", "claims": {"no_claim_here": {"quantifier": "always"}}}}
    made, _ = decide(decider(code, registry(tmp_path, {"one": SURE}, {}, other)))
    assert "theirs" not in by_name(made)


# Samples.


def test_range_keeps_the_samples_inside(code: Code, tmp_path: Path) -> None:
    alternatives = {
        "large": {"ranges": {GAIN: [700, 5000]}},
        "small": {"ranges": {"observers.*.K2": [500, 620]}},
        "of one": {"ranges": {GAIN: [500, 620]}, "only": ["two"]},
    }
    found = registry(tmp_path, {"one": NEAR, "two": NEAR}, {}, alternatives)
    samples = sampled(found)
    made, _ = decide(decider(code, found, samples))
    gains = [trial.values[0] for trial in samples["one"].trials]
    assert len(gains) == 400
    for name, (low, high), verdict in (
        ("large", (700, 5000), REPRODUCED), ("small", (500, 620), CONTRADICTED),
    ):  # fmt: skip
        inside = [gain for gain in gains if low <= gain <= high]
        counted = Counted(sum(gain > 630 for gain in inside), len(inside))
        assert possible("is", counted, 0.9) == (verdict,)
        rows = [one for one in made if one["alternative"] == name]
        assert [(one["claim"], one["other"]) for one in rows] == [
            ("one", verdict),
            ("two", verdict),
        ]
    assert [one["claim"] for one in made if one["alternative"] == "of one"] == ["two"]
    assert by_name(made)["large"]["change"] == f"{GAIN} 700 to 5000"


def test_range_without_samples_decides_nothing(code: Code, tmp_path: Path) -> None:
    alternatives = {"empty": {"ranges": {GAIN: [4999.9999, 5000]}}}
    made, _ = decide(decider(code, registry(tmp_path, {"one": SURE}, {}, alternatives)))
    empty = by_name(made)["empty"]
    assert (empty["other"], empty["note"]) == (REPRODUCED, LACKS)


def test_weights_keep_a_part_that_is_the_same_in_every_process(tmp_path: Path) -> None:
    """`FIRST` are the numbers of the first samples that are kept, at a seed of one."""
    found = registry(tmp_path, {"one": {**SURE, "depends_on": [GAIN, VARIANT]}})
    weights = {VARIANT: {"sampled": 0.5, "forgetting": 0.0}}
    single = SingleAlternative(paper="ilo", why="So.", weights=weights)
    keep = kept_by(found, single, seed=1)["one"]

    def kept(word: str, count: int = 2000) -> list[int]:
        return [k for k in range(count) if keep({VARIANT: word, GAIN: 700.0}, k)]

    assert kept("sampled", 30) == FIRST
    assert kept("continuous") == list(range(2000))
    assert kept("forgetting") == []
    assert abs(len(kept("sampled")) - 1000) < 4 * math.sqrt(500)
    other = kept_by(found, single, seed=2)["one"]
    assert [k for k in range(30) if other({VARIANT: "sampled", GAIN: 700.0}, k)] != FIRST


FIRST = [0, 6, 7, 9, 11, 17, 20, 24, 27]


def test_weights_change_a_verdict(code: Code, tmp_path: Path) -> None:
    """Two of three words satisfy the claim; without them only the third is left."""
    claims = {"one": {**below(1.5), "depends_on": [GAIN, VARIANT]}}
    weights = {"ranges": {VARIANT: ["sampled", "continuous"]}}
    seldom = {"weights": {VARIANT: {"forgetting": 0.0}}}
    found = registry(tmp_path, claims, {}, {"two words": weights, "no third": seldom})
    samples = sampled(found, 400)
    made = by_name(decide(decider(code, found, more_of(found, samples)))[0])
    assert [made[name]["other"] for name in ("two words", "no third")] == [REPRODUCED, REPRODUCED]


def more_of(found: Registry, samples: Mapping[str, Robustness]) -> dict[str, Robustness]:
    """The samples, twenty times."""
    return {
        one.name: replace(samples[one.name], trials=samples[one.name].trials * 20)
        for one in found.claims
    }


def test_halves_and_words_are_made_for_each_choice_of_each_main_claim(
    code: Code, tmp_path: Path
) -> None:
    claims = {
        "one": {**SURE, "depends_on": [GAIN, VARIANT, "seed"]},
        "two": {**SURE, "depends_on": [SHARE]},
        "minor": {**SURE, "promised": []},
    }
    found = decider(code, registry(tmp_path, claims))
    assert [one.name for one in found.alternatives()] == [
        f"one: {GAIN}, lower half",
        f"one: {GAIN}, upper half",
        *(f"one: {VARIANT} not {word}" for word in VARIANTS),
        f"two: {SHARE}, lower half",
        f"two: {SHARE}, upper half",
    ]


def test_halves_part_a_range_in_the_middle_of_its_magnitudes(tmp_path: Path) -> None:
    (one,) = registry(tmp_path, {"one": SURE}).claims
    (_, _, lower), (_, _, upper) = narrower(one)
    middle = 500 * math.sqrt(10)
    for gain in (500.0, middle - 1, middle + 1, 5000.0):
        assert lower({GAIN: gain}, 0) is (gain < middle)
        assert upper({GAIN: gain}, 0) is (gain > middle)


def test_word_left_out_of_a_count_leaves_a_count(code: Code, tmp_path: Path) -> None:
    """Two of three words satisfy the claim: two of two without the third."""
    found = registry(tmp_path, {"one": {**below(1.5), "depends_on": [VARIANT]}})
    judged = decider(code, found)
    assert judged.judged["one"].verdicts == (DEPENDS,)
    made = by_name(decide(judged)[0])
    others = {word: made[f"one: {VARIANT} not {word}"]["other"] for word in VARIANTS}
    assert others == {"sampled": "", "continuous": "", "forgetting": REPRODUCED}


# The file and the plot.


def test_table_of_alternatives_is_read_as_it_was_written(code: Code, tmp_path: Path) -> None:
    less = {"value": 400, "alternatives": {"much": 6000, "hardly": 450}}
    found = registry(tmp_path, {"one": above("$less"), "two": SURE}, {"less": less})
    judged = decider(code, found)
    changes, title = decide(judged)
    path = tmp_path / "alternatives.csv"
    write_alternatives(path, judged.rows())
    again, rows = read_alternatives(path)
    assert again == title
    assert [row["alternative"] for row in rows] == [one["alternative"] for one in changes]
    assert rows[0]["other"] == CONTRADICTED
    path.write_text(path.read_text().replace(CONTRADICTED, "refuted"))
    with pytest.raises(InputError, match=r"alternatives\.csv"):
        read_alternatives(path)


def test_curve_shows_each_alternative_and_names_what_changes_the_title(
    code: Code, tmp_path: Path
) -> None:
    less = {"value": 400, "alternatives": {"much": 6000, "hardly": 450}}
    found = registry(tmp_path, {"one": above("$less"), "two": SURE}, {"less": less})
    judged = decider(code, found)
    changes, _ = decide(judged)
    write_alternatives(tmp_path / "alternatives.csv", judged.rows())
    verdicts = {name: one.verdict for name, one in judged.judged.items()}
    figure = alternatives_curve(*read_alternatives(tmp_path / "alternatives.csv"), verdicts)
    above_axes, below_axes = figure.axes
    tried = len({one["alternative"] for one in changes})
    assert above_axes.get_title(loc="left").startswith(f"[Re] with {tried} alternatives")
    titles, marks = Counter(), Counter()
    for axes, found_marks in ((above_axes, titles), (below_axes, marks)):
        for line in axes.lines:
            found_marks[line.get_marker()] += len(line.get_xdata())
    assert titles == {"o": tried, "X": 1}
    assert marks == {"s": 2 * (tried + 1) - 1, "X": 1}
    (text,) = (one.get_text() for one in figure.texts)
    assert text == "The title is another with: less: much."
