"""A build as a file to deposit and cite: an RO-Crate, zipped.

`records` finds what ran and whether that is what stands there, `crate` describes it in the terms of
Workflow Run RO-Crate, `packing` writes the file, the same bytes for the same build.
"""

from reobserve.evidence.archive.packing import write_archive

__all__ = ["write_archive"]
