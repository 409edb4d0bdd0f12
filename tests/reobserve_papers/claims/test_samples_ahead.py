"""Samples computed ahead in chunks: the gathered result has the same bytes for any chunks."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from random import Random

import pytest

from reobserve.core.errors import DivergenceError, InputError
from reobserve_papers.claims import outcomes
from reobserve_papers.claims.cached_samples import CachedSamples
from reobserve_papers.claims.checks import Check
from reobserve_papers.claims.choices import find_choice
from reobserve_papers.claims.known_samples import MadeSamples, read_chunks, write_chunk
from reobserve_papers.claims.registry import Claim
from reobserve_papers.claims.robustness import Inquiry, Robustness, assess
from reobserve_papers.claims.robustness_file import to_data
from reobserve_papers.claims.samples_ahead import make_ahead
from reobserve_papers.cli.stages.sample import numbers_of
from reobserve_papers.metrics.metrics import Metric
from reobserve_papers.parameters.parameters import Parameters
from reobserve_papers.steps.evaluation import Evaluator
from tests import ROOT

ILO = Parameters.load(ROOT, "ilo", seed=1)
GAIN, SHARE = "observers.continuous.K2", "observers.forgetting.K1"
DRAWS = 90


class Code:
    """A replacement for the computation: a gain times a factor, some refused or lost; records all
    calls.
    """

    def __init__(self) -> None:
        self.factor = 1.0
        self.asked: list[float] = []

    def __call__(self, evaluator: Evaluator, figure: str, asked: object = None) -> list[Metric]:
        """The numbers of any figure."""
        observers = evaluator.parameters.section("observers")
        gain = observers["continuous"]["K2"]
        self.asked.append(gain)
        if 600 < gain < 700:
            raise InputError("K2", "must not be between 600 and 700")
        if 900 < gain < 1000:
            raise DivergenceError("it", 1.0)
        share = observers["forgetting"]["K1"] / 3
        return [Metric("a", "gain", self.factor * gain, "1"), Metric("a", "share", share, "1")]


@pytest.fixture
def code(monkeypatch: pytest.MonkeyPatch) -> Code:
    """The replaced computation, which a test may change and count."""
    instead = Code()
    monkeypatch.setattr(outcomes, "metrics_of", instead)
    return instead


def claim(name: str, value: str, above: float, *keys: str) -> Claim:
    checks = (Check.parse({"value": f"fig1 a {value}", "above": above}),)
    return Claim("ilo", name, checks=checks, choices=tuple(find_choice(ILO, key) for key in keys))


CLAIMS = [
    claim("near the line", "gain", 620, GAIN),
    claim("soon decided", "gain", 1900, SHARE, GAIN),
    claim("later decided", "share", 0.22, SHARE),
]


def gathered(
    chunks: Sequence[Path] = (),
    cached: dict[str, CachedSamples] | None = None,
    samples: int = DRAWS,
) -> str:
    """The output of the robustness stage."""
    found = assess(Evaluator(ILO), CLAIMS, samples, cached=cached, made=read_chunks(chunks, "ilo"))
    return json.dumps({name: to_data(one) for name, one in found.items()})


def chunks_of(samples: int, chunks: int) -> list[str]:
    """The names of the chunks, as in the rules."""
    size = -(-samples // chunks)
    return [f"{start}-{start + size - 1}" for start in range(0, samples, size)]


def make(folder: Path, chunk: str, cached: dict[str, CachedSamples] | None = None) -> Path:
    """The file of a chunk."""
    inquiry = Inquiry.begin(Evaluator(ILO), CLAIMS, cached)
    bases = {name: one.basis for name, one in inquiry.found.items()}
    path = folder / f"{chunk}.json"
    write_chunk(path, "ilo", bases, make_ahead(inquiry, numbers_of(chunk)))
    return path


def make_all(
    folder: Path, chunks: int, cached: dict[str, CachedSamples] | None = None
) -> list[Path]:
    return [make(folder, chunk, cached) for chunk in chunks_of(DRAWS, chunks)]


@pytest.mark.parametrize("chunks", [1, 2, 5, 18])
def test_chunks_in_any_order_give_the_bytes_of_a_single_run(
    code: Code, tmp_path: Path, chunks: int
) -> None:
    whole = gathered()
    paths = make_all(tmp_path, chunks)
    for _ in range(2):
        Random(chunks).shuffle(paths)
        assert gathered(paths) == whole
    assert gathered(paths[: len(paths) // 2]) == whole  # missing samples are computed


def test_gathering_chunks_computes_no_samples_again(code: Code, tmp_path: Path) -> None:
    made = read_chunks(make_all(tmp_path, 5), "ilo")
    code.asked.clear()
    assert any(one.refused for one in assess_made(made).values())
    assert len(code.asked) == 1  # nominal


def assess_made(made: MadeSamples) -> dict[str, Robustness]:
    return assess(Evaluator(ILO), CLAIMS, DRAWS, reversals=False, made=made)


def test_chunk_stops_sampling_a_decided_claim(code: Code, tmp_path: Path) -> None:
    """Only the first one knows that; later ones, which do not wait for it, compute all their
    samples.
    """
    ends = {name: one.samples for name, one in assess(Evaluator(ILO), CLAIMS, DRAWS).items()}
    assert ends["soon decided"] < 45 < ends["later decided"] < DRAWS == ends["near the line"]
    first, second = (json.loads(path.read_text())["claims"] for path in make_all(tmp_path, 2))
    for name, end in ends.items():
        assert first[name]["numbers"] == list(range(min(end, 45)))
        assert second[name]["numbers"] == list(range(45, DRAWS))


def test_chunk_skips_claims_decided_by_cached_samples(code: Code, tmp_path: Path) -> None:
    cached = {name: one.to_keep for name, one in assess(Evaluator(ILO), CLAIMS, DRAWS).items()}
    chunk = json.loads(make(tmp_path, "50-59", cached).read_text())["claims"]
    assert chunk["soon decided"]["numbers"] == []


@pytest.mark.parametrize("name", ["", "7", "9-2", "1-2-3", "-1-5", "0-1e3"])
def test_chunk_is_named_by_two_increasing_numbers(name: str) -> None:
    with pytest.raises(InputError, match=r"^chunk: .* must be two rising numbers, as 50-99$"):
        numbers_of(name)


def test_recomputed_chunk_is_identical(code: Code, tmp_path: Path) -> None:
    paths = make_all(tmp_path, 5)
    before = [path.read_bytes() for path in paths]
    for chunk in reversed(chunks_of(DRAWS, 5)):
        make(tmp_path, chunk)
    assert [path.read_bytes() for path in paths] == before


def test_chunks_can_be_extended_with_more_samples(code: Code, tmp_path: Path) -> None:
    paths = make_all(tmp_path, 5)
    assert gathered(paths, samples=2 * DRAWS) == gathered(samples=2 * DRAWS)


@pytest.mark.parametrize("factor", [1.0, 1.001])
def test_chunks_omit_cached_samples_unless_the_code_changed(
    code: Code, tmp_path: Path, factor: float
) -> None:
    cached = {name: one.to_keep for name, one in assess(Evaluator(ILO), CLAIMS, 40).items()}
    code.factor = factor
    paths = make_all(tmp_path, 5, cached)
    assert gathered(paths, cached) == gathered(cached=cached)
    drawn = json.loads(paths[1].read_text())["claims"]["near the line"]["numbers"]
    assert bool(drawn) == (factor != 1)


def test_chunks_of_other_parameters_or_claims_are_refused(code: Code, tmp_path: Path) -> None:
    paths = make_all(tmp_path, 2)
    other = replace(CLAIMS[0], checks=(Check.parse({"value": "fig1 a gain", "above": 621}),))
    alone = assess(Evaluator(ILO), [other], 20)
    code.factor = 2.0  # so that earlier samples would show
    fresh = assess(Evaluator(ILO), [other], 20, made=read_chunks(paths, "ilo"))
    assert fresh == assess(Evaluator(ILO), [other], 20) != alone


@pytest.mark.parametrize(
    ("path", "value", "said"),
    [
        (("paper",), "lie", "is of lie, must be of ilo"),
        (("claims", "soon decided", "numbers", 0), 7, "must be numbers of samples, rising"),
        (("claims", "soon decided", "numbers"), [1], "must be 1"),
        (("claims", "soon decided", "samples", 0), "1 a", "must be numbers"),
        (("claims", "soon decided", "basis"), None, "basis"),
    ],
)
def test_damaged_chunk_is_reported(
    code: Code, tmp_path: Path, path: tuple[str | int, ...], value: object, said: str
) -> None:
    chunk = make(tmp_path, "0-5")
    stored = json.loads(chunk.read_text())
    del stored["sha256"]
    place = stored
    for step in path[:-1]:
        place = place[step]
    place[path[-1]] = value
    chunk.write_text(json.dumps(stored))
    with pytest.raises(InputError, match=said) as caught:
        read_chunks([chunk], "ilo")
    assert str(chunk) in str(caught.value)
