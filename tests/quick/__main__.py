"""Check what changed since a commit: style, types and the tests of its rooms, in under a minute.

python -m tests.quick                  # what is not committed yet
python -m tests.quick --since main     # and what this branch holds

What a change touches is written in tests/mutations/rooms.yaml. What has not ended in time is told:
`make test` runs all of it.
"""

from __future__ import annotations

import argparse
import sys
import time
from pathlib import Path

from tests.quick.checks import changed_files, checks_of, run_checks

ROOT = Path(__file__).parents[2]


def main() -> int:
    """Run the checks two at a time; exit code 1 if one failed."""
    parser = argparse.ArgumentParser(prog="python -m tests.quick", description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter)  # fmt: skip
    parser.add_argument("--since", default="HEAD", metavar="COMMIT", help="(default: HEAD)")
    parser.add_argument("--seconds", type=float, default=55.0, help="at most (default: 55)")
    options = parser.parse_args()
    files = changed_files(ROOT, options.since)
    if not files:
        print(f"nothing has changed since {options.since}")
        return 0
    verdicts = {"passed": 0, "failed": 0, "not ended": 0}
    for check in run_checks(checks_of(ROOT, files), ROOT, time.monotonic() + options.seconds):
        verdicts[check.verdict] += 1
        print(f"{check.verdict:9s}  {check.told}", flush=True)
        if check.verdict == "failed":
            print(check.printed, flush=True)
    print(", ".join(f"{number} {verdict}" for verdict, number in verdicts.items() if number))
    return int(verdicts["failed"] > 0)


if __name__ == "__main__":
    sys.exit(main())
