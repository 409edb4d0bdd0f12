"""Tasks whose modules are in this package."""

from __future__ import annotations

import importlib
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from types import ModuleType

from reobserve.core.errors import InputError
from reobserve.tuning.task import Task, TaskFile

MODEL = TaskFile  # of a task file, for its JSON schema


@dataclass(frozen=True)
class PackagedTask(Task):
    """A task of the bench: its module is beside the file or in `reobserve_papers.bench.tasks`."""

    @cached_property
    def module(self) -> ModuleType:
        """The module that simulates the task, or `InputError` if there is none."""
        path = Path(self.file).with_suffix(".py")
        if path.is_file():
            return super().module
        name = f"reobserve_papers.bench.tasks.{self.name}"
        try:
            return importlib.import_module(name)
        except ModuleNotFoundError as error:
            if error.name != name:
                raise
            problem = f"needs a module {path.name} beside it, or in reobserve_papers.bench.tasks"
            raise InputError(self.file, problem) from None
