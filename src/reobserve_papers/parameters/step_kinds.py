"""The kinds of steps: which function of a paper each calls, and what it reads.

From this list follow the settings of a step, the steps before it, the evaluation in one process,
the options of ``reobserve-papers stage`` and the modules whose code makes a result stale.
"""

from __future__ import annotations

from dataclasses import dataclass

SEED = "seed"


@dataclass(frozen=True)
class StepKind:
    """The definition of a kind of step.

    Attributes
    ----------
    text
        What it does, for the help of the command line.
    about
        What a job calls the branch of the parameter file that the step is about, and the section
        of such branches. The theory is about whole sections.
    function
        What it calls in the paper's module of its own name.
    results
        Whose results it reads, in the order of that function: those of the steps ``plant``,
        ``design`` (one that the branch names), ``designs`` (all), ``estimates`` (of the observers
        that the branch names), ``study`` (that it names) and ``metrics`` (of the same figure).
    values
        What it reads of the parameter file besides the plant and its own branch, by a job's names,
        where its branch names such a thing.
    progress
        Whether it says how it goes on, to a function that is its last argument.
    """

    text: str
    about: str
    section: str
    function: str
    results: tuple[str, ...] = ()
    values: tuple[str, ...] = ()
    progress: bool = False

    @property
    def names(self) -> tuple[str, ...]:
        """The words that name a step of this kind."""
        if self.about == "observer":
            return ("scenario", "observer")
        return (self.about,) if self.about else ()


_RECORDS = ("scenario", "observers", "metrics", "study", "designs")

# Designs before what is built with them.
KINDS = {
    "plant": StepKind(
        "simulate the plant of a scenario",
        "scenario", "scenarios", "simulate", values=(SEED,),
    ),
    "design": StepKind(
        "compute a design: gains that observers share",
        "design", "designs", "compute",
    ),
    "observe": StepKind(
        "run an observer on a plant's record",
        "observer", "observers", "estimate", ("plant", "design"), ("design",),
    ),
    "study": StepKind(
        "run a study: many runs, one table",
        "study", "studies", "run", ("plant", "design"), (SEED, *_RECORDS),
    ),
    "search": StepKind(
        "search for values that the paper does not state",
        "search", "searches", "run", ("plant",), (SEED, *_RECORDS), progress=True,
    ),
    "table": StepKind(
        "compute a table of the paper from a design",
        "table", "tables", "rows", ("design",), ("design",),
    ),
    "metrics": StepKind(
        "compute the metrics of a figure",
        "figure", "figures", "measure", ("plant", "estimates", "study"), _RECORDS,
    ),
    "plot": StepKind(
        "plot a figure and write its caption",
        "figure", "figures", "", ("plant", "estimates", "study", "metrics"), _RECORDS,
    ),
    "theory": StepKind(
        "compute the metrics of a paper's theory",
        "", "", "measure", ("designs",), ("observers", "designs", "metrics", "theory"),
    ),
}  # fmt: skip

# The sections of a parameter file, by the name of one of their branches.
SECTIONS = {kind.about: kind.section for kind in KINDS.values() if kind.about}
