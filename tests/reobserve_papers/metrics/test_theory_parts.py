"""Parts of a theory: only the requested ones are computed, and all if none is requested."""

from __future__ import annotations

from collections.abc import Iterator

from reobserve_papers.metrics.metrics import Metric
from reobserve_papers.metrics.theory_parts import only, part

CALLS: list[str] = []


@part
def errors(size: float) -> Iterator[Metric]:
    CALLS.append("errors")
    yield Metric("a", "error", size, "1")
    yield Metric("b", "error", 2 * size, "1")


@part
def delays() -> Iterator[Metric]:
    CALLS.append("delays")
    yield Metric("a", "delay", 3.0, "s")


def theory(size: float) -> list[float]:
    CALLS.clear()
    return [metric.value for metric in (*errors(size), *delays())]


def test_only_requested_parts_are_computed() -> None:
    with only(["delay"]):
        assert theory(1.0) == [1.0, 2.0, 3.0]  # not yet known which part gives which number
    assert theory(1.0) == [1.0, 2.0, 3.0]
    with only(["delay"]):
        assert theory(4.0) == [3.0]
        assert CALLS == ["delays"]
        with only(None):
            assert theory(4.0) == [4.0, 8.0, 3.0]
        with only(["error", "other"]):
            assert theory(4.0) == [4.0, 8.0]
        assert theory(4.0) == [3.0]
    assert theory(4.0) == [4.0, 8.0, 3.0]
    assert CALLS == ["errors", "delays"]
