"""Claims of the papers as checks of numbers: verdicts, and how robust they are.

`registry` reads claims, `checks` decides them from metrics, `choices` samples and moves what a
paper leaves open, `inquiry` decides them over such samples, `verdict_rules` puts a word to it.
"""

from reobserve.core.extras import require

require("pydantic", "replicate papers", "papers")
