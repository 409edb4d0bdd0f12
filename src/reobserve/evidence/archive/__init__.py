"""A build as a file to deposit and cite: an RO-Crate, zipped.

`records` finds the jobs that ran by their logs, `crate` describes it in the terms of
Workflow Run RO-Crate, `packing` writes the file, the same bytes for the same build.
"""

from reobserve.evidence.archive.packing import write_archive

__all__ = ["write_archive"]
