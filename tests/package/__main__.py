"""Build wheel and source archive into dist, check them, and install each extra in earnest.

`python -m tests.package`, or `make package`; some minutes, most of them pip's. The tests of this
folder do the same with links in place of installations.
"""

from __future__ import annotations

import argparse
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

from .environments import EXTRAS, ROOT, build, variables

USES = Path(__file__).parent / "uses"
LOCK = ROOT / "requirements-package.lock"


def run(*words: str | Path, folder: Path = ROOT) -> None:
    """Run a command, which ends this one if it fails."""
    done = subprocess.run(list(map(str, words)), cwd=folder, env=variables(), check=False)
    if done.returncode:
        sys.exit(f"tests.package: {' '.join(map(str, words))} failed")


def environment(folder: Path, *requirements: str | Path) -> Path:
    """A new environment with these packages; its interpreter."""
    run(sys.executable, "-m", "venv", folder)
    python = folder / ("Scripts/python.exe" if sys.platform == "win32" else "bin/python")
    quiet = ("--quiet", "--disable-pip-version-check")
    run(python, "-m", "pip", "install", *quiet, *requirements)
    return python


def check(files: list[Path], folder: Path) -> None:
    """What those ask who publish: a description that shows, contents that fit."""
    python = environment(folder, "--require-hashes", "-r", LOCK)
    run(python, "-m", "twine", "check", "--strict", *files)
    wheels = [path for path in files if path.suffix == ".whl"]
    run(python, "-m", "check_wheel_contents", *wheels)
    run(python.with_name("hadolint"), "Containerfile")


def use(wheel: Path, extra: str, folder: Path) -> None:
    """Install the wheel with an extra and nothing else, and do what its users do."""
    named = "" if extra == "core" else f"[{extra}]"
    python = environment(folder / "venv", f"{wheel}{named}")
    empty = folder / "empty"
    empty.mkdir()
    script = USES / f"{'pipeline' if extra == 'all' else extra}.py"
    run(python, script, ROOT, folder=empty)
    run(python.with_name("reobserve"), "--version", folder=empty)
    print(f"{extra}: installed and used", flush=True)


def main() -> None:
    """Do all of it, or only what is asked for."""
    parser = argparse.ArgumentParser(prog="python -m tests.package", description=__doc__)
    parser.add_argument("extras", nargs="*", choices=(*EXTRAS, []), help="(default: all of them)")
    chosen = parser.parse_args().extras or EXTRAS
    target = ROOT / "dist"
    shutil.rmtree(target, ignore_errors=True)
    files = build(ROOT, target, "wheel", "sdist")
    (wheel,) = (path for path in files if path.suffix == ".whl")
    with tempfile.TemporaryDirectory() as scratch:
        check(files, Path(scratch) / "tools")
        for extra in chosen:
            folder = Path(scratch) / extra
            folder.mkdir()
            use(wheel, extra, folder)
            shutil.rmtree(folder)
    for path in files:
        print(path.relative_to(ROOT))


if __name__ == "__main__":
    main()
