"""Checks of the sub-commands of any program."""

from __future__ import annotations

import argparse
import importlib
import inspect
import random
from collections.abc import Iterator
from itertools import chain

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
    options |= parser._defaults.keys() - {"run", "extra", "begins"}
    inspect.signature(function).bind(**dict.fromkeys(options))


def check_any_order(parser: argparse.ArgumentParser) -> None:
    """Check that options may stand between arguments, but for those that take all that follows."""
    words, last = [], []
    for one in parser._actions[1:]:
        name, several = one.option_strings[-1:], one.nargs in ("+", "*")
        value = [str(next(iter(one.choices or ["1"])))] * (one.nargs != 0)
        value *= one.nargs if isinstance(one.nargs, int) and value else 2 if several else 1
        if "tree" in getattr(one.type, "__qualname__", ""):
            value = ["{}"]
        if not name:
            words += [[word] for word in value]
        elif several:
            last += [*name, *value]
        else:
            words.append([*name, *value])
    wanted = vars(parser.parse_args([*chain(*words), *last]))
    draw = random.Random(parser.prog)
    for _ in range(8):
        others = [word for word in words if word[0][0] == "-"]
        line = [word for word in words if word[0][0] != "-"]
        for option in others:
            line.insert(draw.randint(0, len(line)), option)
        assert vars(parser.parse_args([*chain(*line), *last])) == wanted


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
