"""Chandrupatla's next trial, in the parts that `reobserve.core.chandrupatla` tells of."""

from __future__ import annotations

from reobserve.codegen.expressions import call
from reobserve.codegen.statements import ONE, ZERO, Program


def next_trial(program: Program, apart: float) -> None:
    """A function ``next_trial`` of the points newest, opposite and former: places and values.

    It divides by no zero, and takes the root of nothing below it: Python would raise.
    """
    a, b, c = (program.local(name, (2,)) for name in ("newest", "opposite", "former"))
    share, place, level, edge = (
        program.local(name, ()) for name in ("share_there", "place_there", "level", "edge")
    )
    out = program.local("trial_out", (1,))
    with program.function("next_trial", (a, b, c), out):
        program.let(share, 0.5)
        program.let(place, ZERO)
        with program.when("former[0] != opposite[0]"):
            program.let(place, (a[0] - b[0]) / (c[0] - b[0]))
        with (
            program.when("place_there > 0.0"),
            program.when("place_there < 1.0"),
            program.when("former[1] != opposite[1]"),
        ):
            program.let(level, (a[1] - b[1]) / (c[1] - b[1]))
            program.let(edge, ONE - call("sqrt", ONE - place))
            with program.when("level > edge"):
                program.let(edge, call("sqrt", place))
                with program.when("level < edge"):
                    program.let(share, a[1] / (b[1] - a[1]) * (c[1] / (b[1] - c[1])))
                    slant = (c[0] - a[0]) / (b[0] - a[0])
                    rest = a[1] / (c[1] - a[1]) * (b[1] / (c[1] - b[1]))
                    program.let(share, share + slant * rest)
        program.let(edge, apart / call("fabs", b[0] - a[0]))
        with program.when("share_there < edge"):
            program.let(share, edge)
        program.let(edge, ONE - edge)
        with program.when("share_there > edge"):
            program.let(share, edge)
        program.let(out[0], a[0] + share * (b[0] - a[0]))
