"""The summary of a figure diff: JSON for machines, Markdown for the page of a CI run."""

from __future__ import annotations

import json
import math
from collections import Counter
from typing import Any

from reobserve.evidence.figure_diff.model import Diff, Item
from reobserve.evidence.figure_diff.pixels import RMS, SIMILARITY
from reobserve.evidence.golden.deviation import Deviation, OtherCell

VERDICTS = ("missing", "extra", "gap", "moved", "agrees")


def counts(diff: Diff) -> str:
    """How many items have which verdict, in words."""
    found = Counter(item.verdict for item in diff.items)
    said = (f"{found[name]} {name.removesuffix('s')}" for name in VERDICTS if found[name])
    return ", ".join(said) or "nothing"


def to_json(diff: Diff) -> str:
    """Everything that was found but the pictures; numbers that JSON lacks are strings."""
    summary = {
        "agrees": not diff.failed and not diff.gaps,
        "tolerances": {"rms": RMS, "similarity": SIMILARITY},
        "gaps": diff.gaps,
        "items": [_item(item) for item in diff.items],
        "origin": {"reference": diff.reference.values, "new": diff.new.values},
    }
    return json.dumps(summary, indent=1, ensure_ascii=False, allow_nan=False) + "\n"


def to_markdown(diff: Diff) -> str:
    """A short text: the counts, what does not agree, what else is different."""
    lines = ["## Figure diff", "", f"{len(diff.items)} compared: {counts(diff)}.", ""]
    lines += [f"- {_cell(gap)}" for gap in diff.gaps] + [""] * bool(diff.gaps)
    if diff.failed:
        lines += ["| | verdict | RMS | similarity | numbers moved | |", "|---|---|---|---|---|---|"]
    for item in diff.failed:
        drawn = ("", "")
        if item.pixels is not None:
            drawn = (f"{item.pixels.rms:.3g}", f"{item.pixels.similarity:.3f}")
        said = [sentence for sentence in (item.why_missing, *item.gaps) if sentence]
        said += [str(item.deviations[0])] if item.deviations else []
        cells = (
            f"{item.paper} {item.name}", item.verdict, *drawn, str(len(item.deviations)),
            "; ".join(said),
        )  # fmt: skip
        lines.append(f"| {' | '.join(map(_cell, cells))} |")
    differing = diff.reference.differing(diff.new)
    if differing:
        lines += ["", "Made under something else than the reference figures:", ""]
        lines += [f"- {_cell(f'{name}: {old}, now {new}')}" for name, old, new in differing]
    return "\n".join(lines).rstrip() + "\n"


def _item(item: Item) -> dict[str, Any]:
    drawn = item.pixels
    return {
        "paper": item.paper,
        "name": item.name,
        "kind": item.kind,
        "verdict": item.verdict,
        "why_missing": item.why_missing or None,
        "rms": drawn and drawn.rms,
        "similarity": drawn and drawn.similarity,
        "deviations": [_deviation(deviation) for deviation in item.deviations],
        "gaps": item.gaps,
    }


def _deviation(deviation: Deviation | OtherCell) -> dict[str, Any]:
    found = {"what": deviation.what, "golden": deviation.golden, "found": deviation.found}
    if isinstance(deviation, Deviation):
        found["tolerance"] = deviation.tolerance
    return {
        name: str(value) if isinstance(value, float) and not math.isfinite(value) else value
        for name, value in found.items()
    }


def _cell(text: str) -> str:
    """A text as one cell or line of Markdown; the pipe and the line break would end it."""
    return text.replace("|", "\\|").replace("<", "&lt;").replace("\n", " ")
