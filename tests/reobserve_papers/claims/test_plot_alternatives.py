"""The specification curve over alternatives: a table by hand, and any table."""

from __future__ import annotations

from typing import Any

from hypothesis import given
from hypothesis import strategies as st

from reobserve_papers.claims.plot_alternatives import alternatives_curve, columns_of
from reobserve_papers.claims.title import (
    CLAIMS,
    LACKS,
    NOT_COMPUTED,
    STATED,
    TITLE,
    Title,
    row_as_stated,
)  # fmt: skip
from reobserve_papers.claims.verdict_rules import CONTRADICTED, DEPENDS, NOT_RE, OPEN, REPRODUCED

VERDICTS = {"a": REPRODUCED, "b": DEPENDS, "c": REPRODUCED, "d": CONTRADICTED}
STATED_TITLE = Title(OPEN, {name: VERDICTS[name] for name in "ab"})


def row(name: str, mains: str = "a b", **cells: str) -> dict[str, str]:
    kept: dict[str, Any] = {**row_as_stated(OPEN), "alternative": name, "mains": mains, **cells}
    return kept


TABLE = [
    row("nothing"),
    row("only b", "b"),
    row("c and d too", "a b c d", other_title=NOT_RE),
    row("c", "a b c", claim="c", verdict=REPRODUCED, other=REPRODUCED, note="a main claim"),
    row("bound", claim="b", verdict=DEPENDS, other=REPRODUCED),
    row("no a", "b", claim="a", verdict=REPRODUCED, other=REPRODUCED, note="no main claim"),
    row("few", claim="a", verdict=REPRODUCED, other=REPRODUCED, note=LACKS),
    row("few of c", claim="c", verdict=REPRODUCED, other=REPRODUCED, note=LACKS),
    row("none", claim="b", verdict=DEPENDS, other=DEPENDS, note=NOT_COMPUTED),
    row("far", touches=CLAIMS, claim="d", verdict=CONTRADICTED, other=REPRODUCED),
]
# By alternative: reproduced of main claims, and the main claims that lack samples.
BY_HAND = {
    STATED: (1, 2, ""), "nothing": (1, 2, ""), "only b": (0, 1, ""), "c and d too": (2, 4, ""),
    "c": (2, 3, ""), "bound": (2, 2, ""), "no a": (0, 1, ""), "few": (1, 2, "a"),
    "few of c": (1, 2, ""), "none": (1, 2, "b"),
}  # fmt: skip


def test_share_is_that_of_the_main_claims_by_the_alternative() -> None:
    columns = columns_of(STATED_TITLE, TABLE, VERDICTS)
    assert {one.name for one in columns} == {*BY_HAND}
    for one in columns:
        reproduced, claims, lacking = BY_HAND[one.name]
        assert (one.share, {*one.lacking}) == (reproduced / claims, {*lacking})
    assert columns[0].name == STATED
    shares = [one.share for one in columns[1:]]
    assert shares == sorted(shares, reverse=True)


def test_marks_are_hollow_where_samples_lack_and_missing_where_no_main_claim_is() -> None:
    figure = alternatives_curve(STATED_TITLE, TABLE, VERDICTS)
    above, below = figure.axes
    marks = [  # row of a claim, and whether it is hollow
        (place, line.get_markerfacecolor() == "white")
        for line in below.lines
        for place in line.get_ydata()
    ]
    names = [text.get_text() for text in below.get_yticklabels()]
    assert sorted(names) == ["a", "b", "c", "d"]
    counts = {name: sum(place == k for place, _ in marks) for k, name in enumerate(names)}
    assert counts == {"a": 8, "b": 10, "c": 2, "d": 1}
    hollow = [names[int(place)] for place, empty in marks if empty]
    assert sorted(hollow) == ["a", "b"]
    empty = [line for line in above.lines if line.get_markerfacecolor() == "white"]
    assert sum(len(line.get_xdata()) for line in empty) == 2
    assert above.get_title(loc="left").startswith("[Re?] with 9 alternatives")
    (text,) = (one.get_text() for one in figure.texts)
    assert text == "The title is another with: c and d too."


@given(st.lists(st.tuples(st.sets(st.sampled_from("abcd"), min_size=1), st.booleans()), max_size=9))
def test_every_set_of_main_claims_has_its_own_share(drawn: list[tuple[set[str], bool]]) -> None:
    table = [
        row(str(k), " ".join(sorted(mains)), touches=TITLE if touches else CLAIMS)
        for k, (mains, touches) in enumerate(drawn)
    ]
    columns = {one.name: one for one in columns_of(STATED_TITLE, table, VERDICTS)}
    for k, (mains, touches) in enumerate(drawn):
        assert (str(k) in columns) == touches
        if touches:
            held = sum(VERDICTS[name] == REPRODUCED for name in mains)
            assert columns[str(k)].share == held / len(mains)
