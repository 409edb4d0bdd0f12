"""Findings: a page for each paper, from the evidence that git holds of it."""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from docs.generate.evidence import Paper
from docs.generate.markdown import code, heading, plain, table, ticks
from reobserve.core.documents import read_yaml
from reobserve_papers.claims.errata import Erratum
from reobserve_papers.claims.verdict_table import table as verdict_table
from reobserve_papers.claims.verdicts import VERDICTS
from reobserve_papers.report.claims import ReportedClaim
from reobserve_papers.report.gather import cited
from reobserve_papers.report.paper_figures import FigureRow

_THRESHOLDS = {"stated": "bound of the paper", "before": "bound before", "after": "bound after"}
_CERTAINTIES = {
    "certain": "certain",
    "likely": "likely",
    "copy": "possibly lost in the copy at hand",
}


def verdicts(papers: Sequence[Paper], folder: str = "") -> str:
    """How many claims of each paper got which verdict, with links into the ``folder``."""
    titles = {paper.name: paper.decided[1] for paper in papers}
    counted = verdict_table(_rows(papers), titles)
    return re.sub(r"^\| `(\w+)` \|", rf"| [`\1`]({folder}\1.md) |", counted, flags=re.MULTILINE)


def what_it_is_about(papers: Sequence[Paper], folder: str = "") -> str:
    """The papers, with links into the ``folder``."""
    listed = [
        (f"[`{paper.name}`]({folder}{paper.name}.md)", *map(plain, (cited(about), about["title"])))
        for paper, about in ((paper, paper.about) for paper in papers)
    ]
    return table(("paper", "by", "title"), listed)


def findings(paper: Paper) -> str:
    """The claims of a paper at a glance, its figures, and how to cite it."""
    return "\n\n".join(section(paper) for section in (_glance, _figures, _cite))


def details(paper: Paper) -> str:
    """Each claim of a paper with its numbers, what was asked before, and the errata."""
    return "\n\n".join(section(paper) for section in (_claims, _history, _errata))


def anchor(claim: ReportedClaim) -> str:
    """Where a claim stands on the page of its paper."""
    return f"claim-{claim.name}"


def chip(verdict: str) -> str:
    """A verdict with a mark that distinguishes it without colour."""
    return f'<span class="verdict {verdict.replace(" ", "-")}">**{plain(verdict)}**</span>'


def _rows(papers: Sequence[Paper]) -> list[dict[str, str]]:
    return [
        {
            "paper": paper.name,
            "verdict": claim.verdict,
            "promised": claim.promised,
            "place": claim.place,
            "threshold": claim.threshold,
        }
        for paper in papers
        for claim in paper.claims
    ]


def summary(paper: Paper) -> str:
    """A paper, its title as a replication and its verdicts, counted."""
    about = paper.about
    doi = about.get("doi")
    lines = [f"{plain(', '.join(about['authors']))}: *{plain(about['title'])}*"]
    lines += [str(about["year"])] if "year" in about else []
    lines += [f"[doi:{plain(doi)}](https://doi.org/{doi})"] if doi else []
    rows = _rows([paper])
    counts = [(word, sum(row["verdict"] == word for row in rows)) for word in VERDICTS]
    chips = ", ".join(f'<span class="count">{chip(word)} {n}</span>' for word, n in counts if n)
    title = paper.decided[1]
    reasons = "\n".join(f"- {plain(reason)}" for reason in title.reasons)
    why = f", since\n\n{reasons}\n\n" if reasons else ": nothing that was tried changes it. "
    return (
        f"{', '.join(lines)}.\n\n"
        f"**{plain(title.word)}**{why}"
        f"Of its {len(rows)} claims:\n\n"
        f"{chips}\n\n"
        f"**Limitations.** {ticks(paper.registry.limitations)}"
    )


def _glance(paper: Paper) -> str:
    rows = [
        (
            f"[{plain(_words(claim.name))}](../reference/claims/{paper.name}.md#{anchor(claim)})"
            + (" **main claim**" if _decides(claim) else ""),
            chip(claim.verdict),
            _share(claim),
        )
        for claim in paper.claims
    ]
    certain = sum(one.certainty == "certain" for one in paper.errata)
    return (
        "## Claims\n\n"
        "The last column is the share of samples of the unstated choices in which the claim holds, "
        "with its confidence interval: each end holds with 95 % confidence at any number of "
        f"samples. [The details](../reference/claims/{paper.name}.md) have the numbers, the "
        f"checks, what was asked before, and {len(paper.errata)} errata, {certain} of them "
        "certain.\n\n" + table(("claim", "verdict", "held in samples"), rows)
    )


def _claims(paper: Paper) -> str:
    claims = "\n".join(_claim(paper, claim) for claim in paper.claims)
    return (
        "## Claims\n\nThe claims of the paper, in our words. A check holds if the paper is right. "
        "*can*: the paper says that something can be so; *always*: one counterexample contradicts "
        "it. *Bound before* or *after*: we set it before or after its numbers were known.\n\n"
        f"{claims}"
    )


def _claim(paper: Paper, claim: ReportedClaim) -> str:
    main_claim = ", **main claim**" if _decides(claim) else ""
    parts = [
        heading(3, plain(_words(claim.name)), anchor(claim)),
        f"{chip(claim.verdict)}{main_claim}, {plain(claim.place)}{_kind(claim)}",
        f"> {ticks(claim.statement)}",
    ]
    if claim.measured:
        parts.append("\n".join(f"- {_measured(paper, one)}" for one in claim.measured))
    if claim.why:
        parts.append(ticks(claim.why))
    if claim.margin:
        parts.append(f"Same verdict for {plain(claim.margin)}.")
    found = claim.robustness
    if found:
        what = "settings, which are all" if found.whole else "samples"
        held = f"Held in {found.held} of {found.samples} {what}: {_share(claim)}."
        if found.tied:
            held += f" {found.tied} are ties; the opposite holds in {found.opposed}."
        held += f" {found.lost} diverged or were refused." if found.lost else ""
        if found.null is not None:
            held += f" With an estimator that knows nothing: {100 * found.null:.0f} %."
        parts.append(held)
    if claim.setting:
        fails = claim.verdict == "contradicted" and claim.quantifier == "always"
        parts.append(
            f"A setting at which it {'fails' if fails else 'holds'}: {plain(claim.setting)}."
        )
    if errata := paper.registry.corrections.get(claim.name):
        links = ", ".join(f"[{plain(_words(one))}](#erratum-{one})" for one in errata)
        parts.append(f"Corrected: {links}.")
    if claim.changes:
        parts.append(f"Another verdict with: {plain('; '.join(claim.changes))}.")
    if claim.depends_on:
        rows = {key: entry.keys for entry in paper.entries for key in entry.keys}
        alike = dict.fromkeys(rows.get(key, (key,)) for key in claim.depends_on)
        keys = ", ".join(_key(paper, *keys) for keys in alike)
        parts.append(f"Depends on {keys}.")
    elif claim.verdict != "not testable":
        parts.append("Depends on nothing that the paper leaves open.")
    return "\n\n".join(parts) + "\n"


def _history(paper: Paper) -> str:
    """Verdicts that changed with what was asked, while they were known."""
    rows = [
        (
            plain(_words(one.claim)),
            plain(one.verdict),
            plain(one.was),
            plain(one.now),
            plain(one.why),
        )
        for one in paper.registry.history
    ]
    if not rows:
        return "## What was asked before\n\nNothing has changed since the claims were registered."
    listed = table(("claim", "verdict then", "what was asked", "now", "why"), rows)
    return (
        "## What was asked before\n\nVerdicts that were others before a bound, range, quantifier, "
        f"window or promise changed, each with the verdict known at the time.\n\n{listed}"
    )


def _decides(claim: ReportedClaim) -> bool:
    """True for main claims, which are those promised ones that can be tested."""
    return claim.is_main and claim.verdict != "not testable"


def _words(name: str) -> str:
    return name.replace("_", " ")


def _share(claim: ReportedClaim) -> str:
    if not claim.robustness:
        return ""
    found = claim.robustness
    share, low, high = (f"{100 * part:.0f}" for part in (found.share, found.low, found.high))
    if found.whole:
        return f"{share} % of all"
    return f"{share} % ({low} to {high} %)"


def _measured(paper: Paper, measured: str) -> str:
    """A check, its figure with a link to the gallery."""
    figure, _, rest = measured.partition(" ")
    if figure in paper.parameters.tree["figures"]:
        return f"[{code(figure)}](../../gallery/{paper.name}.md#{figure}) {plain(rest)}"
    return f"{code(figure)} {plain(rest)}"


def _kind(claim: ReportedClaim) -> str:
    """How much it claims, and who set its bounds."""
    words = [claim.quantifier] if claim.quantifier in ("can", "always") else []
    words += [_THRESHOLDS[claim.threshold]] if claim.threshold else []
    return "".join(f", *{word}*" for word in words)


def _key(paper: Paper, key: str, *others: str) -> str:
    """A parameter key with a link to its entry, or to the entry that it is a number of.

    The ``others`` share its entry.
    """
    known = {name for entry in paper.entries for name in entry.keys}
    found = re.sub(r"\{([^,}]*)[^}]*\}", r"\1", key)
    while found and found not in known:
        found = found.rpartition(".")[0]
    if not found:
        return code(key)
    more = f" (+{len(others)})" if others else ""
    return f"[{code(key)}](../parameters/{paper.name}.md#{found}){more}"


def _errata(paper: Paper) -> str:
    if not paper.errata:
        return "## Errata\n\nNone were found."
    certain = sum(one.certainty == "certain" for one in paper.errata)
    errata = "\n".join(map(_erratum, paper.errata))
    return (
        "## Errata\n\n"
        "Misprints, and passages that contradict each other. For each a test is named, which shows "
        f"that the printed form fails. {certain} of {len(paper.errata)} are certain: they "
        "contradict the paper itself or a computation. The others are likely, or may be errors of "
        "the copy at hand, a text extracted from a PDF, in which signs, primes, indices and "
        "fraction bars can be lost.\n\n"
        f"{errata}"
    )


def _erratum(erratum: Erratum) -> str:
    rows = [("printed", plain(erratum.printed)), ("corrected", plain(erratum.corrected))]
    return (
        f"{heading(3, plain(_words(erratum.name)), f'erratum-{erratum.name}')}\n\n"
        f"{plain(erratum.place)}; **{_CERTAINTIES.get(erratum.certainty, erratum.certainty)}**\n\n"
        + "".join(f"- {name}: {text}\n" for name, text in rows)
        + f"\n{ticks(erratum.why)}\n\nTest: {code(erratum.test)}\n"
    )


def _figures(paper: Paper) -> str:
    rows = [
        (plain(row.name), plain(row.shows), _drawn(paper, row), _printed(row), plain(row.differs))
        for row in paper.figure_rows
    ]
    return (
        "## Figures\n\nAll figures of the paper. Settings of the curves are printed in it, "
        "assumed, or searched for so that the curves meet what it shows. All drawings are in "
        f"[the gallery](../gallery/{paper.name}.md).\n\n"
        + table(("figure", "shows", "ours", "printed: ours", "what differs"), rows)
    )


def _drawn(paper: Paper, row: FigureRow) -> str:
    if not row.ours:
        return f"none: {plain(row.not_reproduced)}"
    links = ", ".join(f"[{code(one)}](../gallery/{paper.name}.md#{one})" for one in row.ours)
    counts = [(row.printed, "printed"), (row.assumed, "assumed"), (len(row.searched), "searched")]
    settings = ", ".join(f"{n} {word}" for n, word in counts if n)
    return f"{links}; {settings}"


def _printed(row: FigureRow) -> str:
    return "; ".join(
        f"{plain(what)} {plain(text)}: {plain(ours)}" for what, text, ours in row.numbers
    )


def _cite(paper: Paper) -> str:
    reference = _reference(paper.root, paper.about["title"])
    return (
        "## How to cite it\n\n"
        f"Cite the paper whose observer or claims you use: {reference}\n\n"
        f"Cite also this replication, see {code('CITATION.cff')}. The assumptions behind its "
        f"numbers are in [its parameter file](../reference/parameters/{paper.name}.md)."
    )


def _reference(root: Path, title: str) -> str:
    """The reference to a paper, as `CITATION.cff` has it."""
    known: dict[str, Any] = {
        one["title"]: one for one in read_yaml(root / "CITATION.cff")["references"]
    }
    if title not in known:
        return f"*{plain(title)}*."
    one = known[title]
    authors = [f"{who['given-names']} {who['family-names']}" for who in one["authors"]]
    parts = [plain(", ".join(authors)), f"*{plain(title)}*"]
    conference = one.get("conference", {})
    parts += [plain(one.get("journal") or conference.get("name") or "")]
    volume, issue = one.get("volume"), one.get("issue")
    parts += [f"{volume}({issue})" if issue else f"{volume}"] if volume else []
    pages = [str(one[key]) for key in ("start", "end") if key in one]
    parts += [f"pp. {'–'.join(pages)}"] if pages else []
    parts += [str(one["year"])] if "year" in one else []
    parts += [f"[doi:{plain(one['doi'])}](https://doi.org/{one['doi']})"] if "doi" in one else []
    return ", ".join(part for part in parts if part) + "."
