"""The next trial of Chandrupatla's method, as in `reobserve.core.chandrupatla`."""

from __future__ import annotations

from reobserve.codegen.expressions import call
from reobserve.codegen.program import ONE, Program


def next_trial(program: Program, distance: float) -> None:
    """A function ``next_trial`` of the points newest, opposite and former: places and values."""
    a, b, c = (program.local(name, (2,)) for name in ("newest", "opposite", "former"))
    share, place, level, edge = map(program.local, ("share_there", "place_there", "level", "edge"))
    out = program.local("trial_out", (1,))
    with program.function("next_trial", (a, b, c), out):
        program.let(share, 0.5)
        program.let(place, (a[0] - b[0]) / (c[0] - b[0]))
        program.let(level, (a[1] - b[1]) / (c[1] - b[1]))
        with program.when(f"1.0 - sqrt(1.0 - {place}) < {level} && {level} < sqrt({place})"):
            program.let(share, a[1] / (b[1] - a[1]) * (c[1] / (b[1] - c[1])))
            slant = (c[0] - a[0]) / (b[0] - a[0])
            rest = a[1] / (c[1] - a[1]) * (b[1] / (c[1] - b[1]))
            program.let(share, share + slant * rest)
        program.let(edge, distance / call("fabs", b[0] - a[0]))
        program.let(share, call("fmin", call("fmax", share, edge), ONE - edge))
        program.let(out[0], a[0] + share * (b[0] - a[0]))
