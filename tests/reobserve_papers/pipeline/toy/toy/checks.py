"""Checks beyond the types of parameters: each observer has gains, from one source."""

from math import isfinite

from toy_paper import design

from reobserve.core.errors import InputError
from reobserve_papers.parameters.parameter_checks import Checks


def gains(job):
    if not all(map(isfinite, design.compute(job)["gains"])):
        raise InputError("pole", "gives a number that is not finite")


def source(job, *_):
    if (job.observer.gains is None) == (job.observer.design == ""):
        raise InputError("gains", "or a design must be given, and not both")


CHECKS = Checks(build={"design": gains, "observer": source})
