"""Text of a user as an expression of sympy, by a grammar of its own: nothing is evaluated.

    sum      = product {("+" | "-") product}
    product  = sign {("*" | "/") sign}
    sign     = {"+" | "-"} power
    power    = atom [("**" | "^") sign]
    atom     = number | name | function "(" sum {"," sum} ")" | "(" sum ")"

as in Python; names are variables, pi, E or symbols without a value. What is too long, too deep or
too large to be worked with is refused, in text and in expressions of sympy alike.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from functools import cache
from operator import add, mul, sub, truediv
from typing import Any

from reobserve.core.errors import InputError, one_line, shown
from reobserve.core.extras import package

# Functions of one argument that are analytic wherever they have a Taylor series.
ANALYTIC = (
    *("exp", "log", "sin", "cos", "tan", "cot", "sec", "csc", "asin", "acos", "atan"),
    *("sinh", "cosh", "tanh", "coth", "sech", "csch", "asinh", "acosh", "atanh"),
    *("erf", "sinc"),
)
# All functions, by their names in sympy.
FUNCTIONS = {name: name for name in (*ANALYTIC, "sqrt", "atan2")} | {"abs": "Abs"}
NOT_EXPANDED = "is not expanded; what can be are sums, products, powers and " + ", ".join(ANALYTIC)

_LONGEST = 10_000  # characters
_DEEPEST = 60  # levels of parentheses, signs and powers
_MOST_PARTS = 10_000
_HIGHEST_POWER = 1000
_MOST_BITS = 1024  # of a whole number: those of the largest float

_TOGETHER = 40


@cache
def functions() -> dict[str, Any]:
    """All functions by name, and two that derivatives have, which stay as they are written.

    sympy's own are rewritten by what it finds out about their arguments, without bound.
    """
    import sympy

    class NamedFunction(sympy.Function):  # type: ignore[misc]
        """Evaluated as sympy's own where that is done at once."""

        @classmethod
        def eval(cls, *arguments: Any) -> Any:
            name = cls.__name__
            for u in arguments:
                unreal = name == "atan2" and u.is_extended_real is False
                if unreal or u.has(sympy.nan, sympy.zoo, sympy.oo, -sympy.oo):
                    return sympy.nan
                if not (u.is_Number or u.is_NumberSymbol or (u / sympy.pi).is_Rational):
                    return None
            value = getattr(sympy, name)(*arguments)
            return None if value.func.__name__ == name else value

        def _eval_is_extended_real(self) -> bool | None:
            if self.is_number:  # mpmath's atan2 has an error of Python's of complex numbers
                parts = (part.evalf(15) for part in (*self.args, self))
                return all(bool(part.is_Float or part.is_Rational) for part in parts)
            return all(argument.is_extended_real for argument in self.args) or None

    names = [*FUNCTIONS.values(), "sign", "sinc_slope"]
    made = {name: type(name, (NamedFunction,), {}) for name in names}
    # Powers of E are exponentials of sympy; roots are powers.
    return made | {"abs": made["Abs"], "exp": sympy.exp, "sqrt": sympy.sqrt}


_Part = Callable[[], Any]
_Join = Callable[[Any, Any], Any]

_TOKEN = re.compile(
    r"\s*(?:(\d+\.?\d*(?:[eE][+-]?\d+)?|\.\d+(?:[eE][+-]?\d+)?)|(\w+)|(\*\*|[-+*/^(),]))"
)


def parse(place: str, text: str, variables: Mapping[str, Any]) -> Any:
    """The expression that a text writes, with the symbols of ``variables`` by their names."""
    if len(text) > _LONGEST:
        raise InputError(place, f"has {len(text)} characters, must have {_LONGEST} or fewer")
    parser = _Parser(place, text, variables)
    try:
        expression = parser.sum()
    except InputError:
        raise
    except (ArithmeticError, TypeError, ValueError):  # sympy's, of 1e-308/0.0 and the like
        raise InputError(place, f"{shown(text)} holds a part without a value") from None
    if parser.here[0] != "end":
        raise parser.wrong()
    return expression


class _Parser:
    """Parser that reads one token ahead, with ``depth`` for how far it stands inside."""

    def __init__(self, place: str, text: str, variables: Mapping[str, Any]) -> None:
        self.place, self.text, self.variables = place, text, variables
        self.sympy = package("sympy", "read expressions")
        self.end = self.depth = 0
        self.here = ("start", "", 0)
        self.advance()

    def advance(self) -> str:
        """Take the token ahead and look at the next one."""
        taken = self.here[1]
        match = _TOKEN.match(self.text, self.end)
        rest = self.text[self.end :].lstrip()
        self.here = ("end", "", self.end)
        if match is not None:
            kind = ("number", "name", "sign")[(match.lastindex or 1) - 1]
            self.here = (kind, match[match.lastindex or 1], match.start(match.lastindex or 1))
            self.end = match.end()
        elif rest:
            self.here = ("unknown", rest[0], len(self.text) - len(rest))
        return taken

    def wrong(self) -> InputError:
        """An error that says what the text is not."""
        kind, token, start = self.here
        where = "its end" if kind == "end" else f"{token!r}, character {start + 1}"
        return InputError(self.place, f"{shown(self.text)} is no expression, at {where}")

    def ahead(self, *signs: str) -> bool:
        return self.here[0] == "sign" and self.here[1] in signs

    def sum(self) -> Any:
        self.depth += 1
        if self.depth > _DEEPEST:
            raise InputError(
                self.place, f"{shown(self.text)} is nested deeper than {_DEEPEST} levels"
            )
        total = self.joined(self.product, {"+": add, "-": sub}, add)
        self.depth -= 1
        return total

    def product(self) -> Any:
        return self.joined(self.sign, {"*": mul, "/": truediv}, mul)

    def joined(self, part: _Part, signs: Mapping[str, _Join], join: _Join) -> Any:
        """Parts with signs between them, some at a time: to add one to many takes their number."""
        joined, count = [part()], 1
        while self.ahead(*signs):
            sign, term = self.advance(), part()
            if count % _TOGETHER == 0:
                joined.append(signs[sign](self.sympy.Integer(join is mul), term))
            else:
                joined[-1] = self.checked(signs[sign](joined[-1], term))
            count += 1
        total = joined[0]
        for term in joined[1:]:
            total = self.checked(join(total, term))
        return total

    def sign(self) -> Any:
        negative = False
        while self.ahead("+", "-"):
            negative ^= self.advance() == "-"
        power = self.power()
        return -power if negative else power

    def power(self) -> Any:
        base = self.atom()
        if not self.ahead("**", "^"):
            return base
        self.advance()
        self.depth += 1
        if self.depth > _DEEPEST:
            raise InputError(
                self.place, f"{shown(self.text)} is nested deeper than {_DEEPEST} levels"
            )
        exponent = self.sign()
        self.depth -= 1
        for part in (base, exponent):
            check_constant(self.place, part)
        check_raised(self.place, base, exponent)
        check_power(self.place, exponent)
        # sqrt(a**2) has sympy's own.
        return self.checked((base**exponent).replace(self.sympy.Abs, functions()["abs"]))

    def atom(self) -> Any:
        kind, token, _ = self.here
        if kind == "number":
            self.advance()
            whole = token.isdecimal()
            if len(token) > _MOST_BITS or float(token) > 1e308:
                raise InputError(self.place, f"{shown(token)} is beyond floating-point numbers")
            return self.sympy.Integer(token) if whole else self.sympy.Float(token)
        if kind == "name":
            return self.symbol_or_call(token)
        if self.ahead("("):
            return self.arguments(1)[0]
        raise self.wrong()

    def symbol_or_call(self, name: str) -> Any:
        if name in self.variables:
            self.advance()
            return self.variables[name]
        function = functions()[name] if name in FUNCTIONS else None
        if function is None and name in ("pi", "E"):
            self.advance()
            return getattr(self.sympy, name)
        if function is None and not name.isidentifier():
            raise self.wrong()
        self.advance()
        if not self.ahead("("):
            if function is not None:
                raise self.wrong()
            return self.sympy.Symbol(name)
        if function is None:
            others = "; in models also sqrt, abs and atan2"
            raise InputError(self.place, f"{shown(name)} {NOT_EXPANDED}{others}")
        arguments = self.arguments(2 if name == "atan2" else 1)
        for argument in arguments:
            check_constant(self.place, argument)
        return self.checked(function(*arguments))

    def arguments(self, count: int) -> list[Any]:
        """So many sums in parentheses, with commas between them."""
        found = []
        for left in range(count, 0, -1):
            self.advance()
            found.append(self.sum())
            if not self.ahead("," if left > 1 else ")"):
                raise self.wrong()
        self.advance()
        return found

    def checked(self, value: Any) -> Any:
        """A part of the expression, unless it is a number that nobody can work with."""
        check_number(self.place, value)
        if value.is_Add or value.is_Mul:
            check_number(self.place, value.args[0])  # where its one number is, if it has one
        return value


def check_power(place: str, exponent: Any) -> None:
    """Refuse a whole power, also as a float, that would take for ever to multiply out."""
    whole = exponent.is_Integer or (exponent.is_Float and float(exponent).is_integer())
    if whole and abs(exponent) > _HIGHEST_POWER:
        raise InputError(
            place, f"has the power {shown(int(exponent))}, must have {_HIGHEST_POWER} or lower"
        )


def check_raised(place: str, base: Any, exponent: Any) -> None:
    """Refuse a power of numbers, or of a product with numbers, that would be too long to write."""
    if not exponent.is_Rational:
        return
    for part in base.args if base.is_Mul else (base,):
        if part.is_Pow:
            check_raised(place, part.base, part.exp * exponent)
        elif part.is_Rational and part not in (-1, 0, 1):
            bits = max(abs(part.p), part.q).bit_length() * abs(exponent)
            if bits > _MOST_BITS:
                power = one_line(f"({part})**({exponent})", 100)
                raise InputError(place, f"{power} is beyond numbers")


def check_constant(place: str, value: Any) -> None:
    """Refuse a constant beyond floating-point numbers: a function of it may take for ever."""
    written = value.is_Number or value.is_finite is False  # as 1/0, of which other functions tell
    if value.is_number and not written and not abs(value.evalf(5)) < 1e308:
        raise InputError(place, "holds a number beyond floating-point numbers")


def check_number(place: str, value: Any) -> None:
    """Refuse a number beyond floating-point ones."""
    if value.is_Rational:
        large = max(abs(value.p), value.q).bit_length() > _MOST_BITS
    else:
        large = bool(value.is_Float) and bool(abs(value) > 1e308)
    if large:
        raise InputError(place, "holds a number beyond floating-point numbers")


def check_size(place: str, expression: Any) -> None:
    """Refuse an expression of too many parts, too deep, or with parts too large to work with."""
    parts, ahead = 0, [(expression, 0)]
    while ahead:
        part, depth = ahead.pop()
        parts += 1
        if parts > _MOST_PARTS:
            raise InputError(place, f"has more than {_MOST_PARTS} parts")
        if depth > 4 * _DEEPEST:
            raise InputError(place, f"is nested deeper than {4 * _DEEPEST} levels")
        if part.is_Number:
            check_number(place, part)
        if part.is_Pow:
            check_power(place, part.exp)
        ahead += [(inner, depth + 1) for inner in part.args]
