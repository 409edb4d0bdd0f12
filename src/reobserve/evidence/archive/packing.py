"""The archive as a file: what a build made, what it was made from, and a crate's description."""

from __future__ import annotations

import hashlib
import json
import zipfile
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path

from reobserve.evidence.archive.crate import DESCRIPTION, described
from reobserve.evidence.archive.records import Record, records
from reobserve.plain_data.files import read_bytes, write_whole

# What `sha256sum --check` takes.
MANIFEST = "manifest-sha256.txt"

# Beside the results: what they were made from, and how to run and to cite it.
_FOLDERS = ("config", "workflow")
_FILES = (
    "CHANGELOG.md", "CITATION.cff", "LICENSE", "README.md", "Snakefile", "codemeta.json",
    "requirements.lock", "results/README.md",
)  # fmt: skip

# Of files in which it is compressed already.
_DENSE = (".parquet", ".png", ".pdf")
_LONG_AGO = (1980, 1, 1, 0, 0, 0)


def write_archive(project: Path, output: Path, products: Sequence[str]) -> int:
    """Write a build to a zip file, the same bytes for the same build; the number of files in it.

    ``products`` are the files below ``results`` that somebody looks at; what they were made from
    is found by the logs.

    Raises
    ------
    InputError
        If the build is not whole, see `records`, or the file cannot be written.
    """
    ran = records(project, products)
    digests = {
        path: hashlib.sha256(read_bytes(project / path)).hexdigest()
        for path in sorted({*products, *_packed(project, ran)})
    }
    told = json.dumps(described(project, ran, digests, products), indent=1, ensure_ascii=False)
    manifest = "".join(f"{digest}  {path}\n" for path, digest in digests.items())
    made = {DESCRIPTION: f"{told}\n".encode(), MANIFEST: manifest.encode()}
    write_whole(output, lambda partial: _write(partial, project, made, digests))
    return len(digests)


def _packed(project: Path, ran: Iterable[Record]) -> Iterator[str]:
    for record in ran:
        yield from (*record.inputs, *record.job.outputs, record.job.log)
        if (project / record.job.benchmark).is_file():
            yield record.job.benchmark
    yield from (path for path in _FILES if (project / path).is_file())
    for folder in _FOLDERS:
        for path in (project / folder).rglob("*"):
            if path.is_file() and "__pycache__" not in path.parts:
                yield path.relative_to(project).as_posix()


def _write(partial: Path, project: Path, made: Mapping[str, bytes], paths: Iterable[str]) -> None:
    with zipfile.ZipFile(partial, "w") as archive:
        for path in (*made, *paths):
            about = zipfile.ZipInfo(path, _LONG_AGO)
            about.external_attr = 0o100644 << 16
            dense = path.endswith(_DENSE)
            about.compress_type = zipfile.ZIP_STORED if dense else zipfile.ZIP_DEFLATED
            archive.writestr(about, made.get(path) or read_bytes(project / path))
