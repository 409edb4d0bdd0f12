"""Rules of the project: package imports, locks, the README, and wording."""

from __future__ import annotations

import ast
import re
import subprocess
import sys
from collections import Counter
from collections.abc import Iterator
from pathlib import Path

import pytest
import yaml

from reobserve import _HOME
from reobserve.core.import_closure import import_closure
from reobserve_papers.golden.values import part_names
from reobserve_papers.parameters.config import known_papers
from reobserve_papers.parameters.parameters import Parameters
from reobserve_papers.steps.glossary import glossary
from tests import ROOT

from . import FIVE
from .published_numbers import golden_metrics

SOURCE = ROOT / "src"


def imports(path: Path) -> set[str]:
    """All modules that a file names in imports, those inside functions included."""
    found = set()
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            found |= {node.module or "", *(f"{node.module}.{a.name}" for a in node.names)}
    return found


def files(*folders: str) -> list[Path]:
    return [path for folder in folders for path in sorted((SOURCE / folder).rglob("*.py"))]


def inside(modules: set[str], *packages: str) -> set[str]:
    return {m for m in modules for p in packages if m == p or m.startswith(f"{p}.")}


# The parts of both packages in order of dependency: each imports only those before it, and the
# papers import the library.
PARTS = {
    "reobserve": (
        "core", "polynomials", "systems", "synthesis", "observers", "detection", "codegen",
        "estimation", "tuning", "cli", "__main__",
    ),
    "reobserve_papers": (
        "signals", "plants", "metrics", "plotting", "parameters", "steps", "claims", "golden",
        "report", "figure_diff", "papers", "bench", "cli", "__main__",
    ),
}  # fmt: skip
LAYERS = [f"{package}.{part}" for package, parts in PARTS.items() for part in parts]


def part_of(path: Path) -> str:
    """The part that a module is in, or the package whose ``__init__`` it is."""
    package, part, *_ = path.relative_to(SOURCE).with_suffix("").parts
    return package if part == "__init__" else f"{package}.{part}"


def test_every_module_is_in_a_part() -> None:
    assert {part_of(path) for path in files(".")} == {*PARTS, *LAYERS}


def test_parts_import_only_those_before_them() -> None:
    for path in files("."):
        part = part_of(path)
        if part not in PARTS:
            assert not inside(imports(path), *LAYERS[LAYERS.index(part) + 1 :]), path
    for path in files("reobserve/observers"):
        closure = set(
            import_closure([f"reobserve.observers.{path.stem}".removesuffix(".__init__")])
        )
        assert not inside(closure, "reobserve.core.files", "pandas"), path


def test_library_and_its_tests_import_nothing_of_the_papers() -> None:
    others = ("reobserve_papers", "tests.reobserve_papers", "tests.docs", "tests.package")
    for path in [*files("reobserve"), *sorted((ROOT / "tests/reobserve").rglob("*.py"))]:
        assert not inside(imports(path), *others), path
        if path.name != "main.py":  # whose help names the other command
            assert not re.search("reobserve[-_]papers", path.read_text(encoding="utf-8")), path


# Modules that no public name, command or family needs, and the pages for users on them.
FOR_CALLS = {
    "reobserve.detection.restarted_cusum": "explanation/bench-results.md",
    "reobserve.synthesis.ilo_certificate": "tutorials/ilo.md",
}


def test_library_contains_no_module_that_only_the_papers_need() -> None:
    modules = {
        ".".join(path.relative_to(SOURCE).with_suffix("").parts).removesuffix(".__init__"): path
        for path in files("reobserve")
    }
    text = "".join(path.read_text(encoding="utf-8") for path in modules.values())
    folders = ("", "reobserve.estimation.families.", "reobserve.codegen.programs.")
    imported_late = re.findall(r'"([a-z_.]+):\w+"', text)  # "module:name"
    started = {folder + name for folder in folders for name in imported_late}
    started |= {f"reobserve.{module}" for module in _HOME.values()} | {"reobserve.__main__"}
    reached = {*import_closure(sorted(started & {*modules}))}
    assert {*modules} - reached == {*FOR_CALLS}
    for module, page in FOR_CALLS.items():
        assert module in (ROOT / "docs/pages" / page).read_text(encoding="utf-8")


def test_papers_import_the_library_up_to_its_observers() -> None:
    """All modules and tests but those of the bench, which tunes."""
    upper = LAYERS[LAYERS.index("reobserve.detection") : LAYERS.index("reobserve_papers.signals")]
    names = {f"reobserve.{name}": f"reobserve.{module}" for name, module in _HOME.items()}
    bench = set()
    for top in (SOURCE, ROOT / "tests"):
        for path in sorted((top / "reobserve_papers").rglob("*.py")):
            found = imports(path)
            found |= {names[name] for name in found & set(names)}
            reached = inside(found, *upper, *(f"tests.{part}" for part in upper))
            if path.relative_to(top).parts[1] == "bench":
                bench |= reached
            else:
                assert not reached, path
    assert {"reobserve.tuning.task", "tests.reobserve.tuning.toy"} <= bench


def test_no_module_is_deeper_than_a_part_of_a_part() -> None:
    assert max(len(path.relative_to(SOURCE).parts) for path in files(".")) <= 4


def test_no_module_hides_the_function_replicate() -> None:
    """Else whoever imports that module first finds it in place of the function."""
    assert [path for path in files(".") if "replicate" in (path.stem, path.parent.name)] == []


# Parts without tests of their own, and where they are tested instead.
TESTED_ELSEWHERE = {
    "reobserve.__main__": "tests/reobserve/estimation",
    "reobserve_papers.__main__": "tests/reobserve_papers/pipeline",
}


def test_tests_mirror_the_parts() -> None:
    folders = {part: ROOT / "tests" / part.replace(".", "/") for part in LAYERS}
    mirrored = {part for part, folder in folders.items() if any(folder.rglob("test_*.py"))}
    assert mirrored.isdisjoint(TESTED_ELSEWHERE)
    assert mirrored | set(TESTED_ELSEWHERE) == set(LAYERS)
    for package, parts in PARTS.items():
        found = {path.parent.name for path in (ROOT / "tests" / package).glob("*/__init__.py")}
        assert found <= {*parts, "library", "bad_input", "pipeline"}
    assert all(any((ROOT / folder).rglob("test_*.py")) for folder in TESTED_ELSEWHERE.values())


# Modules that plot; captions do not.
DRAWING = ("style_sheet", "figures", "fitting", "formats", "formulas", "pgf")


def test_heavy_packages_are_imported_only_where_needed() -> None:
    for path in files("."):
        names = imports(path)
        assert not inside(names, "snakemake"), path
        drawing = (
            path.parts[-4:-2] == ("reobserve_papers", "papers") or path.parent.name == "claims"
        )
        drawing = drawing and path.stem.partition("_")[0] == "plot"
        drawing |= path.parent == SOURCE / "reobserve_papers/plotting" and path.stem in DRAWING
        drawing |= path == SOURCE / "reobserve_papers/bench/bench_figures.py"
        if not drawing:
            assert not inside(names, "matplotlib"), path
        if "synthesis" not in path.parts:
            assert not inside(names, "cvxpy", "clarabel"), path


def test_short_job_imports_no_heavy_packages() -> None:
    """Listing commands import neither scipy nor plotting."""
    command = (
        "import sys; from reobserve_papers.cli.main import main; main(['list']); "
        "print([m for m in ('numba', 'scipy', 'matplotlib', 'pandas', 'cvxpy', 'pyarrow') "
        "if m in sys.modules])"
    )
    done = subprocess.run(
        [sys.executable, "-c", command], cwd=ROOT, capture_output=True, text=True, check=True
    )
    assert done.stdout.splitlines()[-1] == "[]"


@pytest.mark.parametrize("name", sorted(path.name for path in ROOT.glob("requirements*.lock")))
def test_lock_files_pin_by_hash_and_name_no_host(name: str) -> None:
    text = (ROOT / name).read_text()
    assert "://" not in text
    assert "--index" not in text
    pinned = re.findall(r"^([a-z0-9.-]+)==", text, re.MULTILINE)
    assert len(pinned) == len(set(re.findall(r"^([a-z0-9.-]+==[^ ]+)", text, re.MULTILINE)))
    blocks = re.split(r"^(?=[a-z])", text, flags=re.MULTILINE)[1:]
    assert all("--hash=sha256:" in block for block in blocks)


def tracked() -> Iterator[tuple[str, str]]:
    """The names and texts of tracked files, without images, tables and locks."""
    listed = subprocess.run(
        ["git", "ls-files"], cwd=ROOT, capture_output=True, text=True, check=True
    ).stdout.split()
    for name in listed:
        path = ROOT / name
        if path.is_file() and path.suffix not in (".lock", ".csv", ".png"):
            yield name, path.read_text(encoding="utf-8")


def test_tracked_files_name_no_local_paths() -> None:
    absolute = re.compile(r"(?<![\w.$}/:-])/(?:home|root|work|tmp|Users)/\w")
    for name, text in tracked():
        assert ROOT / name == Path(__file__) or not absolute.search(text), name


def test_files_named_in_comments_and_texts_exist() -> None:
    """Tests are excluded: they name files of projects that they make."""
    folders = r"\.ci|\.github|benchmarks|config|profiles|src|tests|workflow"
    kinds = "md|py|rst|sh|smk|toml|yaml|yml"
    named = re.compile(rf"(?<![\w/.$<}}*-])(?:{folders})/[\w./-]*\w\.(?:{kinds})\b")
    found = {
        (name, path)
        for name, text in tracked()
        if not name.startswith("tests/")
        for path in named.findall(text)
        if "NAME" not in path
    }
    assert ("README.md", "docs/pages/findings/ilo.md") not in found
    assert (".ci/run", "tests/browser.py") in found
    missing = {(name, path) for name, path in found if not (ROOT / path).exists()}
    # The example is copied over the project.
    assert {(n, p) for n, p in missing if not any((ROOT / "examples").glob(f"*/{p}"))} == set()


def test_workflow_rules_are_short_and_use_only_commands() -> None:
    """A reader sees paths, wildcards and commands; computations are in the package."""
    rules = [ROOT / "Snakefile", ROOT / "workflow/Snakefile", *ROOT.glob("workflow/rules/*.smk")]
    text = "\n".join(path.read_text() for path in rules)
    assert len(text.split()) < 2550  # words, since snakefmt decides on the lines
    shells = re.findall(r"reobserve-papers (?:stage )?(\w+)", text)
    assert {"plant", "design", "observe", "study", "metrics", "plot", "table", "theory"} <= {
        *shells
    }


def test_metadata_agrees() -> None:
    citation = yaml.safe_load((ROOT / "CITATION.cff").read_text())
    project = (ROOT / "pyproject.toml").read_text()
    assert f'version = "{citation["version"]}"' in project
    assert f'license = "{citation["license"]}"' in project
    references = {ref["title"]: ref for ref in citation["references"]}
    for paper in FIVE:
        about = yaml.safe_load((ROOT / f"config/papers/{paper}.yaml").read_text())["about"]
        reference = references[about["title"]]
        for key in ("doi", "year"):
            assert reference.get(key) == about.get(key), (paper, key)
        families = [author["family-names"] for author in reference["authors"]]
        for author, family in zip(about["authors"], families, strict=True):
            assert author.endswith(family)
    assert "make test" in (ROOT / ".ci/run").read_text()


@pytest.mark.parametrize("folder", [ROOT, ROOT / "examples/two_mass"])
def test_pull_requests_are_compared_with_the_accepted_figures(folder: Path) -> None:
    """After the tests, pass or fail, without a second build, and on the page of the run."""
    workflow = yaml.safe_load((folder / ".github/workflows/ci.yml").read_text())
    assert "pull_request" in workflow[True]  # the key `on`
    steps = [step for step in workflow["jobs"]["test"]["steps"] if "run" in step]
    lines = [step["run"] for step in steps]
    compared = next(k for k, line in enumerate(lines) if "reobserve-papers figdiff" in line)
    assert "make test" in lines[compared - 1]
    assert 'figdiff/summary.md >> "$GITHUB_STEP_SUMMARY"' in lines[compared + 1]
    assert all("always()" in step["if"] for step in steps[compared : compared + 2])
    assert not [line for line in lines if "snakemake" in line or "make figdiff" in line]


@pytest.mark.parametrize("paper", known_papers(ROOT))
def test_all_metrics_are_explained(paper: str) -> None:
    """All stored metrics, and no others."""
    parameters = Parameters.load(ROOT, paper)
    reported = [pattern for pattern, _ in glossary(parameters.package)]
    tree = parameters.tree
    parts = [part for part in part_names(tree) if part not in tree.get("tables", {})]
    metrics = {metric for part in parts for _, metric in golden_metrics(paper, part)}
    assert {one for one in metrics if not any(p.fullmatch(one) for p in reported)} == set()
    assert {p.pattern for p in reported if not any(map(p.fullmatch, metrics))} == set()


# Unusual words, with the terms to use instead.
WORDS = {
    "ledgers?": "parameter file, parameters", "told": "given, reported", "anew": "again",
    "beliefs?": "posterior", "headlines?": "main claim", "fore(tell|tells|told)": "predict",
    "mended": "fixed", "downhill": "in order of dependency", "the house": "the default style",
    "(the|of|few|many|more|all|kept)[ _]draws?": "(cached) samples", "own[ _]data": "recorded data",
    "houses?": "package", "rooms?": "space, margin", "roofs?": "package", "floor plans?": "layers",
    "roads?": "methods", "judges?": "compute metrics, score", "same bits": "bitwise identical",
    "one's own": "user-defined", "stamps": "timestamps", "plain data": "values of YAML or JSON",
    "cut off": "truncated", "leaves all bounds": "diverges", "small print": "footnotes",
    "dear": "expensive", "kin": "variants", "obstacles?": "limitations",
    "gain[ _]laws?": "gain function", "flips? (the|a) verdict": "reverses",
    "hidden modes?": "unobservable",
}  # fmt: skip
HISTORY = ("CHANGELOG.md", "tests/golden/REASONS.md", "tests/test_project.py")


def test_unusual_terms_do_not_appear() -> None:
    listed = subprocess.run(
        ["git", "ls-files", "*.py", "*.c", "*.md", "*.yaml", "*.yml", "*.smk", "*.rst", "*.jinja"],
        cwd=ROOT, capture_output=True, text=True, check=True,
    ).stdout.split("\n")  # fmt: skip
    found = {}
    unusual = re.compile(rf"(?<![a-z])(?:{'|'.join(WORDS)})(?![a-z])")
    for name in (name for name in listed if name and name not in HISTORY):
        if (ROOT / name).is_file():
            text = (ROOT / name).read_text(encoding="utf-8").lower()
            for word in {one[0] for one in unusual.finditer(text)}:
                said = next(known for known in WORDS if re.fullmatch(known, word))
                found[f"{name}: {word}"] = WORDS[said]
    assert found == {}


# Words with which no docstring begins: a summary is an imperative or a noun phrase.
NOT_FIRST = {
    *("What", "How", "Where", "When", "Why", "Which", "Who", "Whose", "Whether", "If"),
    *("Of", "By", "As", "For", "From", "In", "On", "Over", "Above", "Up", "Before", "Since"),
    *("With", "Without", "That", "Those", "These", "They", "It", "Its", "Their"),
}


def summaries(path: Path) -> Iterator[tuple[str, str]]:
    """The first paragraphs of a module's docstrings, each with the name of what it describes."""
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef):
            docstring = ast.get_docstring(node) or ""
            if docstring:
                summary = " ".join(docstring.partition("\n\n")[0].split())
                yield f"{path.relative_to(SOURCE)}: {getattr(node, 'name', 'module')}", summary


def test_docstrings_begin_with_a_verb_or_a_noun_and_have_one_clause() -> None:
    """Semicolons may separate rows of matrices, sources with their years, and code."""
    quoted = re.compile(r"`+[^`]*`+|\[[^]]*\]|\d{4}; ")
    found = [one for path in files(".") for one in summaries(path)]
    assert len(found) > 3000
    assert [one for one in found if re.split(r"[^\w-]", one[1])[0] in NOT_FIRST] == []
    assert [one for one in found if ";" in quoted.sub("", one[1])] == []


def class_names(folder: str) -> list[str]:
    """Names of public classes, as often as there are classes of that name."""
    paths = sorted((ROOT / "src" / folder).rglob("*.py"))
    trees = [ast.parse(path.read_text(encoding="utf-8")) for path in paths]
    nodes = [node for tree in trees for node in ast.walk(tree) if isinstance(node, ast.ClassDef)]
    return [node.name for node in nodes if not node.name.startswith("_")]


def test_class_names_are_unique() -> None:
    def twice(names: list[str]) -> list[str]:
        return sorted(name for name, count in Counter(names).items() if count > 1)

    library = class_names("reobserve")
    assert not twice(library)
    # Papers and tasks of the bench declare classes that are found by name, such as Plant.
    assert len(twice(library + class_names("reobserve_papers"))) <= 12
