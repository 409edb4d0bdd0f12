"""Calls of the library with arguments as they should be: one for each public class and function."""

from __future__ import annotations

from functools import cache

from . import designs, evidence, models, observers, stability
from .subject import Subject

__all__ = ["Subject", "subjects"]


@cache
def subjects() -> dict[str, Subject]:
    """All of them by name; each class and function is made by one part of the library."""
    every = [
        subject
        for part in (models, observers, stability, designs, evidence)
        for subject in part.subjects()
    ]
    found = {subject.name: subject for subject in every}
    assert len(found) == len(every)
    return found
