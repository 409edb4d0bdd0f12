"""A build as a file to deposit and cite: a Workflow Run RO-Crate, zipped.

Each job is an action with its command, its inputs and its outputs, as the logs have them.
https://www.researchobject.org/workflow-run-crate/ says what the terms are.
"""

from __future__ import annotations

import hashlib
import io
import mimetypes
from collections.abc import Iterable, Iterator, Sequence
from datetime import UTC, datetime, timedelta
from importlib import metadata
from pathlib import Path
from typing import Any

from reobserve.core.documents import read_yaml
from reobserve.core.errors import InputError
from reobserve.core.extras import package
from reobserve.core.files import read_bytes, read_text, write_whole
from reobserve_papers.report.environment import environment, package_versions
from reobserve_papers.report.logs import LoggedJob, jobs_behind

_WORKFLOWS = ("workflow/Snakefile", "Snakefile")  # the second one where papers have their own
_RUN = "https://w3id.org/ro/wfrun"
_PROFILES = {
    "Process Run Crate": f"{_RUN}/process/0.5",
    "Workflow Run Crate": f"{_RUN}/workflow/0.5",
}

_SOFTWARE = "SoftwareApplication"

# Beside the results: what they were made from, and how to run and to cite it.
_BESIDE = (
    "CHANGELOG.md", "CITATION.cff", "LICENSE", "README.md", "Snakefile", "codemeta.json",
    "requirements.lock", "results/README.md", "config", "workflow",
)  # fmt: skip


def write_archive(project: Path, output: Path, products: Sequence[str]) -> int:
    """Write a build to a zip file, the same bytes for the same build, and count its files.

    ``products`` are the files below ``results`` that somebody looks at; the logs say what they
    were made from. `manifest-sha256.txt` in the file is what `sha256sum --check` takes.
    """
    jobs = jobs_behind(project, products)
    for path in (*products, *(path for job in jobs for path in job.outputs)):
        if not (project / path).is_file():
            raise InputError(
                path, "is missing, so the build is not whole; build again with `make archive`"
            )
    crate = package("rocrate.rocrate", "archive a build").ROCrate(version="1.1")
    paths = sorted({*products, *_packed(project, jobs)})
    workflow = next((path for path in _WORKFLOWS if path in paths), "")
    if not workflow:
        raise InputError("Snakefile", "is missing, must be in the project")
    files = {path: _file(crate, project, path, path == workflow) for path in paths}
    digests = [hashlib.sha256(read_bytes(project / path)).hexdigest() for path in paths]
    manifest = "".join(f"{sha}  {path}\n" for sha, path in zip(digests, paths, strict=True))
    crate.add_file(io.StringIO(manifest), "manifest-sha256.txt")
    ended = max(_ended(project, job) for job in jobs)
    _describe(crate, project, ended)
    software = [
        _entity(crate, _local(name), _SOFTWARE, name, softwareVersion=version)
        for name, version in package_versions().items()
    ]
    needs = {"softwareRequirements": [{"@id": one.id} for one in software]}
    for job in jobs:
        name = job.log.removeprefix("logs/").removesuffix(".log")
        command = f"reobserve-papers stage {job.step}"
        crate.add_action(
            _entity(crate, _local(command), _SOFTWARE, command, **needs),
            identifier=f"#{name.replace('/', '-')}",
            object=[files[path] for path in job.inputs if path in files],
            result=[files[path] for path in job.outputs],
            properties={"name": name, "description": job.command, **_times(project, job)},
        )
    made = {path for job in jobs for path in job.outputs}
    read = {path for job in jobs for path in job.inputs if path in files} - made
    crate.add_action(
        files[workflow],
        identifier="#build",
        object=[files[path] for path in paths if path in read or path.startswith("config/")],
        result=[files[path] for path in products],
        properties={
            "name": "snakemake",
            "description": "; ".join(map(": ".join, environment(project).items())),
            "endTime": ended.isoformat(),
        },
    )
    write_whole(output, crate.write_zip)
    print(f"{output}: {len(paths)} files, described in its ro-crate-metadata.json")
    return len(paths)


def _packed(project: Path, jobs: Iterable[LoggedJob]) -> Iterator[str]:
    """The files of the jobs and what stands beside the results, as far as they are there."""
    named = [path for job in jobs for path in (*job.inputs, *job.outputs, job.log, job.benchmark)]
    beside = [file for path in map(project.joinpath, _BESIDE) for file in (path, *path.rglob("*"))]
    for file in (*map(project.joinpath, named), *beside):
        ours = file.is_relative_to(project)  # and no text that is shared by all projects
        if ours and file.is_file() and "__pycache__" not in file.parts:
            yield file.relative_to(project).as_posix()


def _file(crate: Any, project: Path, path: str, workflow: bool) -> Any:
    about = {"name": path, "encodingFormat": mimetypes.guess_type(path)[0] or "text/plain"}
    if not workflow:
        return crate.add_file(project / path, path, properties=about, record_size=True)
    about["name"] = "Every figure, table and claim"
    return crate.add_workflow(
        project / path, path, main=True, lang="snakemake",
        lang_version=metadata.version("snakemake"), properties=about, record_size=True,
    )  # fmt: skip


def _describe(crate: Any, project: Path, ended: datetime) -> None:
    """Describe the whole: the profiles it conforms to, and what CITATION.cff says of it, if any."""
    path, root = project / "CITATION.cff", crate.root_dataset
    citation = read_yaml(path) if path.is_file() else {}
    root["name"] = citation.get("title", f"A build of {project.resolve().name}")
    root["description"] = "A build: figures, tables, claims and the report, and how they were made."
    root["datePublished"] = ended.isoformat()
    if "version" in citation:
        root["version"] = citation["version"]
    if "keywords" in citation:
        root["keywords"] = ", ".join(citation["keywords"])
    if "license" in citation:
        licence = f"https://spdx.org/licenses/{citation['license']}"
        root["license"] = _entity(crate, licence, "CreativeWork", citation["license"])
    for one in citation.get("authors", []):
        kind = "Organization" if "name" in one else "Person"
        parts = (one.get(key) for key in ("name", "given-names", "family-names"))
        name = " ".join(filter(None, parts))
        root.append_to("author", _entity(crate, _local(name), kind, name))
    for name, address in _PROFILES.items():
        profile = _entity(crate, address, "CreativeWork", name, version="0.5")
        root.append_to("conformsTo", profile)


def _entity(crate: Any, identifier: str, kind: str, name: str, **about: Any) -> Any:
    """The crate's entity of something that is no file, the same each time."""
    about = {"@id": identifier, "@type": kind, "name": name, **about}
    return crate.get(identifier) or crate.add_jsonld(about)


def _local(name: str) -> str:
    return f"#{name.replace(' ', '-')}"


def _ended(project: Path, job: LoggedJob) -> datetime:
    """The time when the last file of a job was written."""
    written = max((project / path).stat().st_mtime for path in job.outputs)
    return datetime.fromtimestamp(int(written), UTC)


def _times(project: Path, job: LoggedJob) -> dict[str, str]:
    """The times when a job ended and, if Snakemake measured its duration, when it began."""
    ended, measured = _ended(project, job), project / job.benchmark
    if not measured.is_file():
        return {"endTime": ended.isoformat()}
    seconds = float(read_text(measured).splitlines()[1].partition("\t")[0])
    began = ended - timedelta(seconds=seconds)
    return {"startTime": began.isoformat(), "endTime": ended.isoformat()}
