"""Text in a page cannot run code, load resources or link to anything but the web."""

from __future__ import annotations

import base64
import hashlib
import re
from pathlib import Path
from typing import Any

import pytest

from reobserve.core.errors import InputError
from reobserve_papers.plotting.captions import render
from reobserve_papers.report import report_command
from reobserve_papers.report.markup import to_html, without_title

TITLES = [
    "|v|", "gain_", "*x", "`a", "`l <javascript:alert(1)>`__", "a\\", "x**2", "`code`", "[1]_",
    "anonymous__", ":math:`x`", "two\n\nparagraphs", "<b>&amp;</b>", "|", "**", "file:///etc/passwd",
    ".. raw:: html", "k_1 and pd_pi",
]  # fmt: skip


def caption(folder: Path, title: str) -> str:
    template = folder / "caption.rst"
    template.write_text(
        "**{{ figure.title }}** ({{ figure.source }}). It is *{{ figure.title }}* here, "
        "and {{ figure.title }} there, for {% for name in observers %}{{ name }}{% endfor %}.\n"
    )
    body: dict[str, Any] = {"title": title, "source": title}
    text = render(template, {"figure": body, "observers": {title: {}}}, [])
    return to_html("caption", text)


@pytest.mark.parametrize("title", TITLES)
def test_titles_and_labels_are_escaped(tmp_path: Path, title: str) -> None:
    page = caption(tmp_path, title)
    shown = " ".join(title.split()).replace("&", "&amp;").replace("<", "&lt;").replace(">", "&gt;")
    assert f"<strong>{shown}</strong>" in page
    assert f"<em>{shown}</em>" in page
    assert page.count(shown) == 5
    assert "href" not in page
    rest, source = without_title(page, title)
    assert source == " ".join(title.split())
    assert rest.startswith("<p>It is")


LINKS = [
    "`l <javascript:alert(1)>`__", "`l <JAVASCRIPT:alert(1)>`__", "`l <data:text/html,x>`__",
    "`l <vbscript:x>`__", "see mailto:a@b.org", "see file:///etc/passwd", "a@b.org",
    "`l <../other.html>`__", "`l <//elsewhere.org>`__",
]  # fmt: skip


@pytest.mark.parametrize("text", LINKS)
def test_only_web_links_are_kept(text: str) -> None:
    assert "href" not in to_html("caption", f"Before {text} after.")


def test_web_links_are_unchanged() -> None:
    page = to_html("caption", "`one <https://a.org>`__ and http://b.org/c.")
    assert re.findall(r'href="([^"]*)"', page) == ["https://a.org", "http://b.org/c"]


DIRECTIVES = [
    ".. raw:: html\n\n   <script>alert(1)</script>",
    ".. include:: /etc/passwd",
    ".. csv-table::\n   :file: /etc/passwd",
    ".. image:: http://elsewhere.org/a.png",
    ".. figure:: a.png",
    ".. role:: raw-html(raw)\n   :format: html\n\n:raw-html:`<script>alert(1)</script>`",
    ".. role:: x\n   :class: gap\n\n:x:`styled`",
    ".. meta::\n   :refresh: 0;url=http://elsewhere.org",
    ".. |s| image:: http://elsewhere.org/a.png\n\n|s|",
    ":raw:`<script>alert(1)</script>`",
    ".. math:: x",
    "Title\n=====\n\nText.",
]


@pytest.mark.parametrize("text", DIRECTIVES)
def test_directives_and_roles_are_refused(text: str) -> None:
    with pytest.raises(InputError, match=r"^caption: (holds a|is no reStructuredText)") as caught:
        to_html("caption", text)
    assert "root:" not in str(caught.value)


def test_classes_and_ids_from_text_are_removed() -> None:
    page = to_html(
        "caption", ".. class:: gap\n\nA paragraph.\n\n.. _top: https://a.org\n\nSee top_."
    )
    assert re.findall(r'(?:class|id)="([^"]*)"', page) == ["reference external"]


def digest(text: str) -> str:
    return "sha256-" + base64.b64encode(hashlib.sha256(text.encode()).digest()).decode()


def check_policy(page: str) -> None:
    policy = re.search(r'http-equiv="Content-Security-Policy" content="([^"]*)"', page)
    assert policy is not None
    rules = dict(rule.strip().split(" ", 1) for rule in policy[1].split(";"))
    assert rules["default-src"] == "'none'"
    assert rules["img-src"] == "data:"
    assert "unsafe" not in policy[1]
    # Neither of these falls back to default-src.
    assert rules["base-uri"] == rules["form-action"] == "'none'"
    scripts = re.findall(r"<script>(.*?)</script>", page, flags=re.DOTALL)
    styles = re.findall(r"<style>(.*?)</style>", page, flags=re.DOTALL)
    assert [f"'{digest(text)}'" for text in styles] == [rules["style-src"]]
    assert [f"'{digest(text)}'" for text in scripts] == [
        rules[name] for name in ("script-src",) if name in rules
    ]


def test_report_allows_only_its_own_script_and_style(project: Path) -> None:
    page = project / "results/report.html"
    report_command(project, page)
    check_policy(page.read_text(encoding="utf-8"))
    assert "script-src" in page.read_text(encoding="utf-8")
    assert not re.search(r"\son\w+=|\sstyle=", page.read_text(encoding="utf-8"))
