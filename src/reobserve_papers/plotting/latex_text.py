"""Text, numbers and tables as LaTeX: each character as it stands, whatever it means as markup.

What comes out needs no package: letters with accents, Greek ones and signs are spelled in the
commands of LaTeX itself. Characters that it has no command for are left as they are.
"""

from __future__ import annotations

import math
import re
import unicodedata
from collections.abc import Iterable, Sequence
from functools import cache
from typing import Any

from reobserve.core.extras import package


def latex(text: str) -> str:
    """The text in LaTeX, its lines joined by blanks."""
    encoded: str = _encoder().unicode_to_latex(unicodedata.normalize("NFC", " ".join(text.split())))
    return encoded


def booktabs(header: Sequence[str], rows: Iterable[Sequence[str]], columns: str) -> str:
    """A ``tabular`` with the rules of the package booktabs, of cells that are LaTeX.

    ``columns`` has a letter for each, how it is aligned: ``lrr``.
    """
    lines = [
        rf"\begin{{tabular}}{{{columns}}}",
        r"\toprule",
        " & ".join(header) + r" \\",
        r"\midrule",
    ]
    lines += [" & ".join(row) + r" \\" for row in rows]
    return "\n".join([*lines, r"\bottomrule", r"\end{tabular}", ""])


def latex_number(value: float, digits: int) -> str:
    """A number with so many significant digits, a whole one as it is, or a dash for none."""
    if math.isnan(value):
        return "--"
    sign = "-" if value < 0 else ""
    if math.isinf(value):
        return rf"\ensuremath{{{sign}\infty}}"
    if value == round(value) and abs(value) < _WHOLE:
        shown = f"{round(value)}"
    else:
        rounded = float(f"{value:.{digits}g}")
        power = math.floor(math.log10(abs(rounded)))
        if not _LEAST <= power < _MOST:
            return rf"\ensuremath{{{rounded / 10.0**power:.{digits - 1}f} \times 10^{{{power}}}}}"
        shown = f"{rounded:.{max(digits - 1 - power, 0)}f}"
    return rf"\ensuremath{{{shown}}}" if sign else shown


def latex_digits(text: str) -> str:
    """A number with the digits that it is written with."""
    mantissa, _, power = text.lower().partition("e")
    if not mantissa.lstrip("+-")[:1].isdigit():
        return latex_number(float(text), 1)  # infinite, or none
    if power:
        return rf"\ensuremath{{{mantissa} \times 10^{{{int(power)}}}}}"
    return rf"\ensuremath{{{mantissa}}}" if mantissa.startswith("-") else mantissa


_WHOLE = 1e6  # below which whole numbers have all of their digits
_LEAST, _MOST = -3, 5  # powers of ten between which numbers are written out


@cache
def _encoder() -> Any:
    package("pylatexenc", "write LaTeX")
    from pylatexenc.latexencode import (
        RULE_REGEX,
        UnicodeToLatexConversionRule,
        UnicodeToLatexEncoder,
    )

    rules = [(re.compile(pattern), meaning) for pattern, meaning in _RULES]
    return UnicodeToLatexEncoder(
        conversion_rules=[UnicodeToLatexConversionRule(RULE_REGEX, rules), "defaults"],
        unknown_char_policy="keep",
        unknown_char_warning=False,
    )


def _plain(characters: re.Match[str]) -> str:
    """Raised or lowered characters as they stand on the line."""
    return unicodedata.normalize("NFKC", characters[0]).replace("−", "-")


_HIGH, _LOW = "⁰¹²³⁴⁵⁶⁷⁸⁹⁺⁻⁼⁽⁾ⁿⁱ", "₀₁₂₃₄₅₆₇₈₉₊₋₌₍₎ₐₑₕᵢⱼₖₗₘₙₒₚᵣₛₜᵤᵥₓ"
_ACCENTS = {"\u0302": "hat", "\u0304": "bar", "\u0303": "tilde", "\u0307": "dot", "\u0308": "ddot"}
_SIGNS = {"◂": "triangleleft", "▸": "triangleright", "←": "leftarrow", "→": "rightarrow",
          "×": "times", "·": "cdot"}  # fmt: skip

# Before the rules of the library: what it lacks, takes letter by letter or needs packages for.
_RULES: list[tuple[str, Any]] = [
    *(
        (f"(\\w){mark}", lambda match, name=name: rf"\ensuremath{{\{name}{{{latex(match[1])}}}}}")
        for mark, name in _ACCENTS.items()
    ),
    (f"[{_HIGH}]+", lambda match: rf"\textsuperscript{{{_plain(match)}}}"),
    (f"[{_LOW}]+", lambda match: rf"\textsubscript{{{_plain(match)}}}"),
    ("[¼½¾⅐-⅞]", lambda match: rf"\ensuremath{{\frac{{{_over(match)[0]}}}{{{_over(match)[1]}}}}}"),
    *((sign, rf"\\ensuremath{{\\{name}}}") for sign, name in _SIGNS.items()),
    ("′", r"\\ensuremath{'}"),
    ("-(?=-)", "-{}"),  # no dash
    ("'(?=')", "'{}"),  # no quotation mark
    ("`", r"\\textasciigrave{}"),
    ('"', "{''}"),  # the straight one is not in every font
    (r"\|", r"\\textbar{}"),
    (r"[\[\]]", r"{\g<0>}"),  # no optional argument
]


def _over(fraction: re.Match[str]) -> list[str]:
    return unicodedata.normalize("NFKC", fraction[0]).split("\N{FRACTION SLASH}")
