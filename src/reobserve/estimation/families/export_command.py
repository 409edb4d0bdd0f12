"""`reobserve export`: a design as C, Python, LaTeX or JSON."""

from __future__ import annotations

import json
import re
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import reobserve.codegen.record as records
from reobserve.codegen import c_code, c_test, latex, python_code
from reobserve.codegen.program_of import program_of
from reobserve.codegen.statements import Program
from reobserve.core.errors import InputError, shown
from reobserve.core.files import write_text
from reobserve.estimation.families.design import Design
from reobserve.estimation.families.file import load_design
from reobserve.estimation.families.signals import Signal

FORMATS = ("c", "python", "latex", "json")
# C's own words and what the code itself is made of.
_TAKEN = frozenset(
    """auto break case char const continue default do double else enum extern float for goto if
    inline int long main register restrict return short signed sizeof static struct switch typedef
    union unsigned void volatile while and as assert class def del elif except finally from global
    import in is lambda nonlocal not or pass raise try with yield math""".split()  # noqa: SIM905
)


def run(design: Path, to: str, out: Path) -> None:
    """Write a design as code into a folder, and say what was written.

    Raises
    ------
    InputError
        If the file is no design, its observer has no fixed steps, or a file cannot be written.
    """
    loaded = load_design(design)
    for name, text in exported(loaded, to, identifier(design)).items():
        write_text(out / name, text)
        print(out / name)
    if to == "c":
        name = identifier(design)
        print(f"to test it: cd {out}; {c_test.COMPILE.format(name=name)} && ./a.out")


def exported(design: Design, to: str, name: str) -> dict[str, str]:
    """The texts of files by their names.

    Parameters
    ----------
    design
        A design, as `load_design` gives it.
    to
        One of `FORMATS`.
    name
        What functions and files are called: an identifier of C and Python.

    Raises
    ------
    InputError
        If the observer has no fixed steps, there is no such format, or the name is none.
    """
    if to not in FORMATS:
        raise InputError("to", f"{shown(to)} must be one of {', '.join(FORMATS)}")
    if not _is_identifier(name):
        raise InputError("name", f"{shown(name)} must be an identifier of C and Python")
    state = design.start()
    columns = len(design.measurements), len(design.inputs)
    program = program_of(design.observer, state, columns)
    signals = listed(design.measurements), listed(design.inputs)
    about = "It estimates " + "; ".join(
        f"{each}: {listed(design.estimates[each])}" for each in program.estimates
    )
    period = float(design.system.sampling_period)
    if to == "python":
        return {f"{name}.py": python_code.module(program, signals, about, period)}
    if to == "latex":
        return {f"{name}.tex": latex.document(program, design)}
    if to == "json":
        return {f"{name}.json": _json(program, design, period)}
    y, u, found = records.test_run(design.observer, state, columns)
    expected = {each: found[each] for each in program.estimates}
    return {
        f"{name}.h": c_code.header(program, name, signals, about, period),
        f"{name}.c": c_code.source(program, name),
        f"{name}_test.c": c_test.test_source(program, name, y, u, expected),
    }


def identifier(path: Path) -> str:
    """The name of a file as an identifier of C and Python."""
    name = re.sub(r"\W", "_", path.stem, flags=re.ASCII)[:40] or "design"
    return name if _is_identifier(name) else f"design_{name}"


def _is_identifier(name: str) -> bool:
    spelled = re.fullmatch(r"[A-Za-z]\w{0,59}", name, re.ASCII) is not None
    return spelled and name not in _TAKEN


def listed(signals: Sequence[Signal]) -> str:
    """Signals with their units."""
    return ", ".join(f"{name} [{unit or '-'}]" for name, unit in signals)


def _json(program: Program, design: Design, period: float) -> str:
    """What another program needs to run the same step: numbers and names, no statements."""

    def signals(among: Sequence[Signal]) -> list[dict[str, str]]:
        return [signal._asdict() for signal in among]

    tree: dict[str, Any] = {
        "title": program.title,
        "sampling_period": period,
        "measurements": signals(design.measurements),
        "inputs": signals(design.inputs),
        "estimates": {each: signals(design.estimates[each]) for each in program.estimates},
        "constants": {name: part.values.tolist() for name, part in program.constants.items()},
        "memory": {name: part.initial.tolist() for name, part in program.memory.items()},
        "certificate": design.certificate,
    }
    return json.dumps(tree, indent=1, ensure_ascii=False, allow_nan=False) + "\n"
