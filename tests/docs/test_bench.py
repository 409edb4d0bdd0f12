"""Statements about the bench are about all rows of a condition."""

from __future__ import annotations

from pathlib import Path

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
    assert bench.false_alarms("nominal") == {"share": 50.0, "reported": 50.0}


def test_statement_must_hold_for_all_rows_but_those_that_it_names(bench: Bench) -> None:
    def small(cell: object) -> bool:
        return float(cell["error"]) < 1.0  # type: ignore[index]

    bench.check_all(small, "noise")
    bench.check_all(small, "nominal", but=["Share, the paper's settings"])
    with pytest.raises(AssertionError, match="Share, the paper's settings"):
        bench.check_all(small)
    with pytest.raises(AssertionError, match="Given"):
        bench.check_all(small, "noise", but=["Given"])
