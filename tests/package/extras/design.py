"""With the extra `design`: designs of every kind, their files and their C code."""

from reobserve import load_design
from reobserve.cli.main import main
from reobserve.estimation.families import FAMILIES

for kind in FAMILIES:
    assert main(["design", kind, "--example", f"{kind}.yaml"]) == 0
    assert main(["design", kind, f"{kind}.yaml", "--out", f"{kind}.json"]) == 0
    assert main(["export", f"{kind}.json", "--out", kind]) == 0
    assert load_design(f"{kind}.json").certificate
