"""`codemeta.json`, made from its neighbours: `python -m tests.package.metadata` writes it."""

from __future__ import annotations

import json
import tomllib
from pathlib import Path
from typing import Any

import yaml

ROOT = Path(__file__).parents[2]
CODEMETA = ROOT / "codemeta.json"


def project() -> dict[str, Any]:
    """What pyproject.toml says of the project."""
    read: dict[str, Any] = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    told: dict[str, Any] = read["project"]
    return told


def citation() -> dict[str, Any]:
    """What CITATION.cff says."""
    read: dict[str, Any] = yaml.safe_load((ROOT / "CITATION.cff").read_text(encoding="utf-8"))
    return read


def codemeta() -> str:
    """The text of codemeta.json, in the terms of CodeMeta 3."""
    about, cited = project(), citation()
    told = {
        "@context": "https://w3id.org/codemeta/3.0",
        "@type": "SoftwareSourceCode",
        "name": about["name"],
        "description": about["description"],
        "version": about["version"],
        "dateModified": str(cited["date-released"]),
        "license": f"https://spdx.org/licenses/{about['license']}",
        "author": [{"@type": "Organization", "name": one["name"]} for one in about["authors"]],
        "keywords": about["keywords"],
        "programmingLanguage": "Python",
        "runtimePlatform": f"Python {about['requires-python']}",
        "softwareRequirements": about["dependencies"],
        "referencePublication": [_article(reference) for reference in cited["references"]],
    }
    return json.dumps(told, indent=2, ensure_ascii=False) + "\n"


def _article(reference: dict[str, Any]) -> dict[str, str]:
    place = {"@id": f"https://doi.org/{reference['doi']}"} if "doi" in reference else {}
    return {"@type": "ScholarlyArticle", **place, "name": reference["title"]}


if __name__ == "__main__":
    CODEMETA.write_text(codemeta(), encoding="utf-8")
