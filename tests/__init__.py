"""Tests; the folders mirror the packages."""

# The papers covered by the README, the citation file and some tests; other papers need no entry
# there.
FIVE = ("ilo", "lie", "delay", "imm", "eso")
