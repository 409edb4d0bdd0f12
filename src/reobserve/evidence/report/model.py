"""What the page holds, as plain data: no HTML but that of captions, no files but links to them."""

from __future__ import annotations

from dataclasses import dataclass, field


@dataclass(frozen=True)
class Gap:
    """Something that should be here and is not: ``sentence`` says what, ``place`` is an anchor."""

    number: int
    place: str
    sentence: str


@dataclass
class Gaps:
    """All gaps of a page, in the order in which they were found; one for each sentence."""

    found: list[Gap] = field(default_factory=list)

    def add(self, place: str, sentence: object) -> Gap:
        """The gap with this sentence, new or known."""
        text = " ".join(str(sentence).split())
        for gap in self.found:
            if gap.sentence == text:
                return gap
        gap = Gap(len(self.found) + 1, place, text)
        self.found.append(gap)
        return gap


@dataclass(frozen=True)
class Image:
    """A drawing as it is put into the page: ``source`` is a data URI, sizes are in CSS pixels."""

    source: str
    width: int
    height: int


@dataclass(frozen=True)
class Link:
    """A file beside the page; ``target`` is relative to the page."""

    label: str
    target: str


@dataclass(frozen=True)
class Table:
    """Rows of text under a header; ``numeric`` says which columns are numbers.

    ``left_out`` rows are only in the file.
    """

    header: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    numeric: tuple[bool, ...]
    left_out: int = 0


@dataclass(frozen=True)
class Run:
    """A job that ran: what it read and wrote, and the command as its log has it."""

    stage: str
    name: str
    inputs: tuple[str, ...]
    outputs: tuple[str, ...]
    log: str
    command: str | Gap


@dataclass(frozen=True)
class Figure:
    """A figure of a paper, what it shows and what stands behind it."""

    name: str
    title: str
    source: str
    beyond: bool
    image: Image | None
    caption: str | Gap
    summary: str
    links: tuple[Link, ...]
    gaps: tuple[Gap, ...]
    numbers: Table | Gap
    numbers_link: Link
    jobs: tuple[Run, ...]
    decides: tuple[str, ...] = ()

    @property
    def alternative(self) -> str:
        """What is read to those who do not see it: the title and the caption's first sentence."""
        return f"{self.title.rstrip('.')}. {self.summary}".strip()


@dataclass(frozen=True)
class Picture:
    """A drawing that no paper has: of the draws that decided its claims."""

    name: str
    title: str
    image: Image | None
    links: tuple[Link, ...]
    gaps: tuple[Gap, ...]


@dataclass(frozen=True)
class PaperTable:
    """A table of a paper, computed anew."""

    name: str
    title: str
    source: str
    content: Table | Gap
    caption: str | Gap
    link: Link
    jobs: tuple[Run, ...]


@dataclass(frozen=True)
class Robustness:
    """How firmly a verdict stands: over draws of the unstated choices, and by single moves.

    ``share`` of the draws held the claim, with its 95 % interval ``low`` to ``high``.
    """

    draws: int
    held: int
    share: float
    low: float
    high: float
    flip_key: str = ""
    flip: str = ""
    looked: bool = True
    diverged: int = 0
    refused: int = 0
    kept: int = 0


@dataclass(frozen=True)
class Claim:
    """What a paper says, and what was found."""

    name: str
    headline: bool
    place: str
    says: str
    verdict: str
    holds: str
    measured: tuple[str, ...]
    why: str
    threshold: str
    room: str
    figures: tuple[str, ...]
    depends_on: tuple[str, ...]
    robustness: Robustness | None = None
    problem: Gap | None = None


@dataclass(frozen=True)
class Erratum:
    """What a paper prints wrong, the correction, and the test that shows it.

    ``certainty`` is `certain`, `likely`, or `copy` for what the text at hand may have lost.
    """

    name: str
    place: str
    printed: str
    corrected: str
    why: str
    test: str
    certainty: str


@dataclass(frozen=True)
class Entry:
    """Entries of the ledger that say the same of several keys.

    ``status`` is `assumed`, `stated` or `overridden`, ``value`` and ``range`` one line a part.
    """

    keys: tuple[str, ...]
    value: tuple[str, ...]
    unit: str
    status: str
    source: str
    range: tuple[str, ...]
    why: str
    numerical: bool
    chosen_for: str
    claims: tuple[str, ...] = ()

    @property
    def section(self) -> str:
        """The branch of the ledger it stands in."""
        return self.keys[0].partition(".")[0]


@dataclass(frozen=True)
class StageCode:
    """The digest of all modules that a stage of a paper imports from this package.

    ``modules`` are those of them that not every stage of the paper imports.
    """

    stage: str
    digest: str
    modules: tuple[str, ...]


@dataclass(frozen=True)
class Paper:
    """Everything about one paper."""

    name: str
    title: str
    authors: tuple[str, ...]
    year: int | None
    doi: str
    obstacles: str | Gap
    gaps: tuple[Gap, ...]
    figures: tuple[Figure, ...]
    tables: tuple[PaperTable, ...]
    theory: Table | Gap | None
    theory_jobs: tuple[Run, ...]
    claims: tuple[Claim, ...] | Gap
    claims_jobs: tuple[Run, ...]
    robustness: Gap | None
    pictures: tuple[Picture, ...]
    errata: tuple[Erratum, ...] | Gap
    entries: tuple[Entry, ...]
    shared_code: tuple[str, ...]
    code: tuple[StageCode, ...]

    @property
    def short(self) -> str:
        """Authors and year as one cites them."""
        names = [author.split()[-1] for author in self.authors]
        if len(names) > 3:
            cited = f"{names[0]} et al."
        else:
            cited = " & ".join([", ".join(names[:-1]), names[-1]] if names[1:] else names)
        return f"{cited} ({self.year})" if self.year else cited

    def keys(self, *statuses: str) -> int:
        """How many keys of the ledger have one of these statuses."""
        return sum(len(entry.keys) for entry in self.entries if entry.status in statuses)

    @property
    def certain_errata(self) -> int:
        """How many errata contradict the paper itself or a computation."""
        listed = () if isinstance(self.errata, Gap) else self.errata
        return sum(erratum.certainty == "certain" for erratum in listed)

    @property
    def known_claims(self) -> tuple[Claim, ...]:
        """The claims; none if they could not be read."""
        return () if isinstance(self.claims, Gap) else self.claims


@dataclass(frozen=True)
class Timing:
    """What the jobs of one stage of a paper took: seconds in sum and at most, peak memory."""

    paper: str
    stage: str
    jobs: int
    seconds: float
    longest: float
    memory: float


@dataclass(frozen=True)
class Report:
    """The page."""

    papers: tuple[Paper, ...]
    gaps: tuple[Gap, ...]
    environment: tuple[tuple[str, str], ...]
    versions: tuple[tuple[str, str], ...]
    timings: tuple[Timing, ...]
