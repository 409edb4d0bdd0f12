"""A build in the terms of Workflow Run RO-Crate: each job an action, with inputs and outputs.

https://www.researchobject.org/workflow-run-crate/ says what these terms are.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from datetime import datetime
from importlib import metadata
from pathlib import Path
from typing import Any

from reobserve.evidence.archive.records import Record
from reobserve.evidence.report.environment import environment, package_versions
from reobserve.extras import package
from reobserve.ledger.config import read_yaml

# The names of files that the crate has at its top.
DESCRIPTION = "ro-crate-metadata.json"
WORKFLOW = "workflow/Snakefile"
_PROFILES = {
    "https://w3id.org/ro/wfrun/process/0.5": "Process Run Crate",
    "https://w3id.org/ro/wfrun/workflow/0.5": "Workflow Run Crate",
    "https://w3id.org/workflowhub/workflow-ro-crate/1.0": "Workflow RO-Crate",
}
_MEDIA = {
    ".csv": "text/csv", ".eps": "application/postscript", ".html": "text/html",
    ".json": "application/json", ".md": "text/markdown", ".parquet":
    "application/vnd.apache.parquet", ".pdf": "application/pdf", ".png": "image/png",
    ".svg": "image/svg+xml", ".tsv": "text/tab-separated-values", ".yaml": "application/yaml",
}  # fmt: skip


def described(
    project: Path,
    records: Sequence[Record],
    digests: Mapping[str, str],
    products: Sequence[str],
) -> Mapping[str, Any]:
    """The metadata of the crate, as JSON-LD.

    Parameters
    ----------
    project
        The folder that paths are relative to.
    records
        The jobs that ran.
    digests
        By its path, the SHA-256 of each file that is packed.
    products
        The files that somebody looks at.

    Raises
    ------
    InputError
        If rocrate is not installed, or `CITATION.cff` cannot be read.
    """
    crate = package("rocrate.rocrate", "archive a build").ROCrate(version="1.1")
    crate.metadata.extra_terms["sha256"] = "https://schema.org/sha256"
    citation = read_yaml(project / "CITATION.cff")
    files = {path: _file(crate, project, path, value) for path, value in digests.items()}
    _describe_root(crate, citation, max(record.ended for record in records))
    packages = [
        _entity(crate, f"#{name}", "SoftwareApplication", name=name, softwareVersion=version)
        for name, version in package_versions().items()
    ]
    stages = {
        stage: _entity(
            crate, f"#reobserve-stage-{stage}", "SoftwareApplication",
            name=f"reobserve stage {stage}", softwareVersion=citation["version"],
            softwareRequirements=packages,
        )
        for stage in dict.fromkeys(record.job.step for record in records)
    }  # fmt: skip
    for record in records:
        crate.add_action(
            stages[record.job.step],
            identifier=f"#{record.name.replace('/', '-')}",
            object=[files[path] for path in record.inputs],
            result=[files[path] for path in record.job.outputs],
            properties={
                "name": record.name,
                "description": record.job.command,
                **_times(record.began, record.ended),
            },
        )
    _describe_run(crate, project, records, [files[path] for path in products], files)
    told: dict[str, Any] = crate.metadata.generate()
    told["@graph"].sort(key=lambda entity: str(entity["@id"]))
    return told


def _file(crate: Any, project: Path, path: str, digest: str) -> Any:
    about = {
        "contentSize": str((project / path).stat().st_size),
        "sha256": digest,
        "encodingFormat": _MEDIA.get(Path(path).suffix, "text/plain"),
    }
    if path == WORKFLOW:
        version = metadata.version("snakemake")
        about |= {"name": "Every figure, table and claim"}
        return crate.add_workflow(
            project / path, path, main=True, lang="snakemake", lang_version=version,
            properties=about,
        )  # fmt: skip
    return crate.add_file(project / path, path, properties={"name": path, **about})


def _entity(crate: Any, identifier: str, kind: str, **properties: Any) -> Any:
    from rocrate.model.contextentity import ContextEntity

    return crate.add(ContextEntity(crate, identifier, {"@type": kind, **_plain(properties)}))


def _plain(properties: Mapping[str, Any]) -> dict[str, Any]:
    """Entities as what points at them."""
    return {
        key: [{"@id": one.id} for one in value] if isinstance(value, list) else value
        for key, value in properties.items()
    }


def _describe_root(crate: Any, citation: Mapping[str, Any], ended: datetime) -> None:
    root = crate.root_dataset
    root["name"] = citation["title"]
    root["description"] = "A build: figures, tables, claims and the report, and how they were made."
    root["version"] = citation["version"]
    root["datePublished"] = ended.isoformat()
    root["keywords"] = ", ".join(citation["keywords"])
    licence = f"https://spdx.org/licenses/{citation['license']}"
    root["license"] = _entity(crate, licence, "CreativeWork", name=citation["license"])
    root["author"] = [
        _entity(crate, f"#{author['name'].replace(' ', '-')}", "Organization", name=author["name"])
        for author in citation["authors"]
    ]
    root["citation"] = [_article(crate, reference) for reference in citation["references"]]
    root["conformsTo"] = [
        _entity(crate, address, "CreativeWork", name=name, version=address.rpartition("/")[2])
        for address, name in _PROFILES.items()
    ]


def _article(crate: Any, reference: Mapping[str, Any]) -> Any:
    title = str(reference["title"])
    place = f"https://doi.org/{reference['doi']}" if "doi" in reference else None
    people = (f"{one['given-names']} {one['family-names']}" for one in reference["authors"])
    told = {"name": title, "author": ", ".join(people)}
    if "year" in reference:
        told["datePublished"] = str(reference["year"])
    return _entity(crate, place or f"#{title.replace(' ', '-')}", "ScholarlyArticle", **told)


def _describe_run(
    crate: Any,
    project: Path,
    records: Sequence[Record],
    products: Sequence[Any],
    files: Mapping[str, Any],
) -> None:
    """The build as one action: from what no job made to what readers look at."""
    made = {path for record in records for path in record.job.outputs}
    read = {path for one in records for path in one.inputs if path not in made}
    read |= {path for path in files if path.startswith("config/")}
    began = [record.began for record in records if record.began is not None]
    crate.add_action(
        files[WORKFLOW],
        identifier="#build",
        object=[files[path] for path in sorted(read)],
        result=products,
        properties={
            "name": "snakemake",
            "description": "; ".join(map(": ".join, environment(project).items())),
            **_times(min(began, default=None), max(record.ended for record in records)),
        },
    )


def _times(began: datetime | None, ended: datetime) -> dict[str, str]:
    times = {"endTime": ended.isoformat()}
    return times if began is None else {"startTime": began.isoformat(), **times}
