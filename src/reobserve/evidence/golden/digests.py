"""Digests of what each stage of a paper gives: where two machines begin to differ.

They are of values and units, not of files, whose provenance says by which code they were made. Two
machines with the same digest of a stage have the same numbers there, to the last bit. A digest
that differs is no failure, tolerances decide that; it says which stage differs first.
"""

from __future__ import annotations

import hashlib
import json
import platform
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from reobserve.errors import InputError
from reobserve.plain_data.files import cell, write_text
from reobserve.replication.evaluation import Evaluator
from reobserve.replication.provenance import versions
from reobserve.timeseries.series import Series

FILE = "digests.json"

_DRAWING = ("matplotlib", "pyarrow")  # they move pictures and files, no values


def stage_digests(evaluator: Evaluator) -> dict[str, str]:
    """Of what each stage gave in an evaluation, in the order in which it was made."""
    return {name: _digest(value) for name, value in evaluator.made.items()}


def environment() -> dict[str, str]:
    """What the digests hold for: the processor's kind and all that decides the last bits."""
    return {
        "machine": platform.machine(),
        "fused multiply-add": "yes" if fused_multiply_add() else "no",  # the C library's choice
        "C library": " ".join(platform.libc_ver()).strip(),
        "Python": ".".join(platform.python_version_tuple()[:2]),  # 3.12 sums more exactly
        **{name: version for name, version in versions().items() if name not in _DRAWING},
    }


def processor_flags() -> set[str]:
    """What the processor can do, in the words of Linux; nothing on other systems."""
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="ascii", errors="replace").splitlines()
    except OSError:
        return set()
    return {
        word
        for line in lines
        if line.startswith("flags")
        for word in line.partition(":")[2].split()
    }


def fused_multiply_add() -> bool:
    """Whether the C library of an x86-64 processor multiplies and adds with one rounding."""
    return {"fma", "avx2"} <= processor_flags()


def read(folder: Path) -> tuple[dict[str, str], dict[str, str]]:
    """The environment that digests hold for, and the digests by stage.

    Raises
    ------
    InputError
        If the file is missing or damaged.
    """
    path = folder / FILE
    try:
        stored = json.loads(path.read_text(encoding="utf-8"))
        return (
            {str(name): str(value) for name, value in stored["environment"].items()},
            {str(name): str(value) for name, value in stored["stages"].items()},
        )
    except (OSError, UnicodeDecodeError) as error:
        reason = getattr(error, "strerror", None) or error
        raise InputError(str(path), f"cannot be read ({reason})") from None
    except (ValueError, KeyError, TypeError, AttributeError, RecursionError):
        raise InputError(str(path), "is damaged; it must hold an environment and stages") from None


def write(folder: Path, stages: Mapping[str, str], where: Mapping[str, str]) -> None:
    """Keep the digests of all stages of a paper, with the environment that they hold for."""
    stored = {"environment": dict(where), "stages": dict(stages)}
    write_text(folder / FILE, json.dumps(stored, indent=1, ensure_ascii=False) + "\n")


def first_difference(folder: Path, found: Mapping[str, str]) -> str:
    """A sentence on which stages differ from the digests in ``folder``; nothing if none does.

    Raises
    ------
    InputError
        If the file of the digests is missing or damaged.
    """
    where, golden = read(folder)
    common = [stage for stage in found if stage in golden]
    differing = [stage for stage in common if found[stage] != golden[stage]]
    if not differing:
        return ""
    here = environment()
    other = [
        f"{name} {where.get(name, 'none')}, here {here.get(name, 'none')}"
        for name in dict.fromkeys([*where, *here])
        if where.get(name) != here.get(name)
    ]
    said = f"{len(differing)} of {len(common)} stages differ in their last bits, "
    said += f"the first is `{differing[0]}`"
    return f"{said}; the digests were made under {'; '.join(other)}" if other else said


def _digest(value: Any) -> str:
    whole = hashlib.sha256()
    if isinstance(value, Series):
        units = {name: channel.unit for name, channel in value.channels.items()}
        events = {name: list(times) for name, times in value.events.items()}
        whole.update(json.dumps([units, events]).encode())
        for column in (value.time, *value.flat().values()):
            whole.update(np.ascontiguousarray(column, dtype="<f8").tobytes())
    elif isinstance(value, Mapping):  # a design, plain JSON data
        whole.update(json.dumps(value, sort_keys=True).encode())
    else:  # rows of a study or a table, or metrics
        rows = (row if isinstance(row, Mapping) else vars(row) for row in value)
        text = [[f"{name}={cell(entry)}" for name, entry in row.items()] for row in rows]
        whole.update(json.dumps(text).encode())
    return whole.hexdigest()[:16]
