"""Statements about the bench are about all rows of a condition."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace

import pytest

from docs.generate.bench import Bench
from tests.reobserve.tuning.toy import stated_results


@pytest.fixture
def bench(tmp_path: Path) -> Bench:
    found = Bench.__new__(Bench)
    found.results = stated_results(tmp_path)
    return found


def test_column_has_all_rows_of_the_heat_map(bench: Bench) -> None:
    assert list(bench.column("nominal")) == ["Share", "Share, the paper's settings", "Given"]
    assert list(bench.column("noise")) == ["Share", "Given", "Given, given R"]
    assert list(bench.column("noise", given=True)) == ["Given, given R"]
    assert bench.within("nominal") == {
        "yes": [], "no": ["Share", "Share, the paper's settings"], "undecided": ["Given"],
    }  # fmt: skip
    assert bench.best("noise") == "Given, given R"
    assert bench.shares("quantile", "noise", given=False) == {"Share": 50.0, "Given": 50.0}


def test_statement_must_hold_for_all_rows_but_those_that_it_names(bench: Bench) -> None:
    def small(cell: object) -> bool:
        return float(cell["error"]) < 1.0  # type: ignore[index]

    bench.check_all(small, "noise")
    bench.check_all(small, "nominal", but=["Share, the paper's settings"])
    with pytest.raises(AssertionError, match="Share, the paper's settings"):
        bench.check_all(small)
    with pytest.raises(AssertionError, match="Given"):
        bench.check_all(small, "noise", but=["Given"])


def test_row_is_compared_with_all_that_it_is_not_beside(bench: Bench) -> None:
    assert bench.near("nominal") == {"Given"}
    assert [one["error"] for one in bench.rest("nominal", "reported")] == [0.25, 2.5]
    assert bench.against("nominal", "reported") == "0.200 against 0.250 or more"
    with pytest.raises(AssertionError, match="share"):  # as good, but not said to be beside it
        bench.against("noise", "reported")


def test_rows_that_read_what_comes_later_are_not_compared_with(bench: Bench) -> None:
    for cell in bench.column("nominal").values():
        cell["within"] = "late"  # type: ignore[index]
    assert bench.near("nominal") == set()
    assert bench.rest("nominal") == []


def test_rows_without_a_variance_have_no_nees(bench: Bench) -> None:
    bench.column("nominal")["Given"]["nees"] = 1.5  # type: ignore[index]
    assert bench.nees() == {"Given": 1.5}


def test_cost_of_estimating_r_is_that_to_the_same_method_without(bench: Bench) -> None:
    assert bench.cost_of_r() == []
    errors = {"a": 2.0, "a_R": 3.0, "b": 1.0}
    bench.results = SimpleNamespace(  # type: ignore[assignment]
        task=SimpleNamespace(methods=errors), cell=lambda _, one, *rest: {"error": errors[one]}
    )
    assert bench.cost_of_r() == [50.0]
