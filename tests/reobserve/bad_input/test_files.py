"""Files read by commands, with a few changes."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from reobserve.core.documents import parse_yaml
from reobserve.estimation.families import FAMILIES, family

from . import valid
from .odd import as_yaml
from .outcome import command
from .readers import ONCE_OTHER_ERRORS, Reader, check_changed_files, check_token, made


def words(*line: object) -> Callable[[], object]:
    return lambda: command(*line)


def user_design(kind: str) -> Reader:
    line = words("export", "in.json", "--to", "c", "--out", "code")
    return Reader("in.json", line, json.loads(valid.saved_design(kind)))


def user_model(kind: str) -> Reader:
    line = words("design", kind, "in.yaml", "--out", "out.json")
    return Reader("in.yaml", line, parse_yaml(family(kind).example, "in.yaml"))


def specification(name: str) -> Reader:
    line = words("estimate", "in.yaml", "r.csv", "--out", "e.csv", "--report", "e.json")
    return Reader("in.yaml", line, valid.specification(name), others=record(name))


def estimated_record(name: str) -> Reader:
    line = words("estimate", "s.yaml", "in.csv", "--out", "e.csv", "--report", "e.json")
    others = {"s.yaml": as_yaml(valid.specification(name))}
    return Reader("in.csv", line, content=valid.csv_record(name), others=others)


def streamed_record(name: str) -> Reader:
    def read() -> None:
        command("estimate", "s.yaml", "--stream", stdin=Path("in.csv").read_bytes())

    others = {"s.yaml": as_yaml(valid.specification(name))}
    return Reader("in.csv", read, content=valid.csv_record(name), others=others)


def smoothed(name: str) -> Reader:
    line = words("estimate", "in.yaml", "r.csv", "--out", "e.csv", "--plot", "e.png")
    return Reader(
        "in.yaml", line, {**valid.specification(name), "smooth": True}, others=record(name)
    )


def record(name: str) -> dict[str, bytes]:
    return {"r.csv": valid.csv_record(name)}


EXAMPLES = (
    "kalman", "levant", "eso", "adaptive-pi", "luenberger-gain", "svsf", "extended-kalman",
    "unscented-kalman",
)  # fmt: skip
QUICK = [kind for kind in FAMILIES if kind != "eso"]  # other choices take a solver seconds
READERS: dict[Callable[..., Reader], list[Any]] = {
    user_design: QUICK,
    user_model: QUICK,
    specification: [*EXAMPLES],
    smoothed: ["kalman", "augmented-kalman", "unscented-kalman"],
    estimated_record: [*EXAMPLES],
    streamed_record: [*EXAMPLES],
}


@pytest.mark.nightly_cases("smoothed", "specification")
@pytest.mark.parametrize("reader", READERS)
def test_changed_files_are_accepted_or_refused(reader: Callable[..., Reader]) -> None:
    check_changed_files(made(reader, READERS[reader]))


@pytest.mark.nightly_cases("token52", "token53")
@pytest.mark.parametrize("token", ONCE_OTHER_ERRORS)
def test_yaml_that_once_raised_other_errors_is_refused(token: bytes) -> None:
    check_token(token, [specification("kalman"), user_model("kalman")])
