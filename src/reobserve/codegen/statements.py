"""Statements of C, of which those are written that results depend on."""

from __future__ import annotations

import re
from collections.abc import Hashable, Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from textwrap import wrap
from typing import Any

from reobserve.codegen.values import (
    NOTHING,
    Bounds,
    Number,
    Reads,
    Storage,
    Variable,
    View,
    negated,
    union,
)

WIDTH = 100


@dataclass(eq=False)
class Statement:
    """The base class. Only what is ``live`` is written, below declarations of variables."""

    live: bool = field(default=False, init=False)
    above: list[Variable] = field(default_factory=list, init=False)
    declared: str = field(default="", init=False)


@dataclass(eq=False)
class Comment(Statement):
    """A comment above the next statement."""

    text: str


@dataclass(eq=False)
class Assign(Statement):
    """``target`` is a variable or the storage that ``text`` is an entry of."""

    target: Variable | Storage
    text: str
    sign: str
    value: str
    reads: Reads


@dataclass(eq=False)
class Table(Statement):
    """A local array, which later statements write."""

    storage: Storage


@dataclass(eq=False)
class Invoke(Statement):
    """A call whose function writes arrays, and where its result goes, if it has one."""

    call: Call
    target: Variable | None = None


@dataclass(eq=False)
class If(Statement):
    """Statements under a condition, and others."""

    condition: Number
    body: Block
    otherwise: Block


@dataclass(eq=False)
class For(Statement):
    """Statements for each value of a variable. ``head`` is what stands in parentheses."""

    head: str
    reads: Reads
    body: Block


@dataclass(eq=False)
class Jump(Statement):
    """Leave a loop, go on with it, or return values."""

    word: str
    values: tuple[Number, ...] = ()
    routine: Routine | None = None


@dataclass(eq=False)
class Block:
    """Statements in their order."""

    statements: list[Statement] = field(default_factory=list)


@dataclass(eq=False)
class Call:
    """A call of a function with numbers and arrays, one a parameter."""

    routine: Routine
    arguments: list[Number | View]
    live: bool = False

    @property
    def token(self) -> str:
        """The characters that stand for it in a text."""
        return f"\x01{id(self)}\x02"


@dataclass(eq=False)
class Routine:
    """A function of C: ``results`` are the kinds of the numbers that it returns."""

    name: str
    about: str
    parameters: list[Variable | Storage] = field(default_factory=list)
    results: list[str] = field(default_factory=list)
    bounds: list[Bounds] = field(default_factory=list)  # of these
    body: Block = field(default_factory=Block)
    calls: list[Call] = field(default_factory=list)
    writes: set[Storage] = field(default_factory=set)  # what is not its own
    effects: set[Storage] = field(default_factory=set)  # of these what is live
    structure: str = ""

    @property
    def result(self) -> tuple[Routine, str]:
        """The key of its result among what is needed."""
        return self, "result"


class Needed:
    """All that the results of the last of some functions depend on. It marks live statements."""

    def __init__(self, routines: list[Routine], wanted: set[Storage]) -> None:
        self.keys: set[Hashable] = {*wanted, routines[-1].result}
        self.written: set[Storage] = set()  # parameters of which a caller reads what is written
        self.calls = {call.token: call for routine in routines for call in routine.calls}
        self.marked, size = 0, -1
        while size != (size := self.marked + len(self.keys) + len(self.written)):
            for call in self.calls.values():
                self._bind(call)
            for routine in routines:
                self._block(routine, routine.body, False, False)

    def _bind(self, call: Call) -> None:
        for parameter, argument in zip(call.routine.parameters, call.arguments, strict=True):
            given = argument.storage if isinstance(argument, View) else None
            if isinstance(parameter, Storage) and self._wanted(given):
                self.written.add(parameter)
            if call.live and (parameter in self.keys or parameter in call.routine.effects):
                self._read(argument.reads)
                if given is not None and parameter in self.keys:
                    self.keys.add(given)

    def _wanted(self, target: Variable | Storage | None) -> bool:
        """True if what is written to it is read."""
        return target in self.keys or target in self.written

    def _read(self, keys: Reads) -> None:
        for key in keys:
            self.keys.add(key)
            if isinstance(key, Call):
                key.live = True
                self.keys.add(key.routine.result)

    def _block(self, routine: Routine, block: Block, after: bool, repeated: bool) -> bool:
        """Mark statements, after which something live follows or not, and return if one is live."""
        found = False
        for statement in reversed(block.statements):
            if self._statement(routine, statement, after, repeated):
                self.marked += not statement.live
                statement.live = found = True
            after = after or statement.live
        return found

    def _statement(self, routine: Routine, one: Any, after: bool, repeated: bool) -> bool:
        live: bool = one.live
        if isinstance(one, Assign):
            live = self._wanted(one.target)
            if live:
                self._read(one.reads)
                routine.effects |= {one.target} & routine.writes  # type: ignore[arg-type]
        elif isinstance(one, Table):
            live = one.storage in self.keys
        elif isinstance(one, Invoke):
            live = self._invoke(routine, one)
        elif isinstance(one, If):
            live = self._block(routine, one.body, after, repeated)
            live = self._block(routine, one.otherwise, after, repeated) or live
            if live:
                self._read(one.condition.reads)
        elif isinstance(one, For):
            live = self._block(routine, one.body, after or one.live, one.live)
            if live:
                self._read(one.reads)
        elif isinstance(one, Jump):
            live = repeated if one.routine is None else after
            if one.routine is not None and routine.result in self.keys and one.values:
                live = True
                self._read(union(value.reads for value in one.values))
        return live

    def _invoke(self, routine: Routine, one: Invoke) -> bool:
        call = one.call
        read = one.target is not None and one.target in self.keys
        if read:
            self.keys.add(call.routine.result)
        pairs = dict(zip(call.routine.parameters, call.arguments, strict=True))
        for effect in call.routine.effects:
            argument = pairs.get(effect)
            storage = argument.storage if isinstance(argument, View) else effect
            if self._wanted(storage):
                call.live = True
                if storage in routine.writes:
                    routine.effects.add(storage)
        call.live = call.live or read
        return call.live


class Text:
    """The text of functions, of which the live statements are marked.

    ``structures`` are the types of what is handed over by a pointer, by their names in the code.
    """

    def __init__(self, needed: Needed, structures: Mapping[str, str]) -> None:
        self.needed, self.structures = needed, structures

    def function(self, routine: Routine, head: str = "", begin: str = "") -> str:
        """A function with its comment, with a ``head`` of its own or as others call it.

        Its first lines are those to ``begin`` with.
        """
        found = (self._assigned(one) for one in walk(routine.body))
        variables = {one for one in found if one is not None and not one.parameter}
        for variable in sorted(variables, key=lambda each: each.name):
            self._declare(routine.body, variable)
        about = line(comment(routine.about), "") if routine.about else ""
        body = "".join(self._lines(routine.body, 1, frozenset()))
        return f"{about}{head or self._head(routine)}{{\n{begin}{body}}}\n\n"

    def _head(self, routine: Routine) -> str:
        kind = "void"
        if self._is_read(routine):
            kind = routine.structure or routine.results[0]
        given = []
        for one in routine.parameters:
            if self._taken(routine, one):
                pointer = isinstance(one, Storage)
                const = "const " if pointer and one not in routine.effects else ""
                given.append(f"{const}{one.kind} {'*' if pointer else ''}{one.name}")
        given += [f"{self.structures[root]} *{root}" for root in self.roots(routine)]
        return line(f"static {kind} {routine.name}({', '.join(given) or 'void'})", "")

    def _is_read(self, routine: Routine) -> bool:
        return bool(routine.results) and routine.result in self.needed.keys

    def _taken(self, routine: Routine, parameter: Variable | Storage) -> bool:
        """True if a parameter is read, or what is written to it."""
        return parameter in self.needed.keys or parameter in routine.effects

    def _keys(self, keys: Iterable[Hashable]) -> Iterator[Hashable]:
        """All that is read, also by the arguments of calls."""
        for key in keys:
            yield key
            if isinstance(key, Call):
                pairs = zip(key.routine.parameters, key.arguments, strict=True)
                for parameter, argument in pairs:
                    if self._taken(key.routine, parameter):
                        yield from self._keys(argument.reads)
                        if isinstance(argument, View):
                            yield argument.storage

    def _used(self, one: Statement) -> set[Hashable]:
        """All that a statement reads or writes, without what stands inside it."""
        if isinstance(one, Jump) and (one.routine is None or not self._is_read(one.routine)):
            return set()
        target = one.target if isinstance(one, Assign) else self._assigned(one)
        return {*self._keys(reads_of(one)), *([] if target is None else [target])}

    def _assigned(self, one: Any) -> Variable | None:
        """The variable that a statement gives a value."""
        whole = isinstance(one, Assign) and one.sign == "="
        if whole or (isinstance(one, Invoke) and one.target in self.needed.keys):
            return one.target if isinstance(one.target, Variable) else None
        return None

    def roots(self, routine: Routine) -> list[str]:
        """The structures and given arrays that a function and those it calls use, in order."""
        found = set()
        for one in walk(routine.body):
            for key in self._used(one):
                if isinstance(key, Storage) and key.root in self.structures:
                    found.add(key.root)
                elif isinstance(key, Call):
                    found |= {*self.roots(key.routine)}
        return [root for root in self.structures if root in found]

    # --- Declarations ---

    def _declare(self, block: Block, variable: Variable) -> None:
        """Declare a variable where it is first assigned, or above all statements that use it."""
        using = [one for one in block.statements if self._uses(one, variable)]
        first: Any = using[0]
        if self._assigned(first) is variable:
            once = sum(self._assigned(one) is variable for one in walk(block)) == 1
            changed = any(one.target is variable for one in walk(block) if isinstance(one, Assign)
                          and one.sign != "=")  # fmt: skip
            first.declared = f"{'const ' if once and not changed else ''}{variable.kind} "
        elif all(self._closed(one, variable) for one in using):
            for one in using:
                for inner in blocks(one):
                    if any(self._uses(each, variable) for each in inner.statements):
                        self._declare(inner, variable)
        else:
            first.above.append(variable)

    def _uses(self, one: Statement, variable: Variable) -> bool:
        if not one.live:
            return False
        inside = (each for block in blocks(one) for each in block.statements)
        return variable in self._used(one) or any(self._uses(each, variable) for each in inside)

    def _closed(self, one: Statement, variable: Variable) -> bool:
        """True if all that a statement does with a variable is between its own braces."""
        if not isinstance(one, If | For) or variable in self._used(one):
            return False
        for block in blocks(one):
            using = [each for each in block.statements if self._uses(each, variable)]
            begun = not using or self._assigned(using[0]) is variable
            if not begun and not all(self._closed(each, variable) for each in using):
                return False
        return True

    # --- Lines ---

    def _rendered(self, text: str) -> str:
        """A text with the calls that stand in it."""
        while "\x01" in text:
            text = re.sub("\x01\\d+\x02", lambda found: self._call(found.group()), text)
        return text

    def _call(self, token: str) -> str:
        call = self.needed.calls[token]
        parts = [
            argument.pointer() if isinstance(argument, View) else argument.text
            for parameter, argument in zip(call.routine.parameters, call.arguments, strict=True)
            if self._taken(call.routine, parameter)
        ]
        return f"{call.routine.name}({', '.join([*parts, *self.roots(call.routine)])})"

    def _lines(self, block: Block, depth: int, visible: frozenset[str]) -> Iterator[str]:
        """The lines of a block, in which variables of some names are ``visible``."""
        space, above = "    " * depth, ""
        for one in block.statements:
            if isinstance(one, Comment):
                above = line(comment(one.text), space)
            elif one.live:
                yield above
                above = ""
                for variable in sorted(one.above, key=lambda each: each.name):
                    if variable.name not in visible:
                        yield f"{space}{variable.kind} {variable.name};\n"
                    visible |= {variable.name}
                if one.declared and isinstance(one, Assign | Invoke) and one.target is not None:
                    one.declared = "" if one.target.name in visible else one.declared
                    visible |= {one.target.name}
                yield from self._statement(one, space, depth, visible)

    def _statement(
        self, one: Any, space: str, depth: int, visible: frozenset[str]
    ) -> Iterator[str]:
        if isinstance(one, Assign):
            text = f"{one.declared}{one.text} {one.sign} {one.value};"
            yield line(self._rendered(text), space)
        elif isinstance(one, Table):
            sizes = "".join(f"[{size}]" for size in one.storage.shape)
            yield f"{space}{one.storage.kind} {one.storage.name}{sizes};\n"
        elif isinstance(one, Invoke):
            into = "(void)" if self._is_read(one.call.routine) else ""
            if one.target is not None and one.target in self.needed.keys:
                into = f"{one.declared}{one.target.name} = "
            yield line(self._rendered(f"{into}{one.call.token};"), space)
        elif isinstance(one, Jump):
            yield from self._jump(one, space)
        elif isinstance(one, For):
            yield line(self._rendered(f"for ({one.head}) {{"), space)
            yield from self._lines(one.body, depth + 1, visible)
            yield f"{space}}}\n"
        elif isinstance(one, If):
            body, otherwise, text = one.body, one.otherwise, one.condition.text
            if not any(each.live for each in body.statements):
                body, otherwise, text = otherwise, Block(), negated(one.condition).text
            yield line(self._rendered(f"if ({text}) {{"), space)
            yield from self._lines(body, depth + 1, visible)
            rest = [each for each in otherwise.statements if each.live]
            if len(rest) == 1 and isinstance(rest[0], If) and not rest[0].above:
                first, *lines = self._statement(rest[0], space, depth, visible)
                yield f"{space}}} else {first.lstrip()}"
                yield from lines
                return
            if rest:
                yield f"{space}}} else {{\n"
                yield from self._lines(otherwise, depth + 1, visible)
            yield f"{space}}}\n"

    def _jump(self, one: Jump, space: str) -> Iterator[str]:
        routine = one.routine
        if routine is None or not self._is_read(routine):
            yield f"{space}{one.word};\n"
            return
        values = ", ".join(self._rendered(value.text) for value in one.values)
        if routine.structure:
            yield line(f"const {routine.structure} returned = {{{values}}};", space)
            values = "returned"
        yield line(f"return {values};", space)


def blocks(one: Any) -> list[Block]:
    """The statements inside a statement."""
    return [one.body, one.otherwise] if isinstance(one, If) else (
        [one.body] if isinstance(one, For) else []
    )  # fmt: skip


def walk(block: Block) -> Iterator[Any]:
    """All live statements of a block, also those inside others."""
    for one in block.statements:
        if one.live:
            yield one
            for inner in blocks(one):
                yield from walk(inner)


def reads_of(one: Any) -> Reads:
    """All that a statement reads, without what stands inside it."""
    if isinstance(one, Assign | For):
        return one.reads
    if isinstance(one, If):
        return one.condition.reads
    if isinstance(one, Invoke):
        return frozenset({one.call})
    return union(value.reads for value in one.values) if isinstance(one, Jump) else NOTHING


def comment(text: str) -> str:
    """A comment of C, without marks of comments in it."""
    return f"/* {text.replace('*/', '* /').replace('/*', '/ *')} */"


def line(text: str, space: str) -> str:
    """A line of C, broken where it is too long."""
    margins: dict[str, Any] = {"break_long_words": False, "break_on_hyphens": False}
    parts = wrap(text, WIDTH, initial_indent=space, subsequent_indent=f"{space}    ", **margins)
    return "".join(f"{part}\n" for part in parts)
