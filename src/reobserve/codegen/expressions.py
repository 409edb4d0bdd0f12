"""Expressions of Python in C: numbers, arrays and what is known of them."""

from __future__ import annotations

import ast
import builtins
import inspect
import math
import operator
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import replace
from typing import Any, NoReturn

import numpy as np

from reobserve.codegen.sources import (
    plain,
    stored,
)
from reobserve.codegen.statements import (
    Assign,
    Block,
    Call,
    If,
    Invoke,
    Routine,
    Statement,
    Table,
)
from reobserve.codegen.values import (
    AND,
    ANYWHERE,
    ATOM,
    COMPARED,
    LARGEST,
    OR,
    PRODUCT,
    SIGN,
    SUM,
    TERNARY,
    TRUTH,
    Bounds,
    Number,
    Storage,
    Variable,
    View,
    as_number,
    double,
    joint,
    negated,
    number,
    row_strides,
    union,
)
from reobserve.core.direct_call import call as direct_call
from reobserve.core.errors import InputError

_MATH = frozenset(
    """acos acosh asin asinh atan atan2 atanh cos cosh erf exp expm1 floor log log1p sin sinh sqrt
    tan tanh isfinite isnan isinf""".split()  # noqa: SIM905
)

ARITHMETIC: dict[type, tuple[str, int, Any]] = {
    ast.Add: ("+", SUM, operator.add), ast.Sub: ("-", SUM, operator.sub),
    ast.Mult: ("*", PRODUCT, operator.mul), ast.Div: ("/", PRODUCT, operator.truediv),
    ast.FloorDiv: ("/", PRODUCT, operator.floordiv), ast.Mod: ("%", PRODUCT, operator.mod),
    ast.Pow: ("", PRODUCT, operator.pow), ast.BitAnd: ("&&", AND, operator.and_),
}  # fmt: skip

_REAL = "double", "float"

_COMPARED: dict[type, tuple[str, Any]] = {
    ast.Lt: ("<", operator.lt), ast.LtE: ("<=", operator.le), ast.Gt: (">", operator.gt),
    ast.GtE: (">=", operator.ge), ast.Eq: ("==", operator.eq), ast.NotEq: ("!=", operator.ne),
}  # fmt: skip

_HELPERS = {
    "least": "static double least(double first, double second)\n{\n"
    "    return (second < first) ? second : first;\n}\n\n",
    "greatest": "static double greatest(double first, double second)\n{\n"
    "    return (second > first) ? second : first;\n}\n\n",
}


def _joined_bounds(sign: ast.operator, first: Bounds, second: Bounds) -> Bounds:
    """Bounds of the result of arithmetic of whole numbers."""
    (a, b), (c, d) = first, second
    if isinstance(sign, ast.Add):
        return a + c, b + d
    if isinstance(sign, ast.Sub):
        return a - d, b - c
    if isinstance(sign, ast.Mult):
        corners = [left * right if left and right else 0 for left in first for right in second]
        return min(corners), max(corners)
    return 0, d if isinstance(sign, ast.Mod) else b


def _varies(value: Any) -> bool:
    """True if a value, or a part of a tuple, is known in C alone."""
    parts = value if isinstance(value, tuple) else ()
    return isinstance(value, Number | View) or any(map(_varies, parts))


class Expressions:
    """One function: its names and what they stand for, and the block that is being written."""

    def __init__(
        self, of: Any, routine: Routine, scope: dict[str, Any], equations: dict[int, str],
        place: tuple[str, int], tree: ast.FunctionDef,
    ) -> None:  # fmt: skip
        self.of, self.routine, self.scope, self.tree = of, routine, scope, tree
        self.equations, self.place = equations, place
        self.env: dict[str, Any] = {}
        self.block, self.depth = routine.body, 0  # of conditions and loops around
        self.taken: set[str] = set()
        self.variables: dict[tuple[str, str, str], Variable] = {}  # by name, kind and whole
        self.spelled: dict[tuple[str, str], str] = {}
        counts = [name for node in ast.walk(tree) for name in stored(node)]
        counts += [one.arg for one in ast.walk(tree.args) if isinstance(one, ast.arg)]
        self.own = {*counts}
        self.again = {name for name in counts if counts.count(name) > 1}
        self.returned: list[Any] = []
        self.handed = 0
        # Of the loops around, their statements if they are run through here, else None.
        self.once: list[list[ast.stmt] | None] = []
        self.loop_depth: list[int] = []
        self.loops_change: frozenset[str] = frozenset()
        self.loop_names: dict[str, str] = {}
        self.open_loops: list[str] = []
        self.node: ast.AST = tree

    def refuse(self, what: str) -> NoReturn:
        """Refuse what is not known here, with its place."""
        file, first = self.place
        line = first + getattr(self.node, "lineno", 1) - 1
        raise InputError("observer", f"cannot be exported: {file}, line {line}: {what}")

    def _named(self, name: str) -> str:
        free: str = self.of.local(name, self.taken)
        return free

    def _number(self, variable: Variable, bounds: Bounds = ANYWHERE) -> Number:
        return Number(variable.name, variable.kind, ATOM, frozenset({variable}), bounds)

    def emit(self, statement: Statement) -> None:
        """Add a statement."""
        self.block.statements.append(statement)

    @contextmanager
    def inside(self, block: Block) -> Iterator[None]:
        """Statements go to another block."""
        outside, self.block = self.block, block
        try:
            yield
        finally:
            self.block = outside

    def _kept(self, value: Number, name: str) -> Number:
        """A value in a variable of its own."""
        variable = Variable(self._named(name), value.kind)
        self.emit(Assign(variable, variable.name, "=", value.text, value.reads))
        return self._number(variable, value.bounds)

    def _write(self, view: View, sign: str, value: Any) -> None:
        storage = view.storage
        if view.shape or storage.where in ("constant", "given"):
            self.refuse("an assignment to what is no entry of an array that is written")
        if storage.where != "local":
            self.routine.writes.add(storage)
        number_ = as_number(value) if storage.integer else double(value)
        entry = view.entry()
        if sign == "=" and number_.text == entry.text:
            return
        reads = (entry.reads - {storage}) | number_.reads | ({storage} if sign != "=" else set())
        self.emit(Assign(storage, entry.text, sign, number_.text, frozenset(reads)))

    def _variable(self, name: str, kind: str, whole: str = "") -> Variable:
        key = (name, kind, whole or name)
        if key not in self.variables:
            if key[:2] not in self.spelled:
                self.spelled[key[:2]] = self._named(name)
            self.variables[key] = Variable(self.spelled[key[:2]], kind)
        return self.variables[key]

    def _entry(self, node: ast.Subscript) -> View:
        view = self.expression(node.value)
        if not isinstance(view, View):
            self.refuse("an assignment to an entry of what is no array")
        return self._part(view, node.slice)

    def expression(self, node: ast.expr, whole: bool = False, hint: str = "") -> Any:
        """The value of an expression, which as a ``whole`` may be a call that writes arrays."""
        method = getattr(self, f"_of_{type(node).__name__}", None)
        if method is None:
            self.refuse(f"an expression of the kind {type(node).__name__}")
        return method(node, whole, hint)

    def _of_Constant(self, node: ast.Constant, *_: Any) -> Any:
        return node.value

    def _of_Name(self, node: ast.Name, *_: Any) -> Any:
        if node.id in self.env:
            return self.env[node.id]
        if node.id in self.scope and node.id not in self.own:
            return self.of.value(self.scope[node.id], node.id)
        if node.id in self.own or not hasattr(builtins, node.id):
            self.refuse(f"{node.id}, which stands for several things here")
        return getattr(builtins, node.id)

    def _of_Attribute(self, node: ast.Attribute, *_: Any) -> Any:
        value = self.expression(node.value)
        if isinstance(value, Number) or not hasattr(value, node.attr):
            self.refuse(f"the attribute {node.attr}")
        if isinstance(value, View) and node.attr != "shape":
            self.refuse(f"the attribute {node.attr} of an array")
        found = getattr(value, node.attr)
        return found.item() if isinstance(found, np.generic) else found

    def _of_Tuple(self, node: ast.Tuple, whole: bool, hint: str) -> tuple[Any, ...]:
        values: list[Any] = []
        for each, name in zip(node.elts, [*hint.split(), *[""] * len(node.elts)], strict=False):
            # What a call writes must not have been read before it.
            read = [v for v in values if isinstance(v, Number) and v.reads]
            values.append(self.expression(each, whole and not read, name))
        return tuple(values)

    def _of_Subscript(self, node: ast.Subscript, *_: Any) -> Any:
        value = self.expression(node.value)
        if isinstance(value, tuple):
            if isinstance(node.slice, ast.Slice):
                return tuple(value)[self._slice(node.slice, len(value))]
            index = self.expression(node.slice)
            return value[index] if isinstance(index, int) else self._chosen(value, index)
        if not isinstance(value, View):
            self.refuse("an entry of what is no array and no tuple")
        return self._read(self._part(value, node.slice))

    def _chosen(self, values: tuple[Any, ...], index: Any) -> Number:
        """An entry of a tuple of numbers at a place that is not known here."""
        if not all(isinstance(each, Number | int | float) for each in values):
            self.refuse("an entry of a tuple that holds no numbers, at a place that varies")
        storage: Storage
        if all(isinstance(each, int | float) for each in values):
            storage = self.of.constant("choices", np.array(values, dtype=np.float64))
        else:
            storage = Storage(self._named("choices"), "local", (len(values),))
            self.emit(Table(storage))
            for place, each in enumerate(values):
                self._write(storage.view().moved(0, place).without(0), "=", each)
        return storage.view().moved(0, self._index(index, len(values))).without(0).entry()

    def _index(self, index: Any, size: int) -> Any:
        """An index of an axis, which counts from the end of it where it is negative."""
        if not isinstance(index, Number):
            return index + size if index < 0 else index
        if index.kind != "int32_t":
            self.refuse("an index that is no whole number")
        here, behind = index.within(SUM), f"{index.within(SUM)} + {size}"
        if index.natural:
            return index
        return Number(f"({here} < 0) ? {behind} : {here}", "int32_t", TERNARY, index.reads)

    def _read(self, view: View) -> Any:
        """The entry of a view of no axis, or a view."""
        if view.shape:
            return view
        known = view.uniform
        if known is not None:
            return known
        data = view.storage.data
        if view.storage.integer and data is not None and not view.terms:
            return int(data.reshape(-1)[view.start])
        return view.entry()

    def _part(self, view: View, node: ast.expr) -> View:
        axis = 0
        for each in node.elts if isinstance(node, ast.Tuple) else [node]:
            if isinstance(each, ast.Slice):
                view = self._cut(view, axis, each)
                axis += 1
                continue
            index = self._index(self.expression(each), view.shape[axis])
            if isinstance(index, int) and not 0 <= index < view.shape[axis]:
                self.refuse("an index beyond the end of an array")
            view = view.moved(axis, index).without(axis)
        return view

    def _slice(self, node: ast.Slice, size: int) -> slice:
        parts = [None if p is None else self.expression(p) for p in (node.lower, node.upper)]
        if node.step is not None or not all(isinstance(p, int | None) for p in parts):
            self.refuse("a slice whose ends are not known here")
        return slice(*slice(*parts).indices(size)[:2])

    def _cut(self, view: View, axis: int, node: ast.Slice) -> View:
        lower, upper, shape = node.lower, node.upper, list(view.shape)
        start = None if lower is None else self.expression(lower)
        if isinstance(start, Number):
            # From i to i + 1, say.
            ahead = upper.right if isinstance(upper, ast.BinOp) else None
            count = ahead.value if isinstance(ahead, ast.Constant) else None
            same = (
                isinstance(upper, ast.BinOp)
                and isinstance(upper.op, ast.Add)
                and (lower is not None and ast.dump(upper.left) == ast.dump(lower))
            )
            if not same or not isinstance(count, int):
                self.refuse("a slice whose length is not known here")
            if not start.natural or start.bounds[1] + count > shape[axis]:
                self.refuse("a slice that may reach beyond the array")
            shape[axis] = count
        else:
            span = self._slice(node, view.shape[axis])
            start, shape[axis] = span.start, max(span.stop - span.start, 0)
        return replace(view.moved(axis, start), shape=tuple(shape))

    def _of_UnaryOp(self, node: ast.UnaryOp, whole: bool, _: str) -> Any:
        if isinstance(node.op, ast.Not):
            value = self.expression(node.operand, whole)
            if not isinstance(value, Number):
                return not value
            return negated(value)
        value = self.expression(node.operand)
        if not isinstance(node.op, ast.USub):
            self.refuse("such a sign")
        if not isinstance(value, Number):
            return -value
        text = value.within(SIGN)
        text = f"({text})" if text.startswith("-") else text
        low, high = value.bounds
        return Number(f"-{text}", value.kind, SIGN, value.reads, (-high, -low))

    def _of_BoolOp(self, node: ast.BoolOp, whole: bool, _: str) -> Any:
        """A conjunction or disjunction, whose further parts are computed if the first says so."""
        conjunction = isinstance(node.op, ast.And)
        value = self.expression(node.values[0], whole)
        for each in node.values[1:]:
            if not isinstance(value, Number):
                if bool(value) is not conjunction:
                    return value
                value = self.expression(each, whole)
                continue
            block = Block()
            with self.inside(block):
                more = self.expression(each, whole)
            first, second = self._alike(value, more)
            if block.statements or not (first.truth and second.truth):
                kept: Any = self._kept(first, "both" if conjunction else "either")
                (target,) = kept.reads
                assign = Assign(target, kept.text, "=", second.text, second.reads)
                test = kept if conjunction else negated(kept)
                self.emit(If(test, Block([*block.statements, assign]), Block()))
                value = replace(kept, bounds=joint(first.bounds, second.bounds))
            elif not isinstance(more, Number):
                if bool(more) is not conjunction:
                    return bool(more)
            else:
                sign, level = ("&&", AND) if conjunction else ("||", OR)
                parts = [p.within(COMPARED if p.level != level else level) for p in (value, more)]
                reads = value.reads | more.reads
                value = Number(f" {sign} ".join(parts), "int32_t", level, reads, TRUTH)
        return value

    def _of_Compare(self, node: ast.Compare, whole: bool, _: str) -> Any:
        alone = all(isinstance(each, ast.Constant) for each in node.comparators)
        values = [self.expression(node.left, whole and alone)]
        values += [self.expression(each) for each in node.comparators]
        found: Any = True
        for sign, left, right in zip(node.ops, values, values[1:], strict=False):
            one = self._compared(sign, left, right)
            if not isinstance(one, Number):
                if not one:
                    return False
            elif isinstance(found, Number):
                text = f"{found.within(AND)} && {one.within(COMPARED)}"
                found = Number(text, "int32_t", AND, found.reads | one.reads, TRUTH)
            else:
                found = one
        return found

    def _compared(self, sign: ast.cmpop, left: Any, right: Any) -> Any:
        if isinstance(sign, ast.Is | ast.IsNot):
            if isinstance(left, Number) or isinstance(right, Number):
                return isinstance(sign, ast.IsNot)
            return (left is right) is isinstance(sign, ast.Is)
        if isinstance(sign, ast.In):
            found: Any = False
            for each in right:
                one = self._compared(ast.Eq(), left, each)
                if one is True:
                    return True
                if isinstance(one, Number) and isinstance(found, Number):
                    text = f"{found.text} || {one.text}"
                    found = Number(text, "int32_t", OR, found.reads | one.reads, TRUTH)
                elif one is not False:
                    found = one
            return found
        if type(sign) not in _COMPARED:
            self.refuse("such a comparison")
        text, operation = _COMPARED[type(sign)]
        if any(not isinstance(one, Number) and _varies(one) for one in (left, right)):
            self.refuse("a comparison of tuples or arrays")
        if not isinstance(left, Number) and not isinstance(right, Number):
            return bool(operation(left, right))
        first, second = self._alike(left, right)
        text = f"{first.within(SUM)} {text} {second.within(SUM)}"
        return Number(text, "int32_t", COMPARED, first.reads | second.reads, TRUTH)

    def _alike(self, left: Any, right: Any) -> tuple[Number, Number]:
        """Two numbers of one kind."""
        for value in (left, right):
            if not isinstance(value, Number | int | float):
                self.refuse("arithmetic of what are no numbers")
        if any(getattr(value, "kind", type(value).__name__) in _REAL for value in (left, right)):
            return double(left), double(right)
        return as_number(left), as_number(right)

    def _of_IfExp(self, node: ast.IfExp, *_: Any) -> Any:
        test = self.expression(node.test)
        if not isinstance(test, Number):
            return self.expression(node.body if test else node.orelse)
        blocks, values = (Block(), Block()), []
        for block, each in zip(blocks, (node.body, node.orelse), strict=True):
            with self.inside(block):
                values.append(self.expression(each))
        first, second = self._alike(*values)
        bounds = joint(first.bounds, second.bounds)
        if blocks[0].statements or blocks[1].statements:
            chosen = Variable(self._named("chosen"), first.kind)
            for block, one in zip(blocks, (first, second), strict=True):
                block.statements.append(Assign(chosen, chosen.name, "=", one.text, one.reads))
            self.emit(If(test, *blocks))
            return self._number(chosen, bounds)
        parts = [one.within(OR) for one in (first, second)]
        condition = test.text if test.level == ATOM else f"({test.text})"
        reads = test.reads | first.reads | second.reads
        text = f"{condition} ? {parts[0]} : {parts[1]}"
        return Number(text, first.kind, TERNARY, reads, bounds)

    def _of_BinOp(self, node: ast.BinOp, *_: Any) -> Any:
        left, right = self.expression(node.left), self.expression(node.right)
        return self._joined(node.op, left, right)

    def _joined(self, sign: ast.operator, left: Any, right: Any) -> Any:
        if type(sign) not in ARITHMETIC:
            self.refuse("such an operator")
        text, level, operation = ARITHMETIC[type(sign)]
        if not isinstance(left, Number) and not isinstance(right, Number):
            with suppress(ArithmeticError):
                found = operation(left, right)
                if not isinstance(found, complex):
                    return found
            with np.errstate(all="ignore"):
                return float(operation(np.float64(left), right))
        if isinstance(sign, ast.Pow):
            return self._power(left, right)
        first, second = self._alike(left, right)
        whole = first.kind == "int32_t"
        if isinstance(sign, ast.Div):
            first, second = double(left), double(right)
        elif text == "&&" and not (first.truth and second.truth):
            self.refuse("an operator of bits")
        elif text in ("/", "%") and not (whole and first.natural and second.natural):
            self.refuse("a division with remainder of what may be negative or no whole number")
        bounds = _joined_bounds(sign, first.bounds, second.bounds) if whole else ANYWHERE
        if LARGEST < max(map(abs, bounds)) < math.inf:
            self.refuse("a whole number that may have more than 32 bits")
        reads = first.reads | second.reads
        joined = f"{first.within(level)} {text} {second.within(level + 1)}"
        return Number(joined, first.kind, level, reads, bounds)

    def _power(self, base: Any, exponent: Any) -> Number:
        """A power, of a whole exponent by squaring, as numba compiles it."""
        for whole in (base, exponent):
            if isinstance(whole, Number) and whole.kind == "int32_t":
                self.refuse("a power of whole numbers that vary")
        if not isinstance(exponent, int):
            first, second = double(base), double(exponent)
            text = f"pow({first.text}, {second.text})"
            return Number(text, "double", ATOM, first.reads | second.reads)
        value = double(base)
        if value.level != ATOM or "\x01" in value.text:
            value = self._kept(value, "base")
        result, left = None, abs(exponent)
        while left:
            if left & 1:
                result = value if result is None else self._times(result, value)
            left >>= 1
            if left:
                value = self._times(value, value)
                if left > 1:
                    value = self._kept(value, "square")
        if result is None:
            return number(1.0)
        if exponent < 0:
            return Number(f"1.0 / {result.within(SIGN)}", "double", PRODUCT, result.reads)
        return result

    def _times(self, left: Number, right: Number) -> Number:
        text = f"{left.within(PRODUCT)} * {right.within(SIGN)}"
        return Number(text, "double", PRODUCT, left.reads | right.reads)

    # --- Calls ---

    def _of_Call(self, node: ast.Call, whole: bool, hint: str) -> Any:
        if node.keywords:
            self.refuse("an argument by its name")
        if isinstance(node.func, ast.Attribute) and node.func.attr == "reshape":
            return self._reshaped(node)
        function = self.expression(node.func)
        given: list[Any] = []
        for argument in node.args:
            if isinstance(argument, ast.Starred):
                given += self.expression(argument.value)
            else:
                given.append(self.expression(argument))
        name = node.func.attr if isinstance(node.func, ast.Attribute) else ""
        name = node.func.id if isinstance(node.func, ast.Name) else name
        if function is direct_call:
            inner = node.args[0]
            name = inner.attr if isinstance(inner, ast.Attribute) else getattr(inner, "id", "")
            function, given = given[0], list(given[1])
        hint = hint if hint.isidentifier() and hint != "_" else ""
        known = self._known_function(function, given, hint)
        return self._of_routine(function, name, given, whole, hint) if known is None else known

    def _known_function(self, function: Any, given: list[Any], hint: str) -> Any:
        """The value of a function of Python, math or numpy, or None for any other."""
        if function is len:
            value = given[0]
            return value.shape[0] if isinstance(value, View) else len(value)
        if function in (min, max):
            return self._least(function, given)
        if function in (abs, float, int, bool) or getattr(function, "__module__", "") == "math":
            return self._of_math(function, given)
        if isinstance(function, np.ufunc):
            return self._of_math(function, given)
        if function is np.empty and len(given) == 1:
            shape = given[0] if isinstance(given[0], tuple) else (given[0],)
            if not all(isinstance(size, int) for size in shape):
                self.refuse("an array whose shape is not known here")
            name = self._named(hint or "local")
            storage = Storage(name, "local", tuple(shape))
            self.emit(Table(storage))
            return storage.view()
        return None

    def _least(self, function: Any, given: list[Any]) -> Any:
        value = given[0]
        for each in given[1:]:
            if not isinstance(value, Number) and not isinstance(each, Number):
                value = function(value, each)
                continue
            first, second = self._alike(value, each)
            reads = first.reads | second.reads
            if first.kind == "int32_t":
                # What is not negative is never below zero.
                if function is min and 0 in (value, each) and first.natural and second.natural:
                    value = 0
                    continue
                sign = "<" if function is min else ">"
                one, other = second.within(SUM), first.within(SUM)
                text = f"({one} {sign} {other}) ? {one} : {other}"
                bounds = tuple(map(function, first.bounds, second.bounds))
                value = Number(text, "int32_t", TERNARY, reads, bounds)
                continue
            name = "least" if function is min else "greatest"
            self.of.helpers[name] = _HELPERS[name]
            value = Number(f"{name}({first.text}, {second.text})", "double", ATOM, reads)
        return value

    def _of_math(self, function: Any, given: list[Any]) -> Any:
        name = function.__name__
        if not any(isinstance(value, Number) for value in given):
            try:
                value = getattr(math, name, function)(*given)
            except (ValueError, OverflowError, ZeroDivisionError):
                with np.errstate(all="ignore"):
                    value = getattr(np, {"pow": "power"}.get(name, name))(*given).item()
            return float(value) if name == "floor" else value
        if name in ("abs", "absolute", "fabs") and as_number(given[0]).kind == "double":
            name = "fabs"
        elif name == "float":
            return double(given[0])
        elif name not in _MATH and name != "pow":
            self.refuse(f"the function {name}")
        parts = [double(value) for value in given]
        text = f"{name}({', '.join(part.text for part in parts)})"
        reads = union(part.reads for part in parts)
        if name.startswith("is"):
            return Number(text, "int32_t", ATOM, reads, TRUTH)
        return Number(text, "double", ATOM, reads)

    def _reshaped(self, node: ast.Call) -> View:
        assert isinstance(node.func, ast.Attribute)
        view, shape = self.expression(node.func.value), self.expression(node.args[0])
        shape = shape if isinstance(shape, tuple) else (shape,)
        if not isinstance(view, View) or view.strides != row_strides(view.shape):
            self.refuse("another shape of what is no array row by row")
        size = math.prod(view.shape)
        shape = tuple(size // max(1, -math.prod(shape)) if n == -1 else n for n in shape)
        return replace(view, shape=shape, strides=row_strides(shape))

    def _of_routine(
        self, function: Any, name: str, given: list[Any], whole: bool, hint: str
    ) -> Any:
        if not inspect.isfunction(plain(function)) and not hasattr(function, "pickled"):
            self.refuse(f"a call of {name or 'what is no function'}")
        node = self.node
        routine, result, handed = self.of.called(function, name, given)
        self.node = node
        if result.parameter is not None:
            return handed[result.parameter]
        call = Call(routine, handed)
        written = self._written(call)
        if hasattr(function, "source") and written - {given[-1].storage}:
            self.refuse(f"a call of {routine.name}, which changes an array that it reads")
        if result.constant and not written:
            return result.value
        self.routine.calls.append(call)
        if written and not whole:
            self.refuse(f"a call of {name}, which writes to arrays, inside an expression")
        self.routine.writes |= {one for one in written if one.where != "local"}
        if result.constant:
            self.emit(Invoke(call))
            return result.value
        reads = frozenset({call})
        if not written and not routine.structure:
            return Number(call.token, routine.results[0], ATOM, reads, routine.bounds[0])
        kind = routine.structure or routine.results[0]
        named = not routine.structure and hint
        target = self._variable(hint, kind) if named else Variable(
            self._named(hint or "result"), kind
        )  # fmt: skip
        if written:
            self.emit(Invoke(call, target))
        else:
            self.emit(Assign(target, target.name, "=", call.token, reads))
        if not routine.structure:
            return self._number(target, routine.bounds[0])
        parts = enumerate(zip(routine.results, routine.bounds, strict=True))
        return tuple(
            Number(f"{target.name}.v{place}", each, ATOM, frozenset({target}), bounds)
            for place, (each, bounds) in parts
        )

    def _written(self, call: Call) -> set[Storage]:
        """The arrays of this function, and of structures, that a call writes to."""
        pairs = zip(call.routine.parameters, call.arguments, strict=True)
        arrays = {p: a.storage for p, a in pairs if isinstance(a, View)}
        written = {arrays.get(one, one) for one in call.routine.writes}
        if any(one.where in ("constant", "given") for one in written):
            self.refuse(f"a call of {call.routine.name} that writes to a constant")
        return written
