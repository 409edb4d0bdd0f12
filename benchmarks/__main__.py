"""``python -m benchmarks``: run the benchmarks, print tables, keep the numbers as JSON."""

from __future__ import annotations

import argparse
import os
import sys
from importlib import import_module
from pathlib import Path

from reobserve.core.code_paths import THREADS

RESULTS = Path(__file__).with_name("results") / "latest.json"
NAMES = (
    "kernels",
    "delays",
    "filters",
    "kalman",
    "large_models",
    "batches",
    "first_use",
    "designs",
    "normal_forms",
    "pinned",
    "streams",
    "build",
)


def main() -> int:
    """Run what was asked for; the exit code is 1 where peers disagree or a ratio has fallen."""
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks",
        description=(
            "Speed as ratios against peers measured in the same run: the compiled observers "
            "against C, numpy, scipy, control and filterpy, designs by Clarabel against SCS, "
            "normal forms against sympy and DACE, pinned code paths against free ones, streams "
            "against what they aim at, builds against one process in memory. Slow is no failure; "
            "the exit code is 1 only if a peer computes other numbers, or if a ratio to C has "
            "fallen below its history."
        ),
    )
    parser.add_argument(
        "--only",
        action="append",
        choices=NAMES,
        metavar="NAME",
        help=f"run one of {', '.join(NAMES)}; may be repeated",
    )
    parser.add_argument(
        "--quick", action="store_true", help="fewer repeats: a first look, not a figure to quote"
    )
    parser.add_argument(
        "--history",
        type=Path,
        metavar="FOLDER",
        help="add the results to those in a folder; name ratios to C that fell by a fifth below "
        "the median of earlier runs in three runs in a row",
    )
    options = parser.parse_args()
    # Before numpy is imported. No more is pinned: peers are as fast as the processor lets them.
    for name in THREADS:
        os.environ.setdefault(name, "1")
    from benchmarks.history import add
    from benchmarks.report import write

    sections = {}
    for name in options.only or NAMES:
        sections[name] = import_module(f"benchmarks.{name}").run(options.quick)
        print(sections[name].text(), flush=True)
    write(RESULTS, sections, options.quick)
    print(f"written: {os.path.relpath(RESULTS)}")
    agreed = all(check.agrees for section in sections.values() for check in section.checks)
    fallen = add(options.history, RESULTS) if options.history else []
    for one in fallen:
        print(f"FALLEN: {one}")
    return 0 if agreed and not fallen else 1


if __name__ == "__main__":
    sys.exit(main())
