"""The content of the wheel: both packages, and the files that `replicate` reads."""

from __future__ import annotations

import email.parser
import re
import subprocess

from tests import ROOT

DATA = (
    "config/config.yaml", "config/papers", "config/searches", "config/styles", "examples/two_mass",
    "workflow",
)  # fmt: skip


def tracked(*folders: str) -> dict[str, bytes]:
    words = ["git", "ls-files", "--cached", "--others", "--exclude-standard", "--", *folders]
    listed = subprocess.run(words, cwd=ROOT, capture_output=True, text=True, check=True).stdout
    paths = {name: ROOT / name for name in listed.splitlines()}
    return {name: path.read_bytes() for name, path in paths.items() if path.is_file()}


def test_wheel_holds_only_the_packages_and_their_data(wheel: dict[str, bytes]) -> None:
    modules = {name.removeprefix("src/"): text for name, text in tracked("src").items()}
    data = {f"reobserve_papers/project/{name}": text for name, text in tracked(*DATA).items()}
    found = {name: text for name, text in wheel.items() if ".dist-info/" not in name}
    assert found == modules | data
    assert {"reobserve/py.typed", "reobserve_papers/py.typed"} <= set(found)


def test_readme_on_the_package_index_has_no_relative_links(wheel: dict[str, bytes]) -> None:
    (about,) = (text for name, text in wheel.items() if name.endswith(".dist-info/METADATA"))
    text = email.parser.BytesParser().parsebytes(about).get_payload()
    links = re.findall(r"\]\(([^)]*)\)", str(text))
    assert all(link.startswith(("https://", "#")) for link in links)
