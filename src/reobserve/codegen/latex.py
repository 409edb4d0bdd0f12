"""A program as equations in LaTeX, with its constants as matrices and its gains as tables."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from functools import singledispatch

import numpy as np
from numpy.typing import NDArray

from reobserve.codegen.expressions import (
    Call,
    Expression,
    Name,
    Number,
    Outer,
    Product,
    Quotient,
    Scaled,
    Sum,
    Transposed,
)
from reobserve.codegen.statements import (
    Advance,
    Apply,
    Assign,
    Cholesky,
    Constant,
    ForEach,
    Function,
    Program,
    SolveLower,
    SolveRight,
    Statement,
    When,
    estimate_name,
)
from reobserve.estimation.designs.design import Design
from reobserve.estimation.designs.signals import Signal
from reobserve.plotting.latex import booktabs, latex

Array = NDArray[np.float64]

_DOCUMENT = r"""% {title}: a document that compiles as it stands.
\documentclass{{article}}
\usepackage[a4paper, margin=2cm]{{geometry}}
\usepackage{{amsmath}}
\usepackage{{booktabs}}
\usepackage{{graphicx}}
\allowdisplaybreaks
\begin{{document}}

\section*{{{title}}}

\begin{{sloppypar}}
{signals}
\end{{sloppypar}}

\paragraph{{At row $k$,}} with $\leftarrow$ for what becomes of a value,
\begin{{align*}}
{equations}
\end{{align*}}
{notes}
{constants}
{tables}
\end{{document}}
"""

_WIDEST = 6  # columns of a matrix among equations
_AS_WIDE_AS_FITS = r"\resizebox{\ifdim\width>\linewidth\linewidth\else\width\fi}{!}"


def document(program: Program, design: Design) -> str:
    """The text of a document of its own."""
    lines = [*_functions(program), *_all(program, program.body, 0), *_told_estimates(program)]
    notes = ["Counters and the row before are kept from row to row.", *program.notes]
    constants = [
        f"{_symbol(program, name)} &= {_matrix(part.values)}"
        for name, part in program.constants.items()
        if not _tabulated(part)
    ]
    shown = "\n\\begin{align*}\n" + " \\\\\n".join(constants) + "\n\\end{align*}\n"
    return _DOCUMENT.format(
        title=program.title, signals=_signals(program, design), equations=" \\\\\n".join(lines),
        notes=" ".join(one.rstrip(".") + "." for one in notes),
        constants=shown if constants else "",
        tables="\n".join(
            table
            for name, part in program.constants.items()
            if _tabulated(part)
            for table in _tables(program, name, part)
        ),
    )  # fmt: skip


# --- Statements ---


def _functions(program: Program) -> Iterator[str]:
    for function in program.functions:
        given = ", ".join(program.symbols[one.name] for one in function.arguments)
        body = list(_all(program, function.body, 1))
        if not body:
            continue
        yield f"&\\text{{with }} {_called(function)}({given})\\colon"
        yield from body


def _called(function: Function) -> str:
    return function.symbol


def _all(program: Program, statements: Sequence[Statement], depth: int) -> Iterator[str]:
    for statement in statements:
        if statement.shown:
            yield from _one(program, statement, depth)


def _one(program: Program, statement: Statement, depth: int) -> Iterator[str]:
    space = r"\quad " * depth
    tell = _Told(program).of
    if isinstance(statement, Assign):
        yield f"&{space}{tell(statement.target)} \\leftarrow {tell(statement.value)}"
    elif isinstance(statement, Apply):
        function = next(one for one in program.functions if one.name == statement.function)
        given = ", ".join(map(tell, statement.arguments))
        yield f"&{space}{tell(statement.target)} \\leftarrow {_called(function)}({given})"
    elif isinstance(statement, Cholesky):
        lower = tell(statement.target)
        yield f"&{space}{lower} {lower}^\\top = {tell(statement.matrix)}"
    elif isinstance(statement, SolveRight):
        lower = tell(statement.factor)
        right = f"{tell(statement.right)} ({lower} {lower}^\\top)^{{-1}}"
        yield f"&{space}{tell(statement.target)} \\leftarrow {right}"
    elif isinstance(statement, SolveLower):
        right = f"{tell(statement.factor)}^{{-1}} {tell(statement.right)}"
        yield f"&{space}{tell(statement.target)} \\leftarrow {right}"
    elif isinstance(statement, When):
        yield f"&{space}\\text{{if }} {statement.said or latex(statement.condition)}\\colon"
        yield from _all(program, statement.then, depth + 1)
        otherwise = list(_all(program, statement.otherwise, depth + 1))
        if otherwise:
            yield f"&{space}\\text{{else}}\\colon"
            yield from otherwise
    elif isinstance(statement, ForEach):
        index = _INDEX.get(statement.variable, statement.variable)
        yield f"&{space}\\text{{for }} {index} = 1, \\dots, {statement.count}\\colon"
        yield from _all(program, statement.body, depth + 1)
    elif isinstance(statement, Advance) and statement.period is not None:
        target = _symbol(program, statement.target.name)
        yield f"&{space}{target} \\leftarrow ({target} + 1) \\bmod {statement.period}"


def _told_estimates(program: Program) -> Iterator[str]:
    told = {estimate_name(name): name for name in program.estimates}
    for statement in program.body:
        if isinstance(statement, Assign) and statement.target.name in told:
            name = latex(told[statement.target.name])
            yield f"&\\text{{{name}}} = {_Told(program).of(statement.value)}"


# --- Expressions ---

_INDEX = {"mode": "j", "other": "i", "row": "i", "column": "l", "change": "c"}


class _Told:
    """Expressions in LaTeX, with the symbols of a program."""

    def __init__(self, program: Program) -> None:
        self.program = program

    def of(self, part: Expression) -> str:
        return _told(part, self)

    def within(self, part: Expression) -> str:
        """In parentheses if it is a sum."""
        told = self.of(part)
        return f"({told})" if isinstance(part, Sum) and len(part.terms) > 1 else told


@singledispatch
def _told(part: Expression, to: _Told) -> str:
    raise TypeError(f"{type(part).__name__} cannot be told")


@_told.register
def _(part: Name, to: _Told) -> str:
    symbol = _symbol(to.program, part.name)
    if not part.index:
        return symbol
    places = [_INDEX.get(one) or _place(to.program, one) for one in part.index]
    inner = "".join(places) if all(len(one) == 1 for one in places) else ",".join(places)
    plain = re.fullmatch(r"[^_^{} ]+|\\(hat|bar) [A-Za-z]|\\[A-Za-z]+", symbol)
    return f"{symbol}_{{{inner}}}" if plain else f"({symbol})_{{{inner}}}"


def _place(program: Program, index: str) -> str:
    return str(int(index) + 1) if index.isdigit() else _symbol(program, index)


@_told.register
def _(part: Number, to: _Told) -> str:
    return number(part.value)


@_told.register
def _(part: Sum, to: _Told) -> str:
    first, *rest = part.terms
    start = f"-{to.within(first[1])}" if first[0] < 0 else to.of(first[1])
    return start + "".join(
        f" - {to.within(term)}" if sign < 0 else f" + {to.of(term)}" for sign, term in rest
    )


@_told.register
def _(part: Scaled, to: _Told) -> str:
    return f"{to.within(part.factor)}\\, {to.within(part.of)}"


@_told.register
def _(part: Quotient, to: _Told) -> str:
    return f"\\frac{{{to.of(part.above)}}}{{{to.of(part.below)}}}"


@_told.register
def _(part: Product, to: _Told) -> str:
    return f"{to.within(part.left)} {to.within(part.right)}"


@_told.register
def _(part: Outer, to: _Told) -> str:
    return f"{to.within(part.left)} {to.within(part.right)}^\\top"


@_told.register
def _(part: Transposed, to: _Told) -> str:
    return f"{to.within(part.of)}^\\top"


@_told.register
def _(part: Call, to: _Told) -> str:
    given = [to.of(one) for one in part.arguments]
    if part.function == "fabs":
        return f"\\lvert {given[0]} \\rvert"
    if part.function == "sqrt":
        return f"\\sqrt{{{given[0]}}}"
    if part.function == "pow":
        return f"({given[0]})^{{{given[1]}}}"
    name = _FUNCTIONS.get(part.function, f"\\operatorname{{{part.function}}}")
    return f"{name}({', '.join(given)})"


_FUNCTIONS = {
    "fmax": r"\max", "fmin": r"\min", "asin": r"\arcsin", "acos": r"\arccos", "atan": r"\arctan",
    **{name: f"\\{name}" for name in ("exp", "log", "sin", "cos", "tan", "sinh", "cosh", "tanh")},
}  # fmt: skip


# --- Numbers, matrices, tables ---


def number(value: float) -> str:
    """Six digits, with a power of ten where it is far from one."""
    mantissa, _, exponent = f"{value:.6g}".partition("e")
    if not exponent:
        return mantissa
    power = f"10^{{{int(exponent)}}}"
    signs = {"1": power, "-1": f"-{power}"}
    return signs.get(mantissa, f"{mantissa} \\cdot {power}")


def _symbol(program: Program, name: str) -> str:
    """A symbol, or a name made one: ``W_1`` with an index, words in one piece."""
    symbol = program.symbols.get(name, name)
    if re.fullmatch(r"[A-Za-z]_\w+", symbol):
        return f"{symbol[0]}_{{{latex(symbol[2:])}}}"
    return f"\\mathit{{{latex(symbol)}}}" if re.fullmatch(r"[A-Za-z]\w+", symbol) else symbol


def _matrix(values: Array) -> str:
    if values.ndim == 0:
        return number(float(values))
    rows = values if values.ndim == 2 else values[:, None]
    inner = r" \\ ".join(" & ".join(number(float(one)) for one in row) for row in rows)
    return f"\\begin{{bmatrix}} {inner} \\end{{bmatrix}}"


def _tabulated(part: Constant) -> bool:
    """Whether numbers stand in a table: gains, those of several modes, and wide matrices."""
    wide = part.values.ndim == 2 and part.values.shape[1] > _WIDEST
    return part.gain or part.values.ndim > 2 or wide


def _tables(program: Program, name: str, part: Constant) -> Iterator[str]:
    """A table of numbers by rows and columns; one for each mode of a bank."""
    symbol = _symbol(program, name)
    if part.values.ndim > 2:
        for place, values in enumerate(part.values, start=1):
            yield _table(f"{symbol}_{{{place}}}", values)
    else:
        yield _table(symbol, part.values)


def _table(symbol: str, values: Array) -> str:
    rows = np.atleast_2d(values) if values.ndim != 1 else values[:, None]
    header = ["", *map(str, range(1, rows.shape[1] + 1))]
    body = (
        [str(place), *(f"${number(float(one))}$" for one in row)]
        for place, row in enumerate(rows, start=1)
    )
    inner = booktabs(header, body, "r" * len(header)).rstrip()
    fitted = f"{_AS_WIDE_AS_FITS}{{%\n{inner}}}"
    return f"\\begin{{table}}[ht]\\centering\n\\caption{{${symbol}$}}\n{fitted}\n\\end{{table}}\n"


def _signals(program: Program, design: Design) -> str:
    told = [f"$y_k$: {_listed(design.measurements)}"]
    if program.inputs:
        told.append(f"$u_k$: {_listed(design.inputs)}")
    told += [
        f"\\emph{{{latex(each)}}}: {_listed(design.estimates[each])}" for each in program.estimates
    ]
    return "; ".join(told) + f". Sampling period {design.system.sampling_period:g} s."


def _listed(signals: Sequence[Signal]) -> str:
    return ", ".join(f"{latex(name)} [{_unit(unit)}]" for name, unit in signals)


def _unit(unit: str) -> str:
    special = {"Ω": r"$\Omega$", "°": r"${}^\circ$", "%": r"\%"}
    told = re.sub(r"\^([+-]?\d+)", r"$^{\1}$", unit or "--")
    return "".join(special.get(letter, letter) for letter in told)
