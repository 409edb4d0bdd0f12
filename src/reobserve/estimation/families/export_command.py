"""`reobserve export`: a design as C."""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path

import reobserve.codegen.record as records
from reobserve.codegen import c_code, c_test
from reobserve.core.errors import InputError, shown
from reobserve.core.files import check_not_read, write_text
from reobserve.estimation.families.design import Design
from reobserve.estimation.families.file import load_design
from reobserve.estimation.families.program import program_of
from reobserve.estimation.families.signals import NamedSignal

# Words of C, and what the code itself includes.
_TAKEN = frozenset(
    """auto break case char const continue default do double else enum extern float for goto if
    inline int long main math register restrict return short signed sizeof static stdint struct
    switch typedef union unsigned void volatile while""".split()  # noqa: SIM905
)


def run(design: Path, to: str, out: Path) -> None:
    """Write a design as code into a folder, and print what was written. ``to`` is "c".

    Raises
    ------
    InputError
        If the file is no design, its observer has no fixed steps, or a file is the design itself or
        cannot be written.
    """
    if to != "c":
        raise InputError("to", f"{shown(to)} must be c")
    loaded = load_design(design)
    texts = exported(loaded, identifier(design))
    check_not_read([out / name for name in texts], [design])
    for name, text in texts.items():
        write_text(out / name, text)
        print(out / name)
    print(f"to test it: cd {out}; {c_test.COMPILE.format(name=identifier(design))} && ./a.out")


def exported(design: Design, name: str) -> dict[str, str]:
    """The texts of files by their names.

    Parameters
    ----------
    design
        A design, as `load_design` gives it.
    name
        What functions and files are called: an identifier of C.

    Raises
    ------
    InputError
        If the observer has no fixed steps, or the name is none.
    """
    if not _is_identifier(name):
        raise InputError("name", f"{shown(name)} must be an identifier of C")
    state = design.start()
    columns = len(design.measurements), len(design.inputs)
    program = program_of(design.observer, state, columns, type(design))
    signals = listed(design.measurements), listed(design.inputs)
    about = "It estimates " + "; ".join(
        f"{each}: {listed(design.estimates[each])}" for each in program.estimates
    )
    period = float(design.system.sampling_period)
    y, u, found = records.test_run(design.observer, state, columns)
    expected = {each: found[each] for each in program.estimates}
    return {
        f"{name}.h": c_code.header(
            program, name, signals, about, period, design.observer.reads_missing
        ),
        f"{name}.c": c_code.source(program, name),
        f"{name}_test.c": c_test.test_source(program, name, y, u, expected),
    }


def identifier(path: Path) -> str:
    """The name of a file as an identifier of C."""
    name = re.sub(r"\W", "_", path.stem, flags=re.ASCII)[:40] or "design"
    return name if _is_identifier(name) else f"design_{name}"


def _is_identifier(name: str) -> bool:
    spelled = re.fullmatch(r"[A-Za-z]\w{0,59}", name, re.ASCII) is not None
    return spelled and name not in _TAKEN


def listed(signals: Sequence[NamedSignal]) -> str:
    """Signals with their units."""
    return ", ".join(f"{name} [{unit or '-'}]" for name, unit in signals)
