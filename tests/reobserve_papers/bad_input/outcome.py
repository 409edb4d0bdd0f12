"""The required outcome of invalid input, in folders with the configuration of the project."""

from __future__ import annotations

from functools import partial

from reobserve_papers.cli.main import command_parser, main
from tests import ROOT
from tests.reobserve.bad_input import outcome

PACKAGE = "reobserve_papers"

command = partial(outcome.command, main=main, parser=command_parser)
is_accepted = partial(outcome.is_accepted, project=ROOT)
