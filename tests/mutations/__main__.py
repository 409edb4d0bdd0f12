"""Try the kept changes, or fresh ones; exit code 1 if a test should have noticed one and did not.

python -m tests.mutations                        # the kept list
python -m tests.mutations --only 3 17            # some of it, by number
python -m tests.mutations --fresh 100 --seed 7   # a hundred new ones over all modules
python -m tests.mutations --fresh 100 --seed 7 --list
"""

from __future__ import annotations

import argparse
import tempfile
from collections import Counter
from pathlib import Path

from tests.mutations.fresh import generate
from tests.mutations.trial import Trials, kept

ROOT = Path(__file__).parents[2]
FAILURES = ("survived", "stale", "broken")


def main() -> int:
    """Run the trials and tell each outcome as it comes."""
    parser = argparse.ArgumentParser(prog="python -m tests.mutations", description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter)  # fmt: skip
    parser.add_argument("--only", type=int, nargs="+", metavar="N", help="these, by number")
    parser.add_argument("--fresh", type=int, default=0, metavar="N", help="so many new ones")
    parser.add_argument("--seed", type=int, default=1, help="which new ones")
    parser.add_argument("--jobs", type=int, default=1, help="how many at a time")
    parser.add_argument("--list", action="store_true", help="tell them and try none")
    options = parser.parse_args()
    mutations = generate(ROOT, options.fresh, options.seed) if options.fresh else kept()
    numbered = dict(enumerate(mutations, 1))
    if options.only:
        if unknown := set(options.only) - set(numbered):
            parser.error(f"there is no {min(unknown)}, the numbers are 1 to {len(numbered)}")
        numbered = {number: numbered[number] for number in options.only}
    if options.list:
        for number, mutation in numbered.items():
            print(f"{number:3d} {mutation}  [{mutation.tests}]")
        return 0
    numbers, found = list(numbered), Counter[str]()
    with tempfile.TemporaryDirectory(prefix="mutations-") as folder:
        trials = Trials(ROOT, Path(folder), options.jobs)
        for place, outcome in trials.run(numbered.values()):
            found[outcome.verdict] += 1
            why = outcome.mutation.equivalent or outcome.said
            print(f"{outcome.verdict:10s} {numbers[place]:3d} {outcome.mutation}", flush=True)
            if outcome.verdict != "survived" and why:
                print(f"{'':14s} {why}", flush=True)
    print(", ".join(f"{number} {verdict}" for verdict, number in found.most_common()))
    return int(any(found[verdict] for verdict in FAILURES))


if __name__ == "__main__":
    raise SystemExit(main())
