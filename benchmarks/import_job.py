"""Stands in for ``reobserve``: imports what the real job imported and copies what it made.

Run as a script, with the notes of ``record_job.py`` in ``BENCHMARK_NOTES`` and the files of the
real build in ``BENCHMARK_REFERENCE``. It imports as little as possible beside that.
"""

from __future__ import annotations

import json
import os
import sys
import zlib
from importlib import import_module

from reobserve.numerics.code_paths import pin_code_paths

# As the real command line does it: starting the threads of BLAS takes time, too.
pin_code_paths()

key = zlib.crc32(" ".join(sys.argv[1:]).encode())
with open(os.path.join(os.environ["BENCHMARK_NOTES"], f"{key}.json")) as stream:
    note = json.load(stream)
for name in note["modules"]:
    # Some modules are made by others while they run and cannot be imported by name.
    try:
        import_module(name)
    except Exception:
        continue
for path in note["made"]:
    os.makedirs(os.path.dirname(path) or ".", exist_ok=True)
    with open(os.path.join(os.environ["BENCHMARK_REFERENCE"], path), "rb") as source:
        content = source.read()
    with open(path, "wb") as target:
        target.write(content)
