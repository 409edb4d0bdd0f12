"""The sub-commands of `reobserve-papers`: their help, their options and what they call."""

from __future__ import annotations

import argparse

import pytest

from reobserve_papers.cli.main import COMMANDS, PROGRAM, command_parser
from tests.reobserve.core.commands import (
    check_any_order,
    check_arguments,
    check_help,
    check_only_the_typed_is_built,
    check_unknown_command,
    commands,
)

ALL = list(commands(command_parser()))


@pytest.mark.parametrize("parser", ALL, ids=lambda parser: parser.prog)
def test_command_passes_the_arguments_of_its_function(parser: argparse.ArgumentParser) -> None:
    check_arguments(parser)


@pytest.mark.parametrize("parser", ALL, ids=lambda parser: parser.prog)
def test_options_may_stand_anywhere(parser: argparse.ArgumentParser) -> None:
    check_any_order(parser)


def test_help_fits_a_terminal(monkeypatch: pytest.MonkeyPatch) -> None:
    check_help(PROGRAM, COMMANDS, monkeypatch)


@pytest.mark.parametrize("typed", [["check"], ["stage", "plant"], ["bench", "score"]])
def test_only_the_typed_command_is_built(typed: list[str]) -> None:
    check_only_the_typed_is_built(PROGRAM, COMMANDS, typed)


def test_command_of_the_other_program_is_refused(capsys: pytest.CaptureFixture[str]) -> None:
    check_unknown_command(PROGRAM, COMMANDS, "estimate", capsys)


RANGES = {
    "--max-samples": (1, 1_000_000), "--samples": (1, 1_000_000), "--digits": (1, 17),
    "--seed": (0, 2**53), "--cores": (1, 2**53),
}  # fmt: skip


def test_whole_numbers_are_accepted_from_their_minimum_to_their_maximum() -> None:
    found = {
        (parser.prog, one.option_strings[-1]): one.type
        for parser in ALL
        for one in parser._actions
        if "whole" in getattr(one.type, "__qualname__", "")
    }
    assert {option for _, option in found} == set(RANGES)
    for (_, option), parse in found.items():
        least, most = RANGES[option]
        assert [parse(str(each)) for each in (least, most)] == [least, most]
        for each in (least - 1, most + 1):
            with pytest.raises(argparse.ArgumentTypeError, match=f"from {least} to {most}$"):
                parse(str(each))
