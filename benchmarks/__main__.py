"""``python -m benchmarks``: run the benchmarks, print tables, keep the numbers as JSON."""

from __future__ import annotations

import argparse
import os
import sys
from pathlib import Path

from reobserve.core.code_paths import THREADS

RESULTS = Path(__file__).with_name("results") / "latest.json"
NAMES = ("kernels", "delays", "filters", "designs", "normal_forms", "pinned", "streams", "build")


def main() -> int:
    """Run what was asked for; the exit code is 1 only where peers disagree."""
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks",
        description=(
            "Speed as ratios against peers measured in the same run: the compiled observers "
            "against C, numpy, scipy, control and filterpy, designs by Clarabel against SCS, "
            "normal forms against sympy and DACE, pinned code paths against free ones, streams "
            "against what they aim at, builds against one process in memory. Slow is no failure; "
            "the exit code is 1 only if a peer computes other numbers."
        ),
    )
    parser.add_argument(
        "--only", choices=NAMES, metavar="NAME", help=f"run one of {', '.join(NAMES)}"
    )
    parser.add_argument(
        "--quick", action="store_true", help="fewer repeats: a first look, not a figure to quote"
    )
    options = parser.parse_args()
    # Before numpy is imported. No more is pinned: peers are as fast as the processor lets them.
    for name in THREADS:
        os.environ.setdefault(name, "1")
    from benchmarks import build, delays, designs, filters, kernels, normal_forms, pinned, streams
    from benchmarks.report import write

    runs = {
        "kernels": kernels.run,
        "delays": delays.run,
        "filters": filters.run,
        "designs": designs.run,
        "normal_forms": normal_forms.run,
        "pinned": pinned.run,
        "streams": streams.run,
        "build": build.run,
    }
    sections = {}
    for name in [options.only] if options.only else NAMES:
        sections[name] = runs[name](options.quick)
        print(sections[name].text(), flush=True)
    write(RESULTS, sections, options.quick)
    print(f"written: {os.path.relpath(RESULTS)}")
    agreed = all(check.agrees for section in sections.values() for check in section.checks)
    return 0 if agreed else 1


if __name__ == "__main__":
    sys.exit(main())
