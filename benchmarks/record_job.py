"""Stands in for ``reobserve``: does the job and notes what it imported and what it made.

Run as a script, with the folder for the notes in ``BENCHMARK_NOTES``.
"""

from __future__ import annotations

import json
import os
import sys
import zlib
from pathlib import Path

from reobserve.cli import main


def third_party() -> list[str]:
    """The modules imported so far that come with neither Python nor this project, in order."""
    own = {"reobserve", "__main__", *sys.stdlib_module_names}
    return [
        name
        for name, module in list(sys.modules.items())
        if name.partition(".")[0] not in own and getattr(module, "__spec__", None) is not None
    ]


if __name__ == "__main__":
    arguments = sys.argv[1:]
    missing = [word for word in arguments if not Path(word).exists()]
    status = main(arguments)
    note = {
        "stage": arguments[0],
        "modules": third_party(),
        "made": [word for word in missing if Path(word).is_file()],
    }
    # The command line names the job; both sides must find the same name without an import.
    key = zlib.crc32(" ".join(arguments).encode())
    Path(os.environ["BENCHMARK_NOTES"], f"{key}.json").write_text(json.dumps(note))
    sys.exit(status)
