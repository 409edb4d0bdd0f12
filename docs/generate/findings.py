"""Findings: a page for each paper, from the evidence that git holds of it."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from typing import Any

from docs.generate.evidence import Paper
from docs.generate.markdown import plain, table, ticks
from reobserve.core.documents import read_yaml
from reobserve_papers.claims.verdict_rules import CONTRADICTED, DEPENDS, REPRODUCED, VERDICTS
from reobserve_papers.claims.verdict_table import counts_table, dissent, sentence, titles_table
from reobserve_papers.report.gather import cited
from reobserve_papers.report.reported_claims import SIGNS, ReportedClaim

_ROOT = "../../.."  # from a page of findings


def verdicts(papers: Sequence[Paper], folder: str = "") -> str:
    """Titles, and counts of the verdicts on claims, with links into the ``folder``."""
    titles = {paper.name: paper.stated for paper in papers}
    results = {paper.name: paper.result for paper in papers}
    text = f"{titles_table(titles, results)}\n{counts_table(_rows(papers))}"
    return re.sub(r"^\| `(\w+)` \|", rf"| [`\1`]({folder}\1.md) |", text, flags=re.MULTILINE)


def what_it_is_about(papers: Sequence[Paper], folder: str = "") -> str:
    """The papers, with links into the ``folder``."""
    listed = [
        (f"[`{paper.name}`]({folder}{paper.name}.md)", *map(plain, (cited(about), about["title"])))
        for paper, about in ((paper, paper.about) for paper in papers)
    ]
    return table(("paper", "by", "title"), listed)


def findings(paper: Paper) -> str:
    """The claims of a paper with their verdicts, and the citation of the paper."""
    return f"{_claims(paper)}\n\n{_cite(paper)}"


def chip(verdict: str) -> str:
    """A verdict with a sign that distinguishes it without colour."""
    name = verdict.replace(" ", "-")
    sign = f'<span class="sign" aria-hidden="true">{SIGNS[verdict]}</span>'
    return f'<span class="verdict {name}">{sign} **{plain(verdict)}**</span>'


def _rows(papers: Sequence[Paper]) -> list[dict[str, str]]:
    return [
        {
            "paper": paper.name,
            "verdict": paper.decider.judged[claim.name].verdict,
            "threshold": claim.threshold,
        }
        for paper in papers
        for claim in paper.registry.claims
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
    title = paper.title
    return (
        f"{', '.join(lines)}.\n\n"
        f"**{plain(title.in_words)}.** {ticks(sentence(title, paper.result))}\n\n"
        f"{_three_lines(paper)}\n\n"
        f"**Dissent.** {_linked(paper, dissent(title))}\n\n"
        f"Of its {len(rows)} claims:\n\n"
        f"{chips}\n\n"
        f"**Limitations.** {ticks(paper.registry.limitations)}"
    )


def _three_lines(paper: Paper) -> str:
    """The main claims that hold, that fail, that depend, and on what, and those left open."""
    kinds = {REPRODUCED: "Holds", CONTRADICTED: "Fails", DEPENDS: "Depends"}
    sorted_by: dict[str, list[str]] = {kind: [] for kind in (*kinds.values(), "Open")}
    for claim in filter(_decides, paper.claims):
        kind = kinds.get(claim.verdict, "Open")
        said = f"[{ticks(claim.statement.rstrip('.'))}](#claim-{claim.name})"
        if kind in ("Depends", "Open"):
            verdict = claim.verdict if kind == "Open" else ""
            said += f" ({', '.join(filter(None, [verdict, _no_better(claim), _share(claim)]))})"
        sorted_by[kind].append(said)
    return "\n".join(
        f"- **{kind}**: {'; '.join(listed) if listed else 'no main claim'}."
        for kind, listed in sorted_by.items()
        if listed or kind != "Open"
    )


def _linked(paper: Paper, text: str) -> str:
    """A text of several lines in which names of claims are links to them."""
    lines = (re.sub(r"^&#45; ", "- ", ticks(line)) for line in text.strip().split("\n"))
    names = "|".join(claim.name for claim in paper.claims)
    return re.sub(rf"`({names})` (?=is|then)", r"[`\1`](#claim-\1) ", "\n".join(lines))


def _claims(paper: Paper) -> str:
    """A table of all claims, each with an anchor."""
    rows = [
        (
            f'<a id="claim-{claim.name}"></a>{ticks(claim.statement)}'
            + (" **Main claim.**" if _decides(claim) else ""),
            chip(claim.verdict) + (f", {no_better}" if (no_better := _no_better(claim)) else ""),
            _share(claim),
        )
        for claim in paper.claims
    ]
    certain = sum(one.certainty == "certain" for one in paper.errata)
    return (
        "## Claims\n\nThe statements are in our words. The last column is the share of samples of "
        "the unstated choices in which the claim holds, with its confidence interval: each end "
        "holds with 95 % confidence at any number of samples. The baseline is a constant "
        "guess, the measurement passed through or random gains; its share is of the same samples. "
        "Of a claim that depends on choices or is undecided it says instead which choice separates "
        "the outcomes most, if one explains a fifth of them or more: it was found in one half of "
        "the samples, and the numbers are of the other half, or of all where settings are counted. "
        f"[Checks and bounds]({_ROOT}/config/claims/{paper.name}.yaml) of each claim are in one "
        "file, earlier ones there under `history`. The paper has "
        f"[{len(paper.errata)} errata, {certain} of them certain]"
        f"({_ROOT}/config/errata/{paper.name}.yaml). `results/report.html` shows all numbers "
        f"and [figures]({_ROOT}/tests/reference/{paper.name}).\n\n"
        f"{table(('claim', 'verdict', 'held in samples'), rows)}"
    )


def _decides(claim: ReportedClaim) -> bool:
    """True for main claims, which are those promised ones that can be tested."""
    return claim.is_main and claim.verdict != "not testable"


def _no_better(claim: ReportedClaim) -> str:
    return claim.robustness.no_better if claim.robustness else ""


def _share(claim: ReportedClaim) -> str:
    if not claim.robustness:
        return ""
    found = claim.robustness
    baseline = "" if found.null is None else f"; baseline {100 * found.null:.0f} %"
    if claim.choice:
        return plain(claim.separation) + baseline
    joint = f": {plain(claim.separation)}" if claim.separation else ""
    share, low, high = (f"{100 * part:.0f}" for part in (found.share, found.low, found.high))
    if found.whole:
        return f"{share} % of all{joint}{baseline}"
    return f"{share} % ({low} to {high} %){joint}{baseline}"


def _cite(paper: Paper) -> str:
    stated = read_yaml(paper.root / "CITATION.cff")
    known = {one["title"]: one for one in stated["references"]}
    here = stated | {"title": f"{stated['title']}, version {stated['version']}"}
    here |= {"year": str(stated["date-released"])[:4], "type": "software"}
    entries = [_bibtex(paper.name, known.get(paper.about["title"], _as_cited(paper.about)))]
    entries += [_bibtex("reobserve", here)]
    return (
        "## How to cite it\n\n"
        "Cite the paper whose observer or claims you use, and this replication:\n\n"
        f"```bibtex\n{''.join(entries)}```\n\n"
        f"The assumptions behind its numbers are in [its parameter file]"
        f"({_ROOT}/config/papers/{paper.name}.yaml)."
    )


def _as_cited(about: Mapping[str, Any]) -> dict[str, Any]:
    """What a parameter file says of a paper, in the words of `CITATION.cff`."""
    parts = [name.rpartition(" ") for name in about["authors"]]
    authors = [{"given-names": given, "family-names": family} for given, _, family in parts]
    return {**about, "authors": authors}


def _bibtex(key: str, one: Mapping[str, Any]) -> str:
    """A BibTeX entry of a reference as `CITATION.cff` has it."""
    authors = [
        (who.get("name") and f"{{{who['name']}}}") or f"{who['family-names']}, {who['given-names']}"
        for who in one["authors"]
    ]
    conference = one.get("conference", {}).get("name")
    kind = "article" if "journal" in one else "inproceedings" if conference else "misc"
    pages = "--".join(str(one[at]) for at in ("start", "end") if at in one)
    fields = {
        "author": " and ".join(authors), "title": f"{{{one['title']}}}",
        "journal": one.get("journal"), "booktitle": conference, "volume": one.get("volume"),
        "number": one.get("issue"), "pages": pages, "year": one.get("year"), "doi": one.get("doi"),
    }  # fmt: skip
    lines = [f"  {name} = {{{text}}},\n" for name, text in fields.items() if text]
    return f"@{kind}{{{key},\n{''.join(lines)}}}\n"
