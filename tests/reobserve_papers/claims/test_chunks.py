"""Samples computed ahead in chunks: the gathered result has the same bytes for any chunks."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from random import Random

import pytest

from reobserve.core.errors import InputError
from reobserve_papers.claims.checks import Check
from reobserve_papers.claims.inquiry import Inquiry, Robustness
from reobserve_papers.claims.registry import Claim
from reobserve_papers.claims.sample_table import Samples, SampleTable, read_samples, write_samples
from reobserve_papers.cli.stages.robustness import numbers_of
from reobserve_papers.steps.evaluation import Evaluator

from .stub import GAIN, ILO, SHARE, VARIANT, Code, assess, claim, with_checks

DRAWS = 90


@pytest.fixture(autouse=True)
def code(code: Code) -> Code:
    """The replaced computation, of which some samples are refused and others diverge."""
    code.refused, code.lost = (600, 700), (900, 1000)
    return code


CLAIMS = [
    claim("fig1 a gain", GAIN, name="near the line", above=620),
    claim("fig1 a gain", SHARE, GAIN, name="soon decided", above=1900),
    claim("fig1 a share", SHARE, name="later decided", above=0.22),
    claim("fig1 a variant", VARIANT, name="counted", below=1.5),
]


def assessed(
    claims: Sequence[Claim] = tuple(CLAIMS),
    samples: int = DRAWS,
    cached: SampleTable | None = None,
    chunks: Sequence[Path] = (),
) -> dict[str, Robustness]:
    made = [read_samples(path, "ilo") for path in chunks]
    return assess(Evaluator(ILO), claims, lambda _: samples, 0.9, cached, made)


def gathered(
    chunks: Sequence[Path] = (), cached: SampleTable | None = None, samples: int = DRAWS
) -> dict[str, Samples]:
    """The output of the robustness stage."""
    found = assessed(samples=samples, cached=cached, chunks=chunks)
    return {one.name: found[one.name].to_keep(one) for one in CLAIMS}


def cache_of(samples: int) -> SampleTable:
    """The samples of all claims, as cached."""
    return SampleTable(tuple(ILO.by_key), gathered(samples=samples))


def chunks_of(samples: int, chunks: int) -> list[str]:
    """The names of the chunks, as in the rules."""
    size = -(-samples // chunks)
    return [f"{start}-{start + size - 1}" for start in range(0, samples, size)]


def make(folder: Path, chunk: str, cached: SampleTable | None = None) -> Path:
    """The file of a chunk."""
    inquiry = Inquiry.begin(Evaluator(ILO), CLAIMS, 0.9, cached)
    path, numbers = folder / f"{chunk}.json", numbers_of(chunk)
    inquiry.fill(lambda _: numbers.stop, numbers)
    write_samples(path, ILO, inquiry.chunk(numbers))
    return path


def numbers_in(chunk: Path) -> dict[str, range]:
    """The samples of each claim in a chunk."""
    return {name: one.numbers for name, one in read_samples(chunk, "ilo").claims.items()}


def make_all(folder: Path, chunks: int, cached: SampleTable | None = None) -> list[Path]:
    return [make(folder, chunk, cached) for chunk in chunks_of(DRAWS, chunks)]


@pytest.mark.parametrize("cached", [0, 40])
@pytest.mark.parametrize(
    "chunks",
    [*(chunks_of(DRAWS, count) for count in (2, 6)), ["0-0", "1-50", "30-44", "70-200"]],
)
def test_chunks_in_any_order_give_the_bytes_of_a_single_run(
    tmp_path: Path, chunks: list[str], cached: int
) -> None:
    """Numbers have as many digits as are kept, wherever they were computed."""
    past = cache_of(cached) if cached else None
    whole = gathered(cached=past)
    paths = [make(tmp_path, chunk, past) for chunk in chunks]
    for _ in range(2):
        Random(len(chunks)).shuffle(paths)
        assert gathered(paths, past) == whole
    assert gathered(paths[: len(paths) // 2], past) == whole  # missing samples are computed


def test_gathering_chunks_computes_no_samples_again(code: Code, tmp_path: Path) -> None:
    chunks = make_all(tmp_path, 5)
    code.asked.clear()
    assert any(None in one.samples for one in gathered(chunks).values())
    assert len(code.asked) == 1  # nominal


def test_chunk_stops_sampling_a_decided_claim(tmp_path: Path) -> None:
    """Only the first one knows that; later ones, which do not wait for it, compute all their
    samples.
    """
    ends = {name: one.samples for name, one in assessed().items()}
    assert ends.pop("counted") == 3
    assert ends["soon decided"] < 45 < ends["later decided"] < DRAWS == ends["near the line"]
    first, second = map(numbers_in, make_all(tmp_path, 2))
    for name, end in ends.items():
        assert first[name] == range(min(end, 45))
        assert second[name] == range(45, DRAWS)
    assert (first["counted"], second["counted"]) == (range(3), range(0))
    assert not numbers_in(make(tmp_path, "50-59", cache_of(DRAWS)))["soon decided"]


@pytest.mark.parametrize("name", ["", "7", "9-2", "1-2-3", "-1-5", "0-1e3"])
def test_chunk_is_named_by_two_increasing_numbers(name: str) -> None:
    with pytest.raises(InputError, match=r"^chunk: .* must be two rising numbers, as 50-99$"):
        numbers_of(name)


@pytest.mark.parametrize("factor", [1.0, 1.001])
def test_chunks_omit_cached_samples_unless_the_code_changed(
    code: Code, tmp_path: Path, factor: float
) -> None:
    cached = cache_of(40)
    code.factor = factor
    paths = make_all(tmp_path, 5, cached)
    assert gathered(paths, cached) == gathered(cached=cached)
    assert bool(numbers_in(paths[1])["near the line"]) == (factor != 1)


def test_samples_of_other_choices_are_not_taken_from_chunks(code: Code, tmp_path: Path) -> None:
    paths = make_all(tmp_path, 2)
    other = claim("fig1 a gain", GAIN, SHARE, name="near the line", above=620)
    code.factor = 2.0  # so that earlier samples would show
    assert assessed([other], 20, chunks=paths) == assessed([other], 20)


def test_chunks_serve_another_bound(code: Code, tmp_path: Path) -> None:
    paths = make_all(tmp_path, 2)
    moved = with_checks(CLAIMS[0], Check.parse({"value": "fig1 a gain", "above": 621}))
    code.asked.clear()
    assert assessed([moved], chunks=paths)["near the line"].samples == DRAWS
    assert len(code.asked) == 1
