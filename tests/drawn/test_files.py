"""Files: one or several changes of a key, a value or a byte end in one sentence or a result.

Commands run in this process. A refused one leaves all files as they are, and none half-written.
What has a digest is refused if it was changed, or gives the result that it gave before.
"""

from __future__ import annotations

import csv
import hashlib
import json
import re
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from functools import cache, cached_property, partial
from io import StringIO
from itertools import zip_longest
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from reobserve.core.documents import parse_yaml, read_yaml
from reobserve.estimation.families import FAMILIES
from reobserve.estimation.families.examples import model_text
from reobserve_papers.claims.configuration_checks import check_evidence
from reobserve_papers.golden.comparison import compare
from reobserve_papers.golden.number_files import golden_file, read_numbers
from reobserve_papers.parameters.parameters import Parameters
from reobserve_papers.parameters.prepare import load_parameters
from reobserve_papers.signals.inputs import Signal
from tests import ROOT
from tests.reobserve.bad_input import valid
from tests.reobserve.bad_input.odd import CSV, YAML, as_json, as_yaml, bomb, changed, damaged
from tests.reobserve.bad_input.outcome import command, is_accepted
from tests.reobserve_papers.bad_input import outcome
from tests.reobserve_papers.bad_input import valid as papers

from . import times


@dataclass(frozen=True)
class Reader:
    """A reader of a file: ``tree`` or ``content`` is valid, ``others`` are files next to it.

    ``seal`` gives a changed tree the digest of its content.
    """

    file: str
    call: Callable[[], object]
    tree: Any = None
    content: bytes = b""
    others: Mapping[str, bytes] = field(default_factory=dict)
    is_accepted: Callable[..., bool] = is_accepted
    seal: Callable[[Any], Any] = lambda tree: tree

    def accepts(self, content: bytes) -> bool:
        """Whether other content of the file is accepted."""
        return self.result(content) is not None

    def result(self, content: bytes) -> Any:
        """What is returned and written for other content of the file, or None if it is refused."""
        files, made = {**self.others, self.file: content}, list[Any]()

        def call() -> None:
            found = self.call()
            paths = [one for one in Path().rglob("*.*") if one.is_file() and not one.is_symlink()]
            new = {str(one): one.read_bytes() for one in paths}
            made.append((found, {k: new[k] for k in sorted(new) if new[k] != files.get(k)}))

        self.is_accepted(call, files)
        return made[0] if made else None

    @cached_property
    def valid(self) -> bytes:
        """The valid file."""
        return self.content or self.dumped(self.tree)

    def dumped(self, tree: Any) -> bytes:
        """A tree in the format of the file."""
        return as_json(self.seal(tree)) if self.file.endswith(".json") else as_yaml(tree)


def words(*line: object) -> Callable[[], object]:
    return lambda: command(*line)


def design(kind: str) -> Reader:
    line = words("export", "in.json", "--to", "c", "--out", "code")
    return Reader("in.json", line, json.loads(valid.saved_design(kind)))


def model(kind: str) -> Reader:
    line = words("design", kind, "in.yaml", "--out", "out.json")
    return Reader("in.yaml", line, parse_yaml(model_text(kind), "in.yaml"))


def specification(name: str) -> Reader:
    line = words("estimate", "in.yaml", "r.csv", "--out", "e.csv", "--report", "e.json")
    others = {"r.csv": valid.csv_record(name)}
    return Reader("in.yaml", line, valid.specification(name), others=others)


def smoothed(name: str) -> Reader:
    line = words("estimate", "in.yaml", "r.csv", "--out", "e.csv", "--plot", "e.png")
    one = specification(name)
    return replace(one, call=line, tree={**one.tree, "smooth": True})


def estimated_record(name: str) -> Reader:
    line = words("estimate", "s.yaml", "in.csv", "--out", "e.csv", "--report", "e.json")
    others = {"s.yaml": as_yaml(valid.specification(name))}
    return Reader("in.csv", line, content=valid.csv_record(name), others=others)


def streamed_record(name: str) -> Reader:
    line = ("estimate", "s.yaml", "--stream")
    read = lambda: command(*line, stdin=Path("in.csv").read_bytes())  # noqa: E731
    return replace(estimated_record(name), call=read)


def resumed(name: str) -> object:
    """Go on with a stream from its state in a file."""
    header, *rows = valid.csv_record(name).splitlines(keepends=True)
    half = rows[:30] if not Path("in.json").exists() else rows[30:]
    stdin = b"".join([header, *half])
    return command("estimate", "s.yaml", "--stream", "--state", "in.json", stdin=stdin)


@cache
def state(name: str) -> bytes:
    """The state file of a stream that has read half of a record."""
    files, made = {"s.yaml": as_yaml(valid.specification(name))}, list[bytes]()
    is_accepted(lambda: (resumed(name), made.append(Path("in.json").read_bytes())), files)
    return made[0]


def sealed(tree: Any) -> Any:
    """With the digest of the content, as a state file has it."""
    if not isinstance(tree, dict):
        return tree
    whole = {name: part for name, part in tree.items() if name != "digest"}
    digest = hashlib.sha256(json.dumps(whole, sort_keys=True).encode()).hexdigest()
    return {**whole, "digest": digest}


def state_file(name: str) -> Reader:
    others = {"s.yaml": as_yaml(valid.specification(name))}
    return Reader(
        "in.json", partial(resumed, name), json.loads(state(name)), others=others, seal=sealed
    )


OfPaper = partial(Reader, is_accepted=outcome.is_accepted)
CLAIMS = ("stage", "claims", "results/eso/parameters.json")


def lines(*line: object) -> Callable[[], object]:
    return lambda: outcome.command(*line)


def _unsealed(content: bytes) -> dict[str, Any]:
    """Without the digest, by which whatever else is damaged would be refused."""
    tree: dict[str, Any] = json.loads(content)
    return {name: part for name, part in tree.items() if name != "sha256"}


def parameter_file(paper: str) -> Reader:
    line = lines("stage", "parameters", paper, "--project", ".", "--output", "out.json")
    return OfPaper(f"config/papers/{paper}.yaml", line, papers.paper(paper))


def checked_file(path: str) -> Reader:
    tree = papers.tree(path) if path.endswith("yaml") else json.loads((ROOT / path).read_bytes())
    return OfPaper(path, lines("check", "eso", "--project", "."), tree)


def project_settings(path: str) -> Reader:
    return OfPaper(path, lambda: load_parameters(Path(), read_yaml(Path(path))), papers.tree(path))


def conventions(path: str) -> Reader:
    check = lambda: check_evidence(Path(), Parameters.load(Path(), "eso"))  # noqa: E731
    return OfPaper(path, check, papers.tree(path))


def claims(path: str) -> Reader:
    return OfPaper(path, lines(*CLAIMS), papers.tree(path), others=papers.results())


def result(name: str) -> Reader:
    path = f"results/eso/{name}"
    content = papers.results()[path]
    if name.endswith(".json"):
        return OfPaper(path, lines(*CLAIMS), _unsealed(content), others=papers.results())
    return OfPaper(path, lines(*CLAIMS), content=content, others=papers.results())


def claims_table(path: str) -> Reader:
    line = lines("stage", "verdicts", "results/eso/parameters.json")
    names = ("results/eso/parameters.json", "results/eso/alternatives.csv")
    others = {name: papers.results()[name] for name in names}
    return OfPaper(path, line, content=papers.claims_table(), others=others)


def errata(path: str) -> Reader:
    line = lines("report", "--papers", "lie", "--project", ".", "--output", "report.html")
    return OfPaper(path, line, papers.tree(path))


def stored_parameters(paper: str) -> Reader:
    path = f"results/{paper}/parameters.json"
    line = lines("stage", "plant", path, papers.OBSERVERS[paper][0])
    return OfPaper(path, line, json.loads(papers.parameters(paper).read_bytes()))


def paper_design(paper: str) -> Reader:
    scenario, observer, name = papers.OBSERVERS[paper]
    line = lines("stage", "observe", f"results/{paper}/parameters.json", scenario, observer)
    others = papers.beside(papers.parameters(paper), papers.record(paper))
    ((path, content),) = papers.beside(papers.design(paper, name)).items()
    return OfPaper(path, line, _unsealed(content), others=others)


def observed_record(paper: str) -> Reader:
    scenario, observer, name = papers.OBSERVERS[paper]
    line = lines("stage", "observe", f"results/{paper}/parameters.json", scenario, observer)
    designs = [papers.design(paper, name)] if name else []
    ((path, content),) = papers.beside(papers.record(paper)).items()
    others = papers.beside(papers.parameters(paper), *designs)
    return OfPaper(path, line, content=content, others=others)


def signal_samples(path: str) -> Reader:
    def read() -> None:
        term = {"kind": "samples", "axis": 1, "file": path, "column": "torque"}
        values = Signal.parse("fault", [term], 1)(np.linspace(0.0, 3.0, 50))
        assert np.isfinite(values).all()

    return OfPaper(path, read, content=b"time,torque\n0,0\n0.5,0.1\n1.0,-0.2\n2.5,1e-3\n")


def golden_numbers(part: str) -> Reader:
    path = golden_file(ROOT, "eso", part)
    built = read_numbers(path)

    def read() -> None:
        moved = compare(read_numbers(Path("in.csv")), built, "eso")
        assert all(str(one) for one in moved)

    return OfPaper("in.csv", read, content=path.read_bytes())


def study_table(path: str) -> Reader:
    study, others = papers.study()
    line = lines("stage", "metrics", "results/lie/parameters.json", path)
    ((name, content),) = papers.beside(study).items()
    files = papers.beside(papers.parameters("lie"), *others)
    return OfPaper(name, line, content=content, others=files)


ESTIMATED = (
    "kalman", "levant", "eso", "adaptive-pi", "luenberger-gain", "svsf", "extended-kalman",
    "unscented-kalman",
)  # fmt: skip
QUICK = [kind for kind in FAMILIES if kind != "eso"]  # other choices take a solver seconds
READERS: dict[Callable[[str], Reader], list[str]] = {
    design: QUICK,
    model: QUICK,
    specification: [*ESTIMATED],
    smoothed: ["kalman", "augmented-kalman", "unscented-kalman"],
    estimated_record: [*ESTIMATED],
    streamed_record: [*ESTIMATED],
    state_file: [*ESTIMATED],
    parameter_file: [*papers.PAPERS],
    checked_file: ["config/papers/eso.yaml", "config/samples/eso.json"],
    project_settings: ["config/config.yaml"],
    conventions: ["config/conventions.yaml"],
    claims: ["config/claims/eso.yaml"],
    result: ["fig2.metrics.csv", "robustness.json", "alternatives.csv"],
    claims_table: ["results/claims.csv"],
    errata: ["config/errata/lie.yaml"],
    stored_parameters: [*papers.PAPERS],
    paper_design: ["lie", "eso"],
    observed_record: [*papers.PAPERS],
    signal_samples: ["in.csv"],
    golden_numbers: ["fig2", "theory"],
    study_table: ["fig1_orders"],
}
TOKENS = [*YAML, bomb(2, 30), bomb(9, 9), bomb(9, 30)]
ALL = [(reader, name) for reader, names in READERS.items() for name in names]


def columns(content: bytes) -> dict[str, list[Any]]:
    """The columns of a table by name."""
    header, *rows = csv.reader(StringIO(content.decode()))
    return dict(zip(header, map(list, zip(*rows, strict=True)), strict=True))


def table(tree: Any) -> bytes:
    """Columns as a table, where one value stands for all of its rows."""
    named = tree if isinstance(tree, dict) else {"x": tree}
    lists = [one if isinstance(one, list) else [one] * 60 for one in named.values()]
    csv.writer(text := StringIO()).writerows([named, *zip_longest(*lists)])
    return text.getvalue().encode(errors="replace")


def contents(one: Reader) -> Iterator[st.SearchStrategy[bytes]]:
    """Changed contents of a file."""
    tokens = {"csv": CSV, "yaml": TOKENS, "json": TOKENS}.get(one.file.rpartition(".")[2])
    yield damaged(one.valid, tokens)
    if one.tree is not None:
        yield from map(changed(one.tree).map, (one.dumped, one.dumped, as_json))
    elif tokens is CSV:
        yield changed(columns(one.valid)).map(table)


@times(6)
@given(st.sampled_from(ALL), st.data())
def test_changed_files_are_accepted_or_refused(
    which: tuple[Callable[[str], Reader], str], data: st.DataObject
) -> None:
    reader, name = which
    one = reader(name)
    content = data.draw(st.one_of([*contents(one)]))
    found, digest = one.result(content), re.search(rb'(sha256|digest)[": ]+[0-9a-f]+', one.valid)
    if found is not None and digest and digest[0] in content:
        assert found == one.result(one.valid)


@pytest.mark.nightly_after(4)
@pytest.mark.parametrize("reader", READERS)
def test_valid_files_are_accepted(reader: Callable[[str], Reader]) -> None:
    for name in READERS[reader]:
        one = reader(name)
        assert one.accepts(one.valid)
