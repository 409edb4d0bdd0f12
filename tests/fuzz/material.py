"""Valid examples of everything that is read: the project's own config, and what is made of it.

Each is made once in a process, by the command that makes it for users.
"""

from __future__ import annotations

import copy
import csv
import io
import json
import tempfile
from functools import cache
from pathlib import Path
from typing import Any

from reobserve.ledger.ledger import Ledger
from reobserve.plain_data.documents import read_yaml
from tests import FIVE

from .case import command

ROOT = Path(__file__).parents[2]
PAPERS = FIVE

# An observer of each paper, the scenario that it looks at and the design that it needs.
OBSERVERS = {
    "ilo": ("constant", "sampled", None),
    "lie": ("figure", "order4", "linear"),
    "delay": ("ramp", "order2", None),
    "imm": ("plain", "kalman", None),
    "eso": ("disturbed", "pd_pi", "pd_pi"),
}


@cache
def _folder() -> Path:
    return Path(tempfile.mkdtemp(prefix="fuzz-material-"))


@cache
def _config(path: str) -> Any:
    return read_yaml(ROOT / path)


def config(path: str) -> Any:
    """A YAML file of the project as a tree of one's own."""
    return copy.deepcopy(_config(path))


def paper_tree(paper: str) -> Any:
    """The config of a paper as a tree of one's own."""
    return config(f"config/papers/{paper}.yaml")


@cache
def ledger(paper: str) -> Ledger:
    """The ledger of a paper."""
    return Ledger.load(ROOT, paper)


@cache
def ledger_file(paper: str) -> Path:
    """The ledger of a paper as the command line writes it."""
    path = _folder() / f"{paper}.parameters.json"
    path.write_text(ledger(paper).text(), encoding="utf-8")
    return path


@cache
def record(paper: str) -> Path:
    """The plant's record of the scenario of `OBSERVERS`."""
    path = _folder() / f"{paper}.plant.parquet"
    command("stage", "plant", ledger_file(paper), OBSERVERS[paper][0], "--output", path)
    return path


@cache
def design(paper: str, name: str) -> Path:
    """A design of a paper."""
    path = _folder() / f"{paper}.{name}.design.json"
    command("stage", "design", ledger_file(paper), name, "--output", path)
    return path


@cache
def estimates(figure: str) -> list[Path]:
    """What the observers of a figure of `lie` make of the record."""
    body = ledger("lie").tree["figures"][figure]
    made = []
    for observer in body["observers"]:
        path = _folder() / f"lie.{observer}.parquet"
        named = design("lie", ledger("lie").section("observers", observer)["design"])
        chosen = ["--design-file", named, "--output", path]
        command("stage", "observe", ledger_file("lie"), record("lie"), observer, *chosen)
        made.append(path)
    return made


@cache
def study() -> Path:
    """A study of `lie`: its orders."""
    path = _folder() / "lie.orders.study.csv"
    made = ["--design-file", design("lie", "linear"), "--output", path]
    command("stage", "study", ledger_file("lie"), record("lie"), "orders", *made)
    return path


@cache
def claims_table() -> Path:
    """The verdicts on the claims of `eso`, without their robustness."""
    path, results = _folder() / "claims.csv", _folder() / "results"
    (results / "eso").mkdir(parents=True)
    (results / "eso" / "parameters.json").write_bytes(ledger_file("eso").read_bytes())
    nothing = {"paper": "eso", "seed": 0, "draws": 1, "claims": {}}
    (results / "eso" / "robustness.json").write_text(json.dumps(nothing))
    for figure in (*ledger("eso").tree["figures"], "theory"):
        (results / "eso" / f"{figure}.metrics.csv").write_bytes(metrics("eso", figure))
    command("stage", "claims", "eso", "--results", results, "--project", ROOT, "--output", path)
    return path


@cache
def metrics(paper: str, figure: str) -> bytes:
    """The table of a figure's numbers: the golden ones, without what judges them."""
    text = (ROOT / f"tests/golden/{paper}/{figure}.metrics.csv").read_text(encoding="utf-8")
    out = io.StringIO()
    writer = csv.writer(out, lineterminator="\n")
    writer.writerows(row[:4] for row in csv.reader(io.StringIO(text)))
    return out.getvalue().encode()


def scratch(name: str) -> Path:
    """A file that is nobody else's."""
    return _folder() / name


def here() -> Path:
    """The folder of the case that runs."""
    return Path.cwd()
