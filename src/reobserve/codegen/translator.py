"""Kernels in C: functions of the subset of Python that they are written in, statement by statement.

A function is translated for the arguments that it is called with. Shapes of arrays, functions,
None and other constants are known, and statements that depend on them alone are decided; named
tuples and their arrays stand where they are, other arrays are handed over by pointers. What is not
known here is refused, with its file and line.
"""

from __future__ import annotations

import ast
import builtins
import inspect
import math
import operator
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import dataclass, replace
from functools import cache
from textwrap import dedent
from typing import Any, NoReturn

import numpy as np

from reobserve.codegen.statements import (
    Assign,
    Block,
    Call,
    Comment,
    For,
    If,
    Invoke,
    Jump,
    Routine,
    Statement,
    Table,
)
from reobserve.codegen.values import (
    AND,
    ATOM,
    COMPARED,
    OR,
    PRODUCT,
    SIGN,
    SUM,
    TERNARY,
    Number,
    Storage,
    Variable,
    View,
    double,
    negated,
    number,
    row_strides,
    union,
)
from reobserve.core.direct_call import call as direct_call
from reobserve.core.errors import InputError
from reobserve.systems.text_functions import compiled_rows

_MOST_UNROLLED = 2000

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

_MATH = frozenset(
    """acos acosh asin asinh atan atan2 atanh cos cosh erf exp expm1 floor log log1p sin sinh sqrt
    tan tanh isfinite isnan isinf""".split()  # noqa: SIM905
)

_ARITHMETIC: dict[type, tuple[str, int, Any]] = {
    ast.Add: ("+", SUM, operator.add), ast.Sub: ("-", SUM, operator.sub),
    ast.Mult: ("*", PRODUCT, operator.mul), ast.Div: ("/", PRODUCT, operator.truediv),
    ast.FloorDiv: ("/", PRODUCT, operator.floordiv), ast.Mod: ("%", PRODUCT, operator.mod),
    ast.Pow: ("", PRODUCT, operator.pow), ast.BitAnd: ("&&", AND, operator.and_),
}  # fmt: skip

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


class _OverError(Exception):
    """The statements behind one are never reached: it is a jump that no condition guards."""

    def __init__(self, word: str) -> None:
        super().__init__(word)
        self.word = word


@cache
def _source(function: Callable[..., Any]) -> tuple[ast.FunctionDef, dict[int, str], str, int]:
    """The tree of a function, its equations by the lines below them, its file and first line."""
    lines, first = inspect.getsourcelines(function)
    text = dedent("".join(lines))
    tree = ast.parse(text).body[0]
    assert isinstance(tree, ast.FunctionDef)
    equations, own = {}, [line.strip() for line in text.splitlines()]
    for place, line in enumerate(own):
        if line.startswith("# ") and "=" in line and "numba" not in line:
            equations[place + 2] = line[2:].replace("*/", "* /")
    return tree, equations, inspect.getsourcefile(function) or "", first


def plain(function: Any) -> Any:
    """The Python function behind a kernel or a pointer, or the function itself."""
    names = ("source",) if hasattr(function, "pickled") else ("py_func", "_function", "_pyfunc")
    return next((getattr(function, name) for name in names if hasattr(function, name)), function)


class Translator:
    """Functions of C, made as they are called, the outermost first.

    ``view`` finds the view of an array of Python. ``alone`` are the arguments of functions that are
    the same array at all calls, as `alone` found them before: they stand where they are.
    """

    def __init__(self, view: Callable[[Any, str], View], alone: Mapping[Any, set[int]]) -> None:
        self.view, self.given = view, alone
        self.arrays: dict[Any, list[set[Any]]] = {}  # that functions are called with
        self.routines: list[Routine] = []
        self.names: set[str] = {*RESERVED}  # of functions and constants
        self.locals: set[str] = set()  # of all functions
        self.constants: list[Storage] = []
        self.helpers: dict[str, str] = {}  # types and functions of C beside the routines
        self._made: dict[Any, tuple[Routine, Any]] = {}

    def entry(self, function: Any, arguments: tuple[Any, ...]) -> Routine:
        """The routine of the outermost function, whose arguments stand where they are."""
        tree, equations, file, first = _source(function)
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
        handed: list[Any] = []
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

    def _identity(self, function: Any) -> Any:
        rows = _rows_of(function)
        return rows if rows is not None else plain(function)

    def _key(self, value: Any, handed: list[Any]) -> Any:
        """The part of an argument that a routine is made for. The rest is ``handed`` over."""
        if isinstance(value, Number):
            handed.append(value)
            return "number", value.kind, value.natural
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
        rows = _rows_of(function)
        if rows is not None:
            tree, scope = _text_function(rows)
            equations: dict[int, str] = {}
            place = f"the text of {name}"
            first = 0
        else:
            inner = plain(function)
            if not inspect.isfunction(inner):
                problem = f"of a model with {name} as a function cannot be exported"
                raise InputError("observer", f"{problem}; give it as text")
            name = inner.__name__
            tree, equations, place, first = _source(inner)
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


def _rows_of(function: Any) -> tuple[str, ...] | None:
    """The code of the entries of a function that was compiled of text."""
    recipe = getattr(function, "pickled", None)
    if isinstance(recipe, tuple) and recipe[0] is compiled_rows:
        return tuple(recipe[1][0])
    return None


@cache
def _text_function(rows: tuple[str, ...]) -> tuple[ast.FunctionDef, dict[str, Any]]:
    body = "".join(f"    out[{i}] = {row}\n" for i, row in enumerate(rows))
    tree = ast.parse(f"def field(x, parameters, out):\n{body}").body[0]
    assert isinstance(tree, ast.FunctionDef)
    return tree, {"math": math}


@dataclass(frozen=True)
class Result:
    """A constant, the ``parameter`` of that number, or that a call returns what is not known."""

    constant: bool = False
    value: Any = None
    parameter: int | None = None


class Body:
    """One function: its names and what they stand for, and the block that is being written."""

    def __init__(
        self, of: Translator, routine: Routine, scope: dict[str, Any], equations: dict[int, str],
        place: tuple[str, int], tree: ast.FunctionDef,
    ) -> None:  # fmt: skip
        self.of, self.routine, self.scope, self.tree = of, routine, scope, tree
        self.equations, self.place = equations, place
        self.env: dict[str, Any] = {}
        self.block, self.depth = routine.body, 0  # of conditions and loops around
        self.taken: set[str] = set()
        self.variables: dict[tuple[str, str, str], Variable] = {}  # by name, kind and whole
        self.spelled: dict[tuple[str, str], str] = {}
        counts = [name for node in ast.walk(tree) for name in _stored(node)]
        counts += [one.arg for one in tree.args.args]
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

    # --- The whole ---

    def translated(self, values: list[Any], fixed: set[int] | None) -> Result:
        """Translate the function for its arguments, of which those that are ``fixed``, or all of
        them, stand where they are.
        """
        names = [one.arg for one in self.tree.args.args]
        defaults = dict(zip(names[::-1], self.tree.args.defaults[::-1], strict=False))
        for place, name in enumerate(names):
            value = values[place] if place < len(values) else self.expression(defaults[name])
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
            return self._number(variable, value.natural)
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
            numbers = [_as_number(value) for value in column]
            kinds = {one.kind for one in numbers}
            routine.results.append("double" if "double" in kinds else "int32_t")
        for (jump, _), row in zip(found, rows, strict=True):
            jump.values = tuple(
                double(value) if kind == "double" else _as_number(value)
                for value, kind in zip(row, routine.results, strict=True)
            )
        if True in several:
            routine.structure = self.of.structure(routine.results)
        return Result()

    def refuse(self, what: str) -> NoReturn:
        """Refuse what is not known here, with its place."""
        file, first = self.place
        line = first + getattr(self.node, "lineno", 1) - 1
        raise InputError("observer", f"cannot be exported: {file}, line {line}: {what}")

    def _named(self, name: str) -> str:
        return self.of.local(name, self.taken)

    def _number(self, variable: Variable, natural: bool = False) -> Number:
        return Number(variable.name, variable.kind, ATOM, frozenset({variable}), natural)

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
            method(node)

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
        if isinstance(first, ast.Tuple) and isinstance(node.value, ast.Tuple):
            value: Any = self._several(node.value, True, [ast.unparse(one) for one in first.elts])
        else:
            hint = first.id if isinstance(first, ast.Name) else ""
            value = self.expression(node.value, whole=True, hint=hint)
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
        names = {name for target in targets for node in ast.walk(target) for name in _stored(node)}
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

    def _kept(self, value: Number, name: str) -> Number:
        """A value in a variable of its own."""
        variable = Variable(self._named(name), value.kind)
        self.emit(Assign(variable, variable.name, "=", value.text, value.reads))
        return self._number(variable, value.natural)

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

    def _write(self, view: View, sign: str, value: Any) -> None:
        storage = view.storage
        if view.shape or storage.where in ("constant", "given"):
            self.refuse("an assignment to what is no entry of an array that is written")
        if storage.where != "local":
            self.routine.writes.add(storage)
        number_ = _as_number(value) if storage.integer else double(value)
        entry = view.entry()
        if sign == "=" and number_.text == entry.text:
            return
        reads = (entry.reads - {storage}) | number_.reads | ({storage} if sign != "=" else set())
        self.emit(Assign(storage, entry.text, sign, number_.text, frozenset(reads)))

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
        changes = changes or (self.depth > 0 and whole in self.again)
        if isinstance(value, bool | int | float) and changes:
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
        return self._number(variable, value.natural and not changes)

    def _steady(self, index: Number) -> Number:
        """An index of a view that stays what it is."""
        moving = {one for key, one in self.variables.items() if key[2] in self.again}
        stays = all(isinstance(one, Variable) and one not in moving for one in index.reads)
        return index if stays else self._kept(index, "place")

    def _variable(self, name: str, kind: str, whole: str = "") -> Variable:
        key = (name, kind, whole or name)
        if key not in self.variables:
            if key[:2] not in self.spelled:
                self.spelled[key[:2]] = self._named(name)
            self.variables[key] = Variable(self.spelled[key[:2]], kind)
        return self.variables[key]

    def _do_AugAssign(self, node: ast.AugAssign) -> None:
        sign = _ARITHMETIC[type(node.op)][0]
        value = self.expression(node.value)
        if isinstance(node.target, ast.Subscript):
            view = self._entry(node.target)
            if sign not in ("+", "-", "*", "/"):
                self.refuse("such a change of an entry")
            self._write(view, f"{sign}=", value)
            return
        assert isinstance(node.target, ast.Name)
        name = node.target.id
        known = self.env[name]
        result = self._joined(node.op, known, value)
        if isinstance(known, Number) and known.text in self.open_loops:
            self.refuse(f"a change of {name}, the variable of a loop")
        simple = isinstance(known, Number) and isinstance(result, Number)
        if simple and result.kind == known.kind and sign in ("+", "-", "*", "/"):
            (variable,) = known.reads
            text = double(value).text if known.kind == "double" else _as_number(value).text
            reads = result.reads
            self.emit(Assign(variable, known.text, f"{sign}=", text, reads))
            self.env[name] = Number(known.text, known.kind, ATOM, known.reads)
        else:
            self._bind(name, result)

    def _entry(self, node: ast.Subscript) -> View:
        view = self.expression(node.value)
        if not isinstance(view, View):
            self.refuse("an assignment to an entry of what is no array")
        return self._part(view, node.slice)

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

    def _merged(self, before: dict[str, Any], after: list[dict[str, Any]]) -> dict[str, Any]:
        """The names after branches: those that stand for the same in all of them."""
        if not after:
            return before
        first, *rest = after
        merged = {
            name: value for name, value in first.items()
            if all(name in env and _same(env[name], value) for env in rest)
        }  # fmt: skip
        # What is known inside alone is another variable where it is assigned again.
        gone = {name for env in after for name in env} - merged.keys() - before.keys()
        for key in [key for key in self.variables if key[2] in gone]:
            del self.variables[key]
        return merged

    def _demote(self, nodes: Iterable[ast.AST]) -> None:
        """Make variables of what statements under conditions assign."""
        for name in sorted(_changed(nodes) & self.env.keys()):
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
        if isinstance(start, int) and isinstance(stop, int):
            places = range(start, stop, step)
            alone = len(places) == 1 and not _jumps(node)
            if not places or alone or self._needs_constant(node, len(places)):
                self._unrolled(node, list(places))
                return
        self._loop(node, over, None)

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
            self._store(node.target, value)
            try:
                self.statements(node.body)
            except _OverError as jump:
                if jump.word == "return":
                    raise
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
        first, last = _as_number(start), _as_number(stop)
        natural = first.natural if step > 0 else last.natural or stop == -1
        here = Number(index.name, "int32_t", ATOM, frozenset({index}), natural)
        head = (
            f"int32_t {index.name} = {first.text}; {index.name} {'<' if step > 0 else '>'} "
            f"{last.within(SUM)}; {'++' if step > 0 else '--'}{index.name}"
        )
        before, changed, block = dict(self.env), self.loops_change, Block()
        if not once:
            views = {name for name, value in before.items() if isinstance(value, View)}
            self.loops_change = changed | frozenset(views & _changed(node.body))
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
        self.loops_change = changed
        for name in sorted(_changed(node.body) & before.keys()):
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

    # --- Expressions ---

    def expression(self, node: ast.expr, whole: bool = False, hint: str = "") -> Any:
        """The value of an expression, which as a ``whole`` may be a call that writes arrays."""
        if isinstance(node, ast.Call):
            return self._call(node, whole, hint)
        if isinstance(node, ast.BoolOp):
            return self._both(node, whole)
        if isinstance(node, ast.UnaryOp):
            return self._signed(node, whole)
        if isinstance(node, ast.Tuple):
            return self._several(node, whole, [""] * len(node.elts))
        if isinstance(node, ast.Compare):
            return self._compare(node, whole)
        method = getattr(self, f"_of_{type(node).__name__}", None)
        if method is None:
            self.refuse(f"an expression of the kind {type(node).__name__}")
        return method(node)

    def _of_Constant(self, node: ast.Constant) -> Any:
        return node.value

    def _of_Name(self, node: ast.Name) -> Any:
        if node.id in self.env:
            return self.env[node.id]
        if node.id in self.scope:
            return self.of.value(self.scope[node.id], node.id)
        if not hasattr(builtins, node.id):
            self.refuse(f"{node.id}, which stands for several things here")
        return getattr(builtins, node.id)

    def _of_Attribute(self, node: ast.Attribute) -> Any:
        value = self.expression(node.value)
        if isinstance(value, Number) or not hasattr(value, node.attr):
            self.refuse(f"the attribute {node.attr}")
        if isinstance(value, View) and node.attr != "shape":
            self.refuse(f"the attribute {node.attr} of an array")
        found = getattr(value, node.attr)
        return found.item() if isinstance(found, np.generic) else found

    def _several(self, node: ast.Tuple, whole: bool, hints: list[str]) -> tuple[Any, ...]:
        values: list[Any] = []
        for each, hint in zip(node.elts, hints, strict=False):
            # What a call writes must not have been read before it.
            read = [v for v in values if isinstance(v, Number) and v.reads]
            name = hint if hint.isidentifier() and hint != "_" else ""
            values.append(self.expression(each, whole and not read, name))
        return tuple(values)

    def _of_Subscript(self, node: ast.Subscript) -> Any:
        value = self.expression(node.value)
        if isinstance(value, tuple):
            if isinstance(node.slice, ast.Slice):
                return tuple(value)[self._slice(node.slice, len(value))]
            index = self.expression(node.slice)
            if isinstance(index, int):
                return value[index]
            return self._chosen(value, index)
        if not isinstance(value, View):
            self.refuse("an entry of what is no array and no tuple")
        return self._read(self._part(value, node.slice))

    def _chosen(self, values: tuple[Any, ...], index: Any) -> Number:
        """An entry of a tuple of numbers at a place that is not known here."""
        if not all(isinstance(each, Number | int | float) for each in values):
            self.refuse("an entry of a tuple that holds no numbers, at a place that varies")
        if all(isinstance(each, int | float) for each in values):
            storage = self.of.constant("choices", np.array(values, dtype=np.float64))
        else:
            storage = Storage(self._named("choices"), "local", (len(values),))
            self.emit(Table(storage))
            for place, each in enumerate(values):
                self._write(storage.view().moved(0, place).without(0), "=", each)
        return storage.view().moved(0, index).without(0).entry()

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
            index = self.expression(each)
            if isinstance(index, int) and index < 0:
                index += view.shape[axis]
            if isinstance(index, Number) and index.kind != "int32_t":
                self.refuse("an index that is no whole number")
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
            shape[axis] = count
        else:
            span = self._slice(node, view.shape[axis])
            start, shape[axis] = span.start, max(span.stop - span.start, 0)
        return replace(view.moved(axis, start), shape=tuple(shape))

    def _signed(self, node: ast.UnaryOp, whole: bool) -> Any:
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
        return Number(f"-{text}", value.kind, SIGN, value.reads)

    def _both(self, node: ast.BoolOp, whole: bool) -> Any:
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
            if any(isinstance(one, Invoke) for one in block.statements):
                kept = self._variable("both" if conjunction else "either", "int32_t")
                self.emit(Assign(kept, kept.name, "=", value.text, value.reads))
                both, rest = self._number(kept, natural=True), _as_number(more)
                assign = Assign(kept, kept.name, "=", rest.text, rest.reads)
                test = both if conjunction else negated(both)
                self.emit(If(test, Block([*block.statements, assign]), Block()))
                value = both
                continue
            self.block.statements += block.statements
            if not isinstance(more, Number):
                if bool(more) is not conjunction:
                    return bool(more)
                continue
            sign, level = ("&&", AND) if conjunction else ("||", OR)
            parts = [p.within(COMPARED if p.level != level else level) for p in (value, more)]
            text = f" {sign} ".join(parts)
            value = Number(text, "int32_t", level, value.reads | more.reads, True)
        return value

    def _compare(self, node: ast.Compare, whole: bool) -> Any:
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
                found = Number(text, "int32_t", AND, found.reads | one.reads, True)
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
                if isinstance(one, Number) and isinstance(found, Number):
                    text = f"{found.text} || {one.text}"
                    found = Number(text, "int32_t", OR, found.reads | one.reads, True)
                elif one is not False:
                    found = one if found is False else found
            return found
        text, operation = _COMPARED[type(sign)]
        if not isinstance(left, Number) and not isinstance(right, Number):
            return bool(operation(left, right))
        first, second = self._alike(left, right)
        text = f"{first.within(SUM)} {text} {second.within(SUM)}"
        return Number(text, "int32_t", COMPARED, first.reads | second.reads, True)

    def _alike(self, left: Any, right: Any) -> tuple[Number, Number]:
        """Two numbers of one kind."""
        for value in (left, right):
            if not isinstance(value, Number | int | float):
                self.refuse("arithmetic of what are no numbers")
        first, second = _as_number(left), _as_number(right)
        if first.kind != second.kind:
            return double(left), double(right)
        return first, second

    def _of_IfExp(self, node: ast.IfExp) -> Any:
        test = self.expression(node.test)
        if not isinstance(test, Number):
            return self.expression(node.body if test else node.orelse)
        first, second = self._alike(self.expression(node.body), self.expression(node.orelse))
        parts = [one.within(OR) for one in (first, second)]
        condition = test.text if test.level == ATOM else f"({test.text})"
        reads = test.reads | first.reads | second.reads
        natural = first.natural and second.natural
        text = f"{condition} ? {parts[0]} : {parts[1]}"
        return Number(text, first.kind, TERNARY, reads, natural)

    def _of_BinOp(self, node: ast.BinOp) -> Any:
        left, right = self.expression(node.left), self.expression(node.right)
        return self._joined(node.op, left, right)

    def _joined(self, sign: ast.operator, left: Any, right: Any) -> Any:
        if type(sign) not in _ARITHMETIC:
            self.refuse("such an operator")
        text, level, operation = _ARITHMETIC[type(sign)]
        if not isinstance(left, Number) and not isinstance(right, Number):
            try:
                return operation(left, right)
            except ZeroDivisionError:
                with np.errstate(all="ignore"):
                    return float(operation(np.float64(left), right))
        if isinstance(sign, ast.Pow):
            return self._power(left, right)
        first, second = self._alike(left, right)
        whole = first.kind == "int32_t"
        if isinstance(sign, ast.Div):
            first, second = double(left), double(right)
        elif text in ("/", "%") and not (whole and first.natural and second.natural):
            self.refuse("a division with remainder of what may be negative or no whole number")
        natural = whole and text != "-" and first.natural and second.natural
        reads = first.reads | second.reads
        joined = f"{first.within(level)} {text} {second.within(level + 1)}"
        return Number(joined, first.kind, level, reads, natural)

    def _power(self, base: Any, exponent: Any) -> Number:
        """A power, of a whole exponent by squaring, as numba compiles it."""
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

    def _call(self, node: ast.Call, whole: bool, hint: str) -> Any:
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
        if function is np.empty:
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
                natural = first.natural and second.natural
                value = Number(text, "int32_t", TERNARY, reads, natural)
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
        if name in ("abs", "absolute", "fabs") and _as_number(given[0]).kind == "double":
            name = "fabs"
        elif name == "float":
            return double(given[0])
        elif name not in _MATH and name != "pow":
            self.refuse(f"the function {name}")
        parts = [double(value) for value in given]
        text = f"{name}({', '.join(part.text for part in parts)})"
        reads = union(part.reads for part in parts)
        if name.startswith("is"):
            return Number(text, "int32_t", ATOM, reads, True)
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
        if not callable(function) and not hasattr(function, "pickled"):
            self.refuse(f"a call of {name or 'what is no function'}")
        node = self.node
        routine, result, handed = self.of.called(function, name, given)
        self.node = node
        if result.parameter is not None:
            return handed[result.parameter]
        call = Call(routine, handed)
        written = self._written(call)
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
            return Number(call.token, routine.results[0], ATOM, reads)
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
            return self._number(target)
        return tuple(
            Number(f"{target.name}.v{place}", each, ATOM, frozenset({target}))
            for place, each in enumerate(routine.results)
        )

    def _written(self, call: Call) -> set[Storage]:
        """The arrays of this function, and of structures, that a call writes to."""
        pairs = zip(call.routine.parameters, call.arguments, strict=True)
        arrays = {p: a.storage for p, a in pairs if isinstance(a, View)}
        written = {arrays.get(one, one) for one in call.routine.writes}
        if any(one.where in ("constant", "given") for one in written):
            self.refuse(f"a call of {call.routine.name} that writes to a constant")
        return written


def _jumps(loop: ast.For) -> bool:
    """True if a loop is left or gone on with elsewhere than by a condition among its statements."""
    inner = [one for one in ast.walk(loop) if isinstance(one, ast.For) and one is not loop]
    own = [one for one in ast.walk(loop) if isinstance(one, ast.Break | ast.Continue)]
    own = [one for one in own if not any(one in ast.walk(other) for other in inner)]
    direct = [one.body[-1] for one in loop.body if isinstance(one, ast.If) and not one.orelse]
    return any(one not in (*direct, *loop.body) for one in own)


def _changed(nodes: Iterable[ast.AST]) -> set[str]:
    """The names that statements give a value, otherwise than as the variable of a loop."""
    inside = [inner for node in nodes for inner in ast.walk(node)]
    loops = [one.target for one in inside if isinstance(one, ast.For)]
    return {name for one in inside if one not in loops for name in _stored(one)}


def _stored(node: ast.AST) -> Iterator[str]:
    """The name that a node gives a value."""
    if isinstance(node, ast.Name) and isinstance(node.ctx, ast.Store):
        yield node.id


def _as_number(value: Any) -> Number:
    return value if isinstance(value, Number) else number(value)


def _same(left: Any, right: Any) -> bool:
    """True if two values stand for the same in C."""
    if isinstance(left, Number) and isinstance(right, Number):
        return (left.text, left.kind) == (right.text, right.kind)
    if isinstance(left, tuple) and isinstance(right, tuple) and len(left) == len(right):
        return all(map(_same, left, right))
    if type(left) is not type(right):
        return False
    return left is right or (isinstance(left, View | int | float | str) and left == right)
