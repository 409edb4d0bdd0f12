"""The sub-commands of `reobserve`: their help, their options and what they call."""

from __future__ import annotations

import argparse

import pytest

from reobserve.cli.main import COMMANDS, PROGRAM, command_parser
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


@pytest.mark.parametrize("typed", [["estimate"], ["export"]])
def test_only_the_typed_command_is_built(typed: list[str]) -> None:
    check_only_the_typed_is_built(PROGRAM, COMMANDS, typed)


def test_command_of_the_other_program_is_refused(capsys: pytest.CaptureFixture[str]) -> None:
    check_unknown_command(PROGRAM, COMMANDS, "stage", capsys)
