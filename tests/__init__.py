"""Tests, by the rooms of the package."""

# The papers that the README, the citation and some tests are about; others need no word there.
FIVE = ("ilo", "lie", "delay", "imm", "eso")
