"""`reobserve export`: a design as C."""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import reobserve.codegen.record as records
from reobserve.codegen import c_code, c_test
from reobserve.core.documents import YAML, read_yaml
from reobserve.core.errors import InputError, shown
from reobserve.core.files import check_not_read, write_text
from reobserve.estimation.families.file import load_design, naming
from reobserve.estimation.families.program import program_of
from reobserve.estimation.families.signals import NamedSignal
from reobserve.estimation.observer_design import Design

if TYPE_CHECKING:
    from reobserve.estimation.specified_design import SpecifiedDesign

# Words of C, and what the code itself includes.
_TAKEN = frozenset(
    """auto break case char const continue default do double else enum extern float for goto if
    inline int long main math register restrict return short signed sizeof static stdint struct
    switch typedef union unsigned void volatile while""".split()  # noqa: SIM905
)


def run(design: Path, to: str, out: Path) -> None:
    """Write a design as code into a folder, and print what was written. ``to`` is "c".

    The design may be a specification of `reobserve estimate` that states it, .yaml or .yml.
    """
    if to != "c":
        raise InputError("to", f"{shown(to)} must be c")
    if design.suffix.lower() in YAML:
        texts, notes = _from_specification(design)
    else:
        texts, notes = exported(load_design(design), identifier(design)), ()
    check_not_read([out / name for name in texts], [design])
    for name, text in texts.items():
        write_text(out / name, text)
        print(out / name)
    print(*notes, sep="\n", end="\n" if notes else "")
    print(f"to test it: cd {out}; {c_test.COMPILE.format(name=identifier(design))} && ./a.out")


def _from_specification(path: Path) -> tuple[dict[str, str], Sequence[str]]:
    """The texts of the design that a specification states, which is certified first."""
    from reobserve.estimation.specified_design import specified_design

    tree = read_yaml(path)
    with naming(path):
        made = specified_design(tree)
        with type(made.design).keyed():
            made.design.certify()
            made.design.try_out()
        return exported(made.design, identifier(path), made), made.notes


def exported(design: Design, name: str, specified: SpecifiedDesign | None = None) -> dict[str, str]:
    """The texts of files by their names.

    Parameters
    ----------
    design
        A design, as `load_design` gives it.
    name
        What functions and files are called: an identifier of C.
    specified
        What a specification says of its signals.
    """
    if not _is_identifier(name):
        raise InputError("name", f"{shown(name)} must be an identifier of C")
    state = design.start()
    read: Any = (design.measurements, design.inputs) if specified is None else specified.signals
    columns = len(read[0]), len(read[1])
    program = program_of(design.observer, state, columns, type(design))
    signals = listed(read[0]), listed(read[1])
    estimates = {**design.estimates, **(specified.estimates if specified else {})}
    about = "It estimates " + "; ".join(
        f"{each}: {listed(estimates[each])}" for each in program.estimates
    )
    for note in specified.readings if specified else ():
        about += f". {note[:1].upper()}{note[1:]}"
    period = float(design.system.sampling_period)
    y, u, results = records.test_run(design.observer, state, columns)
    expected = {each: results[each] for each in program.estimates}
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
