"""Captions: rounded numbers, and errors of templates."""

from __future__ import annotations

from pathlib import Path

import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from reobserve.core.errors import InputError
from reobserve_papers.metrics.metrics import Metric
from reobserve_papers.plotting.captions import _percent, render

METRICS = [
    Metric("sampled", "rms_error", 0.0123456, "N m"),
    Metric.at("sampled", ("rms_error", 0.5, "N m"), noise=1e-5, gain=3.0),
]


def rendered(folder: Path, text: str, **settings: object) -> str:
    template = folder / "caption.rst"
    template.write_text(text)
    return render(template, settings, METRICS)


def test_numbers_are_rounded_as_requested(tmp_path: Path) -> None:
    text = (
        '{% set rms = value("sampled", "rms_error") %}{{ rms | digits }}, {{ rms | percent }}'
        ", {{ rms | milli(3) }}, {{ 200000.0 | digits(4) }}, {{ k.K1 }}"
    )
    assert rendered(tmp_path, text, k={"K1": 0.9}) == "0.012, 1.2 %, 12.3, 200000, 0.9\n"


@given(st.floats(0, 1e-6))
@example(1.15e-9)
@example(0.0)
def test_small_share_is_not_zero(share: float) -> None:
    assert (_percent(share) == "0 %") == (share == 0)


def test_study_number_is_selected_by_its_coordinates(tmp_path: Path) -> None:
    text = '{{ value("sampled", "rms_error", noise=levels[0], gain=3) | percent }}'
    assert rendered(tmp_path, text, levels=[1e-5]) == "50 %\n"


def test_each_paragraph_is_one_line(tmp_path: Path) -> None:
    assert rendered(tmp_path, "one\n  two\n\n\n\nthree\n") == "one two\n\nthree\n"


def test_templates_can_include_parts(tmp_path: Path) -> None:
    (tmp_path / "_part.rst").write_text("{% macro greet(name) %}hello {{ name }}{% endmacro %}")
    text = '{% from "_part.rst" import greet %}{{ greet("you") }}'
    assert rendered(tmp_path, text) == "hello you\n"


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ('{{ value("sampled", "rms") }}', "asks for a metric: there is no 'rms' of 'sampled'"),
        ("{{ plant.inertia }}", "cannot be filled: 'plant' is undefined"),
        ("{% if %}", "cannot be filled"),
    ],
)
def test_invalid_template_is_named(tmp_path: Path, text: str, said: str) -> None:
    with pytest.raises(InputError, match=rf"caption\.rst: .*{said}"):
        rendered(tmp_path, text)


def test_missing_template_is_named(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"no\.rst: cannot be read"):
        render(tmp_path / "no.rst", {}, METRICS)
