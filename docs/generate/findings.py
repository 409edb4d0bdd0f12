"""Findings: a page for each paper, from the evidence that git holds of it."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

from docs.generate.evidence import Paper
from docs.generate.markdown import plain, table, ticks
from reobserve.core.documents import read_yaml
from reobserve_papers.claims.verdict_table import counts_table, dissent, sentence, titles_table
from reobserve_papers.report.gather import cited
from reobserve_papers.report.reported_claims import SIGNS, ReportedClaim

_ROOT = "../../.."  # from a page of findings

# Words of dissent and of the last column of claims that a note below the table, or none, replaces.
_AFTER = " The reading taken was chosen after its numbers were known."
_ALLOWED = ", which its samples allow:"
_NONE_DECIDES = "no single choice decides"


def verdicts(papers: Sequence[Paper]) -> str:
    """Titles, and counts of the verdicts on claims, with links to the pages of the papers."""
    titles = {paper.name: paper.stated for paper in papers}
    results = {paper.name: paper.result for paper in papers}
    text = f"{titles_table(titles, results)}\n{counts_table(_rows(papers))}"
    return re.sub(r"^\| `(\w+)` \|", r"| [`\1`](\1.md) |", text, flags=re.MULTILINE)


def what_it_is_about(papers: Sequence[Paper]) -> str:
    """The papers, with links to their pages."""
    listed = [
        (f"[`{paper.name}`]({paper.name}.md)", *map(plain, (cited(about), about["title"])))
        for paper, about in ((paper, paper.about) for paper in papers)
    ]
    return table(("paper", "by", "title"), listed)


def findings(paper: Paper) -> str:
    """Dissent on the title, and the other claims with their verdicts."""
    others = _claims(claim for claim in paper.claims if not _decides(claim))
    return f"{_dissent(paper)}\n## Other claims\n\n{others}"


def citations(root: Path, papers: Sequence[Paper]) -> str:
    """BibTeX entries of the project and the papers."""
    stated = read_yaml(root / "CITATION.cff")
    here = stated | {"title": f"{stated['title']}, version {stated['version']}"}
    here |= {"year": str(stated["date-released"])[:4], "type": "software"}
    known = {one["title"]: one for one in stated["references"]}
    entries = [_bibtex("reobserve", here)]
    entries += [
        _bibtex(paper.name, known.get(paper.about["title"], _as_cited(paper.about)))
        for paper in papers
    ]
    return f"```bibtex\n{''.join(entries)}```"


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
    """Title and result of a replication, the main claims, and what the paper leaves open."""
    about, title = paper.about, paper.title
    doi = about.get("doi")
    lines = [f"{plain(', '.join(about['authors']))}: *{plain(about['title'])}*"]
    lines += [str(about["year"])] if "year" in about else []
    lines += [f"[doi:{plain(doi)}](https://doi.org/{doi})"] if doi else []
    certain = sum(one.certainty == "certain" for one in paper.errata)
    config = f"{_ROOT}/config"
    return (
        f"**{plain(title.in_words)}.** {ticks(sentence(title, paper.result))}\n\n"
        f"{', '.join(lines)} ([cite](../project/citing.md)).\n\n"
        f"{_claims(filter(_decides, paper.claims))}\n"
        f"[How to read these tables](index.md#how-to-read-a-page), [dissent](#dissent). "
        f"[Checks and bounds]({config}/claims/{paper.name}.yaml), "
        f"[assumptions]({config}/papers/{paper.name}.yaml), "
        f"[{len(paper.errata)} errata, {certain} of them certain]"
        f"({config}/errata/{paper.name}.yaml), "
        f"[all figures]({_ROOT}/tests/reference/{paper.name}).\n\n"
        f"**What the paper leaves open.** {ticks(paper.registry.limitations)}"
    )


def _dissent(paper: Paper) -> str:
    """The readings that would give another title, as a table with links to the claims."""
    title = paper.title
    rows = []
    for said in title.dissent:
        word, _, rest = said.removesuffix(_AFTER).partition(": ")
        why, changes, *_ = *re.split(r"(?<=\.) (?=`|Then )", rest, maxsplit=1), ""
        rows.append((f"{word} †" if said.endswith(_AFTER) else word, why, changes))
    for said in title.undecided:
        word, changes = said.split(" if ", maxsplit=1)
        rows.append((word, "The samples leave this open.", f"{changes.replace(_ALLOWED, ':')}."))
    known = "|".join(claim.name for claim in paper.claims)
    linked = [
        (plain(word), ticks(why), re.sub(rf"`({known})`", r"[`\1`](#claim-\1)", ticks(changes)))
        for word, why, changes in rows
    ]
    taken_here = _AFTER.replace("taken", "taken here")
    note = f"\n†:{taken_here}\n" if any("†" in row[0] for row in rows) else ""
    counted = dissent(title).partition("\n")[0]
    listed = table(("title", "reading", "change"), linked) if rows else ""
    return f"## Dissent\n\n{counted}\n\n{listed}{note}"


def _claims(claims: Iterable[ReportedClaim]) -> str:
    """A table of claims, each with an anchor."""
    rows = [
        (
            f'<a id="claim-{claim.name}"></a>{ticks(claim.statement)}',
            chip(claim.verdict) + (f", {no_better}" if (no_better := _no_better(claim)) else ""),
            _share(claim),
        )
        for claim in claims
    ]
    return table(("claim", "verdict", "held in samples"), rows)


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
    joint = f": {plain(claim.separation)}" if claim.separation not in ("", _NONE_DECIDES) else ""
    share, low, high = (f"{100 * part:.0f}" for part in (found.share, found.low, found.high))
    if found.whole:
        return f"{share} % of all{joint}{baseline}"
    return f"{share} % ({low} to {high} %){joint}{baseline}"


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
