"""All modules, and a look around in a checkout, which is the script's one argument."""

from __future__ import annotations

import importlib
import sys
from pathlib import Path

from told import told

import reobserve

package = Path(str(reobserve.__file__)).parent
for path in sorted(package.rglob("*.py")):
    name = ".".join(path.relative_to(package.parent).with_suffix("").parts)
    if path.stem != "__main__":
        importlib.import_module(name.removesuffix(".__init__"))
assert "sampled" in told("list", "ilo", "--project", sys.argv[1])
told("check", "lie", "--project", sys.argv[1])
