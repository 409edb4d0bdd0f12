"""Sub-commands in tables, of which only the one that is typed is built."""

from __future__ import annotations

import argparse
import importlib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NoReturn

from reobserve.core.errors import one_line, shown


@dataclass(frozen=True)
class Command:
    """A sub-command of a table.

    Attributes
    ----------
    text
        What it does, in one line.
    options
        What adds its options to a parser: a function, or ``"module:name"`` of one, or of a
        `CommandTable`.
    run
        ``"module:function"`` that it calls with its options by name; empty for a table.
    extra
        The extra of the distribution that it needs.
    """

    text: str
    options: str | Callable[[argparse.ArgumentParser], None]
    run: str = ""
    extra: str = ""


@dataclass(frozen=True)
class CommandTable:
    """Sub-commands by name, an epilog for the help that lists them, a program that has others."""

    text: str
    commands: Mapping[str, Command]
    title: str = "commands"
    epilog: str = ""
    other: str = ""


class Parser(argparse.ArgumentParser):
    """A parser whose errors are one line, however long the argument is."""

    def error(self, message: str) -> NoReturn:
        """Print the usage and what is wrong, and exit with 2."""
        super().error(one_line(message))


def load(place: str) -> Any:
    """The object that ``"module:name"`` names."""
    module, _, name = place.partition(":")
    return getattr(importlib.import_module(module), name)


def add_commands(
    parser: argparse.ArgumentParser, table: CommandTable, words: Sequence[str] | None
) -> None:
    """Add the sub-commands of a table to a parser.

    Of the sub-commands, only the one that ``words`` begin with gets its options; if they begin with
    none, all are listed for the help. None builds all of them.
    """
    parser.description, parser.epilog = table.text, table.epilog
    parser.formatter_class = argparse.RawDescriptionHelpFormatter
    metavar = table.title.removesuffix("s").upper()
    group = parser.add_subparsers(title=table.title, metavar=metavar, required=True)
    typed = words[0] if words and words[0] in table.commands else None
    if words and typed is None and not words[0].startswith("-"):
        more = f"; {table.other} has others" if table.other else ""
        known = ", ".join(table.commands)
        parser.error(f"argument {metavar}: there is no {shown(words[0])}, only {known}{more}")
    for name, entry in table.commands.items():
        if typed is not None and name != typed:
            continue
        text = entry.text[0].upper() + entry.text[1:] + "."
        command = group.add_parser(name, help=entry.text, description=text)
        if typed is None and words is not None:
            continue
        found = load(entry.options) if isinstance(entry.options, str) else entry.options
        if isinstance(found, CommandTable):
            add_commands(command, found, None if words is None else words[1:])
        else:
            found(command)
            if command.epilog:
                command.formatter_class = argparse.RawDescriptionHelpFormatter
            command.set_defaults(run=entry.run, extra=entry.extra)
