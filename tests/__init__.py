"""Tests of the library, of the papers, and of the project; the folders mirror the packages."""

from pathlib import Path

ROOT = Path(__file__).parents[1]  # of the project

# The papers covered by the README, the citation file and some tests; other papers need no entry
# there.
FIVE = ("ilo", "lie", "delay", "imm", "eso")
