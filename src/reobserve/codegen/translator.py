"""Kernels in C: functions of the subset of Python that they are written in, statement by statement.

A function is translated for the arguments that it is called with. Shapes of arrays, functions,
None and other constants are known, and statements that depend on them alone are decided; named
tuples and their arrays stand where they are, other arrays are handed over by pointers. What is not
known here is refused, with its file and line.
"""

from __future__ import annotations

import ast
import inspect
import math
from collections.abc import Callable, Iterable, Mapping
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import reduce
from typing import Any

import numpy as np

from reobserve.codegen.expressions import ARITHMETIC, Expressions
from reobserve.codegen.sources import (
    changed,
    jumps,
    plain,
    rows_of,
    source,
    stored,
    text_function,
)
from reobserve.codegen.statements import (
    Assign,
    Block,
    Comment,
    For,
    If,
    Jump,
    Routine,
)
from reobserve.codegen.values import (
    ATOM,
    SUM,
    Bounds,
    Number,
    Storage,
    Variable,
    View,
    as_number,
    double,
    joint,
    number,
)
from reobserve.core.errors import InputError

_MOST_UNROLLED = 2000

# A loop is written out if it has so few repetitions, and so few statements come of it, or one for
# each entry of a tuple: compilers then keep the entries of arrays in registers.
_FEW, _SHORT, _TUPLE = 3, 8, 16

# Names that code of C and C++ cannot have: words, those of math.h, also of older ones, and our own.
RESERVED = frozenset(
    """auto break case char const continue default do double else enum extern float for goto if
    inline int long register restrict return short signed sizeof static struct switch typedef union
    unsigned void volatile while asm bool catch class delete explicit export friend mutable
    namespace new operator private protected public template this throw true false try typeid
    typename using virtual and or not xor main abs labs index exit abort y u memory work estimate
    scratch returned least greatest acos acosh asin asinh atan atan2 atanh cbrt ceil copysign cos
    cosh div drem erf erfc exp exp2 exp10 expm1 fabs fdim finite floor fma fmax fmin fmod fpclassify
    frexp gamma hypot ilogb isfinite isinf isnan isnormal j0 j1 jn ldexp lgamma log log10 log1p log2
    logb lrint lround modf nan nearbyint nextafter pow pow10 remainder remquo rint round scalb
    scalbn signbit significand signgam sin sincos sinh sqrt tan tanh tgamma trunc y0 y1 yn
    """.split()  # noqa: SIM905
)


# What is raised where a value is not of the kind that is known there.
_UNKNOWN = (ArithmeticError, AssertionError, AttributeError, LookupError, RecursionError, TypeError,
            ValueError)  # fmt: skip


class _OverError(Exception):
    """The statements behind one are never reached: it is a jump that no condition guards."""

    def __init__(self, word: str) -> None:
        super().__init__(word)
        self.word = word


class Translator:
    """Functions of C, made as they are called, the outermost first.

    ``view`` finds the view of an array of Python. ``alone`` are the arguments of functions that are
    the same array at all calls, as `alone` found them before: they stand where they are. ``ranges``
    are the bounds of variables that loops change, of which those that were ``reached`` are a part.
    """

    def __init__(
        self, view: Callable[[Any, str], View], alone: Mapping[Any, set[int]],
        ranges: Mapping[tuple[str, str], Bounds],
    ) -> None:  # fmt: skip
        self.view, self.given, self.ranges = view, alone, ranges
        self.reached: dict[tuple[str, str], Bounds] = {}
        self.arrays: dict[Any, list[set[Any]]] = {}  # that functions are called with
        self.routines: list[Routine] = []
        self.names: set[str] = {*RESERVED}  # of functions and constants
        self.locals: set[str] = set()  # of all functions
        self.constants: list[Storage] = []
        self.helpers: dict[str, str] = {}  # types and functions of C beside the routines
        self._made: dict[Any, tuple[Routine, Any]] = {}

    def entry(self, function: Any, arguments: tuple[Any, ...]) -> Routine:
        """The routine of the outermost function, whose arguments stand where they are."""
        tree, equations, file, first = source(function)
        names = [one.arg for one in tree.args.args]
        pairs = zip(arguments, names, strict=True)
        values = [self.value(argument, name) for argument, name in pairs]
        routine = Routine("step", "")
        body = Body(self, routine, function.__globals__, equations, (file, first), tree)
        body.translated(values, None)
        self.routines.append(routine)
        return routine

    def value(self, value: Any, path: str) -> Any:
        """A value of Python as the translator knows it: arrays are views."""
        if isinstance(value, np.ndarray):
            return self.view(value, path if "_" in path else f"{path}_table")
        if isinstance(value, tuple):
            fields = getattr(value, "_fields", None)
            names = [f"{path}_{name}" for name in fields] if fields else [path] * len(value)
            parts = [self.value(part, name) for part, name in zip(value, names, strict=True)]
            return tuple(parts) if fields is None else type(value)(*parts)
        return value.item() if isinstance(value, np.generic) else value

    def name(self, wanted: str) -> str:
        """A name of C that is not taken."""
        return self._free(wanted, self.names, self.locals)

    def local(self, wanted: str, taken: set[str]) -> str:
        """A name in a function in which some are ``taken``."""
        name = self._free(wanted, taken, self.names)
        self.locals.add(name)
        return name

    def _free(self, wanted: str, own: set[str], others: set[str]) -> str:
        stem = wanted.strip("_") or "unnamed"
        name, count = stem, 1
        while name in own or name in others:
            count += 1
            name = f"{stem}_{count}"
        own.add(name)
        return name

    def constant(self, name: str, data: Any) -> Storage:
        """A constant array."""
        array = np.ascontiguousarray(data)
        squeezed = array.reshape([size for size in array.shape if size != 1] or [1])
        whole = array.dtype.kind in "iu"
        storage = Storage(self.name(name), "constant", squeezed.shape, whole, squeezed)
        self.constants.append(storage)
        return storage

    def rename(self, storage: Storage, name: str) -> None:
        """Call a constant that had no name by that of the argument which it is first."""
        if storage.where == "constant" and storage.name.endswith("_table"):
            storage.name = self.name(f"{name}_values")

    def structure(self, kinds: list[str]) -> str:
        """The type of several numbers."""
        name = "numbers_" + "".join(kind[0] for kind in kinds)
        fields = "".join(f"    {kind} v{place};\n" for place, kind in enumerate(kinds))
        self.helpers[name] = f"typedef struct {{\n{fields}}} {name};\n\n"
        return name

    def called(
        self, function: Any, name: str, values: list[Any]
    ) -> tuple[Routine, Result, list[Any]]:
        """The routine of a function for such arguments, what it returns, and what it is handed."""
        inner, handed = plain(function), list[Any]()
        missing = inner.__code__.co_argcount - len(values) if inspect.isfunction(inner) else 0
        if missing > 0:
            own = (inner.__defaults__ or ())[-missing:]
            values = [*values, *(self.value(one, f"{name}_default") for one in own)]
        key = (self._identity(function), tuple(self._key(value, handed) for value in values))
        arrays = self.arrays.setdefault(key, [set() for _ in handed])
        for known, value in zip(arrays, handed, strict=True):
            known.add(_fixed(value) if _stands(value) else None)
        fixed = self.given.get(key, set())
        if key not in self._made:
            self._made[key] = self._translated(function, name, values, fixed)
        return *self._made[key], [v for place, v in enumerate(handed) if place not in fixed]

    def alone(self) -> dict[Any, set[int]]:
        """The places of arguments, among those handed over, that are the same at all calls."""
        return {
            key: {
                place for place, known in enumerate(arrays) if len(known) == 1 and None not in known
            }
            for key, arrays in self.arrays.items()
        }

    def widened(self) -> dict[tuple[str, str], Bounds]:
        """The ``ranges``, and where they were left the next ones of a few."""
        ranges = dict(self.ranges)
        for key, (low, high) in self.reached.items():
            least, most = ranges.get(key, (low, high))
            least = least if low >= least else 0 if low >= 0 else -math.inf
            ranges[key] = least, most if high <= most else 1 if high <= 1 else math.inf
        return ranges

    def _identity(self, function: Any) -> Any:
        rows = rows_of(function)
        return rows if rows is not None else plain(function)

    def _key(self, value: Any, handed: list[Any]) -> Any:
        """The part of an argument that a routine is made for. The rest is ``handed`` over."""
        if isinstance(value, Number):
            handed.append(value)
            return "number", value.kind, value.range
        if isinstance(value, View):
            handed.append(value)
            storage = value.storage
            return "view", value.shape, value.strides, storage.integer, repr(value.uniform)
        if isinstance(value, tuple) and not _stands(value):
            return type(value), tuple(self._key(part, handed) for part in value)
        return _fixed(value)

    def _translated(
        self, function: Any, name: str, values: list[Any], fixed: set[int]
    ) -> tuple[Routine, Result]:
        rows = rows_of(function)
        if rows is not None:
            tree, scope = text_function(rows)
            equations: dict[int, str] = {}
            place = f"the text of {name}"
            first = 0
        else:
            inner = plain(function)
            if not inspect.isfunction(inner):
                problem = f"of a model with {name} as a function cannot be exported"
                raise InputError("observer", f"{problem}; give it as text")
            name = inner.__name__
            tree, equations, place, first = source(inner)
            scope = {**inner.__globals__, **inspect.getclosurevars(inner).nonlocals}
        about = (ast.get_docstring(tree) or "").split("\n")[0]
        routine = Routine(self.name(name), about)
        result = Body(self, routine, scope, equations, (place, first), tree).translated(
            values, fixed
        )
        self.routines.append(routine)
        return routine, result


def _stands(value: Any) -> bool:
    """True for arrays that are in the same place for all functions, and named tuples of these."""
    if isinstance(value, tuple):
        return hasattr(value, "_fields") and all(
            _stands(part) or not isinstance(part, Number | View | tuple) for part in value
        )
    inner = isinstance(value, View) and value.storage.where not in ("local", "parameter")
    return inner and not value.terms


def _fixed(value: Any) -> Any:
    """A value that a routine is made for, to be compared."""
    if isinstance(value, View):
        return value.storage.where, value.storage.key, value.start, value.shape, value.strides
    if isinstance(value, tuple):
        return type(value), tuple(map(_fixed, value))
    return (type(value), repr(value)) if isinstance(value, int | float | str | None) else id(value)


@dataclass(frozen=True)
class Result:
    """A constant, the ``parameter`` of that number, or that a call returns what is not known."""

    constant: bool = False
    value: Any = None
    parameter: int | None = None


class Body(Expressions):
    """The statements of a function."""

    def translated(self, values: list[Any], fixed: set[int] | None) -> Result:
        """Translate the function for its arguments, of which those that are ``fixed``, or all of
        them, stand where they are.
        """
        names = [one.arg for one in self.tree.args.args]
        for name, value in zip(names, values, strict=True):
            self.env[name] = value if fixed is None else self._parameter(name, value, fixed)
        with suppress(_OverError):
            self.statements(self.tree.body)
        self.routine.writes -= {one for one in self.routine.writes if one.where == "local"}
        return self._result(fixed is None)

    def _parameter(self, name: str, value: Any, fixed: set[int], whole: str = "") -> Any:
        if isinstance(value, tuple) and not _stands(value):
            names = getattr(value, "_fields", range(len(value)))
            pairs = zip(value, names, strict=True)
            parts = [self._parameter(f"{name}_{i}", p, fixed, whole or name) for p, i in pairs]
            return type(value)(*parts) if hasattr(value, "_fields") else tuple(parts)
        if not isinstance(value, Number | View):
            return value
        self.handed += 1
        if self.handed - 1 in fixed:
            if isinstance(value, View) and not whole:
                self.of.rename(value.storage, name)
            return value
        if isinstance(value, Number):
            variable = Variable(self._named(name), value.kind, parameter=True)
            self.variables[name, value.kind, whole or name] = variable
            self.spelled[name, value.kind] = variable.name
            self.routine.parameters.append(variable)
            return self._number(variable, value.range)
        storage = Storage(
            self._named(name), "parameter", (value.span,), value.storage.integer,
            uniform=value.uniform,
        )  # fmt: skip
        self.routine.parameters.append(storage)
        return View(storage, value.shape, value.strides)

    def _result(self, outermost: bool) -> Result:
        routine, found = self.routine, self.returned
        if not found:
            return Result(constant=True)
        rows = [value if isinstance(value, tuple) else (value,) for _, value in found]
        several = {isinstance(value, tuple) for _, value in found}
        if len({len(row) for row in rows}) > 1 or len(several) > 1:
            self.refuse("results of several kinds")
        first = found[0][1]
        known = not any(isinstance(part, Number) for row in rows for part in row)
        if known and not outermost and len({repr(value) for _, value in found}) == 1:
            return Result(constant=True, value=first)
        alone = not outermost and len(found) == len(routine.body.statements) == 1
        for place, parameter in enumerate(routine.parameters):
            if alone and isinstance(first, Number) and first.text == parameter.name:
                return Result(parameter=place)
        for column in zip(*rows, strict=True):
            numbers = [as_number(value) for value in column]
            kinds = {one.kind for one in numbers}
            routine.bounds.append(reduce(joint, [one.bounds for one in numbers]))
            routine.results.append("double" if "double" in kinds else "int32_t")
        for (jump, _), row in zip(found, rows, strict=True):
            jump.values = tuple(
                double(value) if kind == "double" else as_number(value)
                for value, kind in zip(row, routine.results, strict=True)
            )
        if True in several:
            routine.structure = self.of.structure(routine.results)
        return Result()

    # --- Statements ---

    def statements(self, nodes: list[ast.stmt]) -> None:
        """Translate statements in their order, up to a jump."""
        for place, node in enumerate(nodes):
            self.node = node
            if node.lineno in self.equations:
                lines = [self.equations[node.lineno]]
                while node.lineno - len(lines) in self.equations:
                    lines.insert(0, self.equations[node.lineno - len(lines)])
                self.emit(Comment("; ".join(lines)))
            if isinstance(node, ast.If) and self._skips(node, nodes):
                self._if(node.test, node.body[:-1], nodes[place + 1 :])
                return
            method = getattr(self, f"_do_{type(node).__name__}", None)
            if method is None:
                self.refuse(f"a statement of the kind {type(node).__name__}")
            try:
                method(node)
            except InputError:
                raise
            except _UNKNOWN as error:
                self.refuse(f"{type(error).__name__}: {error}")

    def _skips(self, node: ast.If, nodes: list[ast.stmt]) -> bool:
        """True if a jump in a loop that is run through once leaves out what follows it."""
        jumps = isinstance(node.body[-1], ast.Break | ast.Continue) and not node.orelse
        return bool(jumps and self.once and self.once[-1] is nodes)

    def _do_Expr(self, node: ast.Expr) -> None:
        if isinstance(node.value, ast.Constant):
            return
        self.expression(node.value, whole=True)

    def _do_Return(self, node: ast.Return) -> None:
        value = None if node.value is None else self.expression(node.value, whole=True)
        jump = Jump("return", (), self.routine)
        if value is not None:
            self.returned.append((jump, value))
        self.emit(jump)
        if not self.depth:
            raise _OverError("return")

    def _do_Break(self, node: ast.Break | ast.Continue) -> None:
        word = type(node).__name__.lower()
        if self.once[-1] is None:
            self.emit(Jump(word))
        elif self.depth > self.loop_depth[-1]:
            self.refuse(f"{word} under a condition in a loop that is written out")
        if self.depth == self.loop_depth[-1]:
            raise _OverError(word)

    _do_Continue = _do_Break  # noqa: N815

    def _do_Assign(self, node: ast.Assign) -> None:
        first = node.targets[0]
        several = first.elts if isinstance(first, ast.Tuple) else [first]
        hint = " ".join(one.id if isinstance(one, ast.Name) else "_" for one in several)
        value = self.expression(node.value, True, hint)
        if len(node.targets) > 1 or isinstance(node.targets[0], ast.Tuple):
            value = self._apart(value, node.targets)
        for target in node.targets:
            self._store(target, value)

    def _do_AnnAssign(self, node: ast.AnnAssign) -> None:
        assert node.value is not None
        hint = node.target.id if isinstance(node.target, ast.Name) else ""
        self._store(node.target, self.expression(node.value, whole=True, hint=hint))

    def _apart(self, value: Any, targets: list[ast.expr]) -> Any:
        """Values that the targets, which are assigned one by one, do not change."""
        if isinstance(value, tuple) and not hasattr(value, "_fields"):
            return tuple(self._apart(part, targets) for part in value)
        if not isinstance(value, Number) or (value.level == ATOM and not value.reads):
            return value
        names = {name for target in targets for node in ast.walk(target) for name in stored(node)}
        owned = {one for name in names for one in self._owned(self.env.get(name))}
        entries = any(isinstance(n, ast.Subscript) for t in targets for n in ast.walk(t))
        storages = {key for key in value.reads if isinstance(key, Storage)}
        if value.reads & owned or (entries and (storages or "\x01" in value.text)):
            return self._kept(value, "kept")
        return value

    def _owned(self, value: Any) -> set[Any]:
        if isinstance(value, tuple):
            return set().union(*map(self._owned, value))
        return {*value.reads} if isinstance(value, Number) else set()

    def _store(self, target: ast.expr, value: Any) -> None:
        if isinstance(target, ast.Name):
            self._bind(target.id, value)
        elif isinstance(target, ast.Tuple):
            if not isinstance(value, tuple):
                value = self._entries(value)
            if len(value) != len(target.elts):
                self.refuse("a tuple of another length")
            for each, part in zip(target.elts, value, strict=True):
                self._store(each, part)
        elif isinstance(target, ast.Subscript):
            view = self._entry(target)
            self._write(view, "=", value)
        else:
            self.refuse("an assignment to something else than a name or an entry")

    def _entries(self, value: Any) -> tuple[Any, ...]:
        if not isinstance(value, View):
            self.refuse("a value that is no tuple")
        return tuple(self._read(value.moved(0, i).without(0)) for i in range(value.shape[0]))

    def _bind(self, name: str, value: Any) -> None:
        """Let a name stand for a value: a variable of C if that is no constant."""
        if name == "_":
            return
        known = self.env.get(name)
        moves = isinstance(value, View) and isinstance(known, View) and known != value
        if moves and name in self.loops_change:
            self.refuse(f"{name} stands for another array from one repetition to the next")
        self.env[name] = self._assigned(name, name, value)

    def _assigned(self, name: str, whole: str, value: Any, *, changes: bool = False) -> Any:
        """Bind a value: to a variable, if it is no constant or ``changes`` later."""
        if isinstance(value, tuple) and not hasattr(value, "_fields"):
            parts = enumerate(value)
            return tuple(
                self._assigned(f"{name}_{i}", whole, part, changes=changes) for i, part in parts
            )
        again = changes or (self.depth > 0 and whole in self.again)
        if isinstance(value, bool | int | float) and again:
            value = number(value)
        if isinstance(value, View):
            terms = tuple((self._steady(index), step) for index, step in value.terms)
            return replace(value, terms=terms)
        if not isinstance(value, Number):
            return value
        if (name, "double", whole) in self.variables and value.kind == "int32_t":
            value = value if (name, value.kind, whole) in self.variables else double(value)
        variable = self._variable(name, value.kind, whole)
        if value.text != variable.name:
            self.emit(Assign(variable, variable.name, "=", value.text, value.reads))
        key = self.routine.name, name
        reached = self.of.reached[key] = joint(self.of.reached.get(key, value.bounds), value.bounds)
        bounds = joint(self.of.ranges.get(key, reached), reached) if changes else value.bounds
        return self._number(variable, bounds)

    def _steady(self, index: Number) -> Number:
        """An index of a view that stays what it is."""
        moving = {one for key, one in self.variables.items() if key[2] in self.again}
        stays = all(isinstance(one, Variable) and one not in moving for one in index.reads)
        return index if stays else self._kept(index, "place")

    def _do_AugAssign(self, node: ast.AugAssign) -> None:
        if type(node.op) not in ARITHMETIC:
            self.refuse("such an operator")
        sign = ARITHMETIC[type(node.op)][0]
        value = self.expression(node.value)
        if isinstance(node.target, ast.Subscript):
            view = self._entry(node.target)
            if sign not in ("+", "-", "*", "/") or isinstance(node.op, ast.FloorDiv):
                self.refuse("such a change of an entry")
            self._write(view, f"{sign}=", value)
            return
        assert isinstance(node.target, ast.Name)
        name = node.target.id
        known = self.expression(ast.Name(name))
        result = self._joined(node.op, known, value)
        if isinstance(known, Number) and known.text in self.open_loops:
            self.refuse(f"a change of {name}, the variable of a loop")
        simple = isinstance(known, Number) and isinstance(result, Number)
        if simple and result.kind == known.kind and sign in ("+", "-", "*", "/"):
            (variable,) = known.reads
            text = double(value).text if known.kind == "double" else as_number(value).text
            reads = result.reads
            self.emit(Assign(variable, known.text, f"{sign}=", text, reads))
            self.env[name] = self._assigned(name, name, replace(known, bounds=result.bounds))
        else:
            self._bind(name, result)

    # --- Conditions and loops ---

    def _do_If(self, node: ast.If) -> None:
        self._if(node.test, node.body, node.orelse)

    def _if(self, test: ast.expr, body: list[ast.stmt], orelse: list[ast.stmt]) -> None:
        condition = self.expression(test, whole=True)
        if not isinstance(condition, Number):
            self.statements(body if condition else orelse)
            return
        self._demote([*body, *orelse])
        blocks, envs, before = [], [], dict(self.env)
        for nodes in (body, orelse):
            blocks.append(Block())
            self.env = dict(before)
            self.depth += 1
            over = False
            if nodes is body:
                self._guard(test)
            with self.inside(blocks[-1]):
                try:
                    self.statements(nodes)
                except _OverError:
                    over = True
            self.depth -= 1
            if not over and not any(isinstance(one, Jump) for one in blocks[-1].statements):
                envs.append(self.env)
        self.emit(If(condition, *blocks))
        self.env = self._merged(before, envs)

    def _guard(self, test: ast.expr) -> None:
        """Note where a whole number is above zero."""
        match test:
            case ast.Compare(ast.Name(name), [ast.Gt()], [ast.Constant(0)]):
                known = self.env.get(name)
                if isinstance(known, Number) and known.kind == "int32_t":
                    self.env[name] = replace(known, bounds=(1.0, max(1.0, known.bounds[1])))

    def _merged(self, before: dict[str, Any], after: list[dict[str, Any]]) -> dict[str, Any]:
        """The names after branches: those that stand for the same in all of them."""
        if not after:
            return before
        first, *rest = after
        merged = {
            name: reduce(_in_either, [env[name] for env in rest], value)
            for name, value in first.items() if all(
                name in env and _same(env[name], value) for env in rest
            )
        }  # fmt: skip
        # What is known inside alone is another variable where it is assigned again.
        gone = {name for env in after for name in env} - merged.keys() - before.keys()
        for key in [key for key in self.variables if key[2] in gone]:
            del self.variables[key]
        return merged

    def _demote(self, nodes: Iterable[ast.AST]) -> None:
        """Make variables of what statements under conditions assign."""
        for name in sorted(changed(nodes) & self.env.keys()):
            self.env[name] = self._assigned(name, name, self.env[name], changes=True)

    def _do_For(self, node: ast.For) -> None:
        if node.orelse:
            self.refuse("else of a loop")
        over = self._range(node.iter)
        if over is None:
            values = self.expression(node.iter)
            if isinstance(values, tuple):
                self._unrolled(node, list(values))
                return
            if isinstance(values, View) and values.shape[0] == 0:
                return
            if not isinstance(values, View) or not isinstance(node.target, ast.Name):
                self.refuse("a loop over something else than a range, a tuple or a vector")
            self._loop(node, (0, values.shape[0], 1), values)
            return
        start, stop, step = over
        assert isinstance(node.target, ast.Name)
        if isinstance(start, int) and isinstance(stop, int):
            places = range(start, stop, step)
            alone = len(places) == 1 and not jumps(node)
            if (
                not places
                or alone
                or self._is_short(node, len(places))
                or self._needs_constant(node, len(places))
            ):
                self._unrolled(node, list(places))
                if len(places) > 1:
                    self.env = {name: v for name, v in self.env.items() if name != node.target.id}
                return
        self._loop(node, over, None)

    def _is_short(self, loop: ast.For, count: int) -> bool:
        """True for loops of a few assignments, and of one for each place of a tuple."""
        inside = [one for one in ast.walk(loop) if isinstance(one, ast.stmt) and one is not loop]
        if any(isinstance(one, ast.Expr | ast.Break | ast.Continue) for one in inside):
            return False
        if count <= _FEW:
            return count * len(inside) <= _SHORT
        assert isinstance(loop.iter, ast.Call)
        match loop.iter.args:
            case [ast.Call(func=ast.Name(id="len"), args=[values])] if len(inside) == 1:
                return count <= _TUPLE and isinstance(self.expression(values), tuple)
        return False

    def _range(self, node: ast.expr) -> tuple[Any, Any, int] | None:
        if not isinstance(node, ast.Call) or not isinstance(node.func, ast.Name):
            return None
        if self.scope.get("range", range) is not range or node.func.id != "range":
            return None
        given = [self.expression(argument) for argument in node.args]
        start, stop = (0, given[0]) if len(given) == 1 else given[:2]
        step = given[2] if len(given) > 2 else 1
        if not isinstance(step, int) or step not in (1, -1):
            self.refuse("a range with another step than 1 or -1")
        return start, stop, step

    def _needs_constant(self, node: ast.For, count: int) -> bool:
        """True for loops over rows, and those that read a table of places at their variable."""
        assert isinstance(node.target, ast.Name)
        name = node.target.id
        if any(isinstance(one, ast.Name) and one.id == "poll" for one in ast.walk(node)):
            return True
        jumps = any(isinstance(one, ast.Break | ast.Continue) for one in ast.walk(node))
        if jumps or count > _MOST_UNROLLED:
            return False
        for one in ast.walk(node):
            if not isinstance(one, ast.Subscript) or not isinstance(one.value, ast.Attribute):
                continue
            if any(isinstance(n, ast.Name) and n.id == name for n in ast.walk(one.slice)):
                table = self._known(one.value)
                if isinstance(table, View) and table.storage.integer:
                    return table.storage.data is not None
        return False

    def _known(self, node: ast.expr) -> Any:
        try:
            return self.expression(node)
        except (KeyError, InputError, AttributeError):
            return None

    def _unrolled(self, node: ast.For, values: list[Any]) -> None:
        for value in values:
            self.once.append(node.body if len(values) == 1 else [])
            self.loop_depth.append(self.depth)
            if isinstance(node.target, ast.Name) and isinstance(value, int):
                self.env[node.target.id] = value
            else:
                self._store(node.target, value)
            try:
                self.statements(node.body)
            except _OverError as jump:
                if jump.word == "return":
                    raise jump
                if jump.word == "break":
                    break
            finally:
                self.once.pop()
                self.loop_depth.pop()

    def _loop(self, node: ast.For, over: tuple[Any, Any, int], vector: View | None) -> None:
        assert isinstance(node.target, ast.Name)
        start, stop, step = over
        self._demote(node.body)
        once = isinstance(start, int) and isinstance(stop, int) and stop - start == step
        wanted = "i" if vector is not None or node.target.id == "_" else node.target.id
        index = Variable(self._loop_name(wanted), "int32_t", parameter=True)
        first, last = as_number(start), as_number(stop)
        if last.reads & set().union(*(self._owned(self.env.get(n)) for n in changed(node.body))):
            last = self._kept(last, "stop")
        bounds = (first.bounds[0], last.bounds[1] - 1)
        if step < 0:
            bounds = (last.bounds[0] + 1, first.bounds[1])
        here = self._number(index, bounds)
        head = (
            f"int32_t {index.name} = {first.text}; {index.name} {'<' if step > 0 else '>'} "
            f"{last.within(SUM)}; {'++' if step > 0 else '--'}{index.name}"
        )
        before, around, block = dict(self.env), self.loops_change, Block()
        if not once:
            views = {name for name, value in before.items() if isinstance(value, View)}
            self.loops_change = around | frozenset(views & changed(node.body))
        self.depth += 1
        self.once.append(None)
        self.loop_depth.append(self.depth)
        self.open_loops.append(index.name)
        with self.inside(block), suppress(_OverError):
            value: Any = start if once else here
            if vector is not None:
                value = self._read(vector.moved(0, value).without(0))
                self._bind(node.target.id, value)
            else:
                self.env[node.target.id] = value
            self.statements(node.body)
        self.open_loops.pop()
        self.loop_depth.pop()
        self.once.pop()
        self.depth -= 1
        self.loops_change = around
        for name in sorted(changed(node.body) & before.keys()):
            if not once and not _same(before[name], self.env.get(name)):
                self.refuse(f"{name}, which stands for something else at each repetition")
        self.emit(For(head, first.reads | last.reads, block))
        self.env = self._merged(before, [before, self.env])

    def _loop_name(self, wanted: str) -> str:
        """A name that loops after each other share."""
        if wanted not in self.loop_names or self.loop_names[wanted] in self.open_loops:
            name = self._named(wanted)
            self.loop_names.setdefault(wanted, name)
            return name
        return self.loop_names[wanted]


def _in_either(left: Any, right: Any) -> Any:
    """A value that stands for the same as another one, wherever one of them is."""
    if isinstance(left, tuple):
        parts = list(map(_in_either, left, right))
        return type(left)(*parts) if hasattr(left, "_fields") else tuple(parts)
    if isinstance(left, Number):
        return replace(left, bounds=joint(left.bounds, right.bounds))
    return left


def _same(left: Any, right: Any) -> bool:
    """True if two values stand for the same in C."""
    if isinstance(left, Number) and isinstance(right, Number):
        return (left.text, left.kind) == (right.text, right.kind)
    if isinstance(left, tuple) and isinstance(right, tuple) and len(left) == len(right):
        return all(map(_same, left, right))
    if type(left) is not type(right):
        return False
    return left is right or (isinstance(left, View | int | float | str) and left == right)
