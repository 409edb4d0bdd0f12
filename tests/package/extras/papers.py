"""With the extra `papers`: the configuration of a checkout, and a figure of a paper."""

from pathlib import Path

from reobserve_papers import replicate
from reobserve_papers.cli.main import main

project = Path(__file__).parents[3]
assert main(["check", "lie", "--project", str(project)]) == 0
figure = replicate("ilo", "fig1", project=project)
assert len(figure.metrics)
figure.plot().savefig("fig1.pdf")
