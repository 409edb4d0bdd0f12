"""Run cases by hand, or many more of them every night."""

from __future__ import annotations

import argparse
import sys
import time

from .classes import CLASSES, make
from .harness import Worker, distinct, run


def main() -> int:
    """Run and print; 1 if a case failed."""
    parser = argparse.ArgumentParser(prog="python -m tests.fuzz", description=__doc__)
    parser.add_argument("--class", dest="name", choices=CLASSES, help="only this one")
    parser.add_argument("--seed", type=int, help="of the cases (default: the time)")
    parser.add_argument("--times", type=int, default=1, help="as many cases as in the tests, times")
    parser.add_argument("--case", type=int, help="only this one of a class: what becomes of it")
    chosen = parser.parse_args()
    seed = int(time.time()) if chosen.seed is None else chosen.seed
    names = [chosen.name] if chosen.name else list(CLASSES)
    print(f"seed {seed}", flush=True)
    worker, failed = Worker(), 0
    for name in names:
        last = CLASSES[name].cases * chosen.times
        numbers = range(last) if chosen.case is None else [chosen.case]
        begun = time.perf_counter()
        tally = run(worker, name, seed, numbers)
        took = time.perf_counter() - begun
        counts = ", ".join(f"{count} {word}" for word, count in sorted(tally.counts.items()))
        print(f"{name}: {counts} ({took:.1f} s)", flush=True)
        if chosen.case is not None:
            print(make(name, seed, chosen.case).text)
        for failure in distinct(tally.failures):
            print(failure, flush=True)
        failed += len(tally.failures)
    worker.close()
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
