"""Targets of a build: one that no rule makes is refused, with the nearest that there is."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable
from typing import Any

from reobserve.core.errors import InputError, nearest, shown
from reobserve_papers.cli.options import FORMATS
from reobserve_papers.cli.own_modules import refused_in_one_sentence


def check_targets(workflow: Any, results: Callable[[], list[str]]) -> None:
    """Check targets once all rules are read, by all ``results``, figures in all formats."""
    # No public function runs between the last rule and the graph.
    prepare: Any = getattr(workflow, "_prepare_dag", None)

    def checked(*arguments: Any, **options: Any) -> None:
        asked = workflow.dag_settings
        for word in sorted({*asked.targets, *asked.forcerun, *asked.until, *asked.omit_from}):
            target = os.path.relpath(word)
            if target.endswith(".tex"):
                target = target[:-3] + ("rst" if target.endswith(".caption.tex") else "csv")
            makes = any(one.is_producer(target) for one in workflow.rules) and not os.path.isabs(
                word
            )
            is_file = os.path.isfile(target) and word not in asked.targets
            if not makes and not workflow.is_rule(word) and not is_file:
                single = [one for one in workflow.rules if not one.has_wildcards()]
                known = [str(output) for one in single for output in one.output]
                with refused_in_one_sentence():
                    if os.path.isabs(word):
                        raise InputError(word, f"must be a path from this folder, as {target}")
                    _refuse(target, [*results(), *known, *(one.name for one in workflow.rules)])
        prepare(*arguments, **options)

    if workflow.is_main_process and prepare is not None:
        workflow._prepare_dag = checked


def _refuse(target: str, known: Iterable[str]) -> None:
    """Raise the `InputError` on a target, at its first part that is wrong."""
    kind = target.rpartition(".")[2]
    if target in known and kind in FORMATS:
        problem = f"the format {kind} is not built; ask for it by --config 'formats=[{kind}]'"
        raise InputError(target, problem)
    parts, there = target.split("/"), [one.split("/") for one in known]
    for part in parts:
        names = sorted({one[0] for one in there if one})
        if part not in names:
            raise InputError(target, f"there is no {shown(part)}{nearest(part, names)}")
        there = [one[1:] for one in there if one and one[0] == part]
    raise InputError(target, f"is a folder, must be a file in it, such as {'/'.join(there[0])}")
