"""``python -m reobserve``: the command line."""

import sys

from reobserve.cli import main

sys.exit(main())
