"""Where printers find constants, memory and estimates that lines name."""

from __future__ import annotations

import re
from collections.abc import Mapping

from reobserve.codegen.lowering import Block, lowered
from reobserve.codegen.statements import Function, Program, estimate_name

_WORD = re.compile(r"(?<![\w.])[A-Za-z_]\w*")


def replaced(text: str, places: Mapping[str, str]) -> str:
    """A line with names replaced."""
    return _WORD.sub(lambda word: places.get(word[0], word[0]), text)


def step_block(program: Program) -> Block:
    """The step as lines."""
    return lowered(program.body, program.locals)


def function_block(program: Program, function: Function) -> Block:
    """A function as lines; its result has room where it is called."""
    own = {name: shape for name, shape in program.locals.items() if name != function.result.name}
    return lowered(function.body, own)


def places(program: Program, memory: str, estimate: str) -> dict[str, str]:
    """What names become: those of memory and estimates with a prefix."""
    kept = {name: f"{memory}{name}" for name in program.memory}
    told = {estimate_name(name): f"{estimate}{name}" for name in program.estimates}
    return {**kept, **told}
