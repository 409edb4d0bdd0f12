"""Under which processor and versions figures were made, and the file that keeps it."""

from __future__ import annotations

import json
import platform
from pathlib import Path

from reobserve.evidence.figure_diff.model import Origin
from reobserve.evidence.report.environment import environment
from reobserve.plain_data.documents import read_json
from reobserve.plain_data.files import write_text
from reobserve.plain_data.validation import parse
from reobserve.replication.provenance import versions

FILE = "versions.json"


def origin_here(project: Path) -> Origin:
    """The origin of what is built and compared in this process."""
    values = {
        "processor": dict(environment(project)).get("processor", ""),
        "C library": " ".join(platform.libc_ver()).strip(),
        "Python": platform.python_version(),
    }
    known = {name: value for name, value in values.items() if value}
    return Origin({**known, **versions()})


def read_origin(reference: Path) -> Origin:
    """The origin of the reference figures; `InputError` if its file is missing or damaged."""
    path = reference / FILE
    return parse(Origin, {"values": read_json(path)}, str(path))


def write_origin(reference: Path, origin: Origin) -> None:
    """Keep the origin beside the reference figures."""
    text = json.dumps(origin.values, indent=1, ensure_ascii=False)
    write_text(reference / FILE, text + "\n")
