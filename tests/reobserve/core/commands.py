"""Checks of the sub-commands of any program."""

from __future__ import annotations

import argparse
import importlib
import inspect
from collections.abc import Iterator

import pytest

from reobserve.core.command_line import CommandTable, command_parser


def commands(parser: argparse.ArgumentParser) -> Iterator[argparse.ArgumentParser]:
    """The parsers of all sub-commands that run something."""
    if parser.get_default("run"):
        yield parser
    for inner in sub_commands(parser).values():
        yield from commands(inner)


def sub_commands(parser: argparse.ArgumentParser) -> dict[str, argparse.ArgumentParser]:
    """The parsers right below a parser."""
    for action in parser._actions:
        if isinstance(action, argparse._SubParsersAction):
            return dict(action.choices)
    return {}


def check_arguments(parser: argparse.ArgumentParser) -> None:
    """Check that what a command calls takes its options."""
    module, name = parser.get_default("run").split(":")
    function = getattr(importlib.import_module(module), name)
    options = {one.dest for one in parser._actions} - {"help", "version"}
    options |= parser._defaults.keys() - {"run", "extra"}
    inspect.signature(function).bind(**dict.fromkeys(options))


def check_help(program: str, table: CommandTable, monkeypatch: pytest.MonkeyPatch) -> None:
    """Check that the help fits a terminal and lists all commands."""
    monkeypatch.setenv("COLUMNS", "80")
    for words in ((), ("--help",)):
        text = command_parser(program, table, words).format_help()
        assert len(text.splitlines()) <= 24
        assert all(f"    {name} " in text for name in table.commands)


def check_only_the_typed_is_built(program: str, table: CommandTable, typed: list[str]) -> None:
    """Check that a parser of a line has the options of its command only."""
    whole, built = command_parser(program, table), command_parser(program, table, typed)
    for word in typed:
        assert set(sub_commands(built)) == {word} < set(sub_commands(whole))
        whole, built = sub_commands(whole)[word], sub_commands(built)[word]
    assert built.format_help() == whole.format_help()


def check_unknown_command(
    program: str, table: CommandTable, other: str, capsys: pytest.CaptureFixture[str]
) -> None:
    """Check that a command of the other program is refused, and where to look."""
    with pytest.raises(SystemExit):
        command_parser(program, table, [other])
    said = capsys.readouterr().err.splitlines()[-1]
    known = ", ".join(table.commands)
    assert said.startswith(
        f"{program}: error: argument COMMAND: there is no '{other}', only {known};"
    )
    assert said.endswith(f"; {table.other} has others")
