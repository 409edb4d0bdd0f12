"""Under which processor and versions figures were made, and the file that keeps it."""

from __future__ import annotations

import json
import platform
from pathlib import Path

from reobserve.errors import InputError
from reobserve.figure_diff.model import Origin
from reobserve.files import write_text
from reobserve.provenance import versions
from reobserve.replication_report.environment import environment

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
    try:
        stored = json.loads(path.read_text(encoding="utf-8"))
        return Origin({str(name): str(value) for name, value in stored.items()})
    except OSError as error:
        raise InputError(str(path), f"cannot be read ({error.strerror})") from None
    except (ValueError, AttributeError):
        raise InputError(str(path), "is damaged; it must hold one JSON object") from None


def write_origin(reference: Path, origin: Origin) -> None:
    """Keep the origin beside the reference figures."""
    text = json.dumps(origin.values, indent=1, ensure_ascii=False)
    write_text(reference / FILE, text + "\n")
