"""What a user can hand in, changed by a seed: nothing may break it, hang it or escape from it.

A module of `classes` makes cases of one kind of input: a valid example with a few changes, and what
reads it. A case is accepted or refused in one sentence; everything else is a failure. The same
class, seed and number make the same case, so that a failure can be run again by itself:

    python -m tests.fuzz --class yaml --seed 7 --case 123
"""
