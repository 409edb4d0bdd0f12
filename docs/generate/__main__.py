"""Write the site's sources: `python -m docs.generate`, before mkdocs builds them.

Pages by hand and those that are generated go into one folder, with the navigation through all of
them in `build/mkdocs.yml`.
"""

from __future__ import annotations

import sys
from pathlib import Path

from docs.generate.sources import write
from reobserve.core.errors import ReobserveError

ROOT = Path(__file__).parents[2]

if __name__ == "__main__":
    try:
        write(ROOT, ROOT / "build", ROOT / "results/report.html")
    except ReobserveError as error:
        sys.exit(f"docs: {error}")
