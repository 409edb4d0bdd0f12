"""Pages of each kind in a real browser: light, dark and on a phone; the search."""

from __future__ import annotations

import re
import threading
from collections.abc import Iterator
from functools import partial
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer

import pytest
from playwright.sync_api import Browser

from tests.browser import CONTRAST, PHONE, Watched

from .conftest import Site

# One of each kind.
KINDS = (
    "", "start/library/", "findings/lie/", "project/quality/",
    "reference/library/observers/ilo/", "reference/commands/", "reference/configuration/",
    "reference/equations/",
)  # fmt: skip

WIDE = {"width": 1280, "height": 900}

# Elements that overflow to the right, except inside scrolling containers.
OUTSIDE = """() => {
  const scrolls = (e) => e && e !== document.body
    && (["auto", "scroll", "hidden"].includes(getComputedStyle(e).overflowX)
      || scrolls(e.parentElement));
  return [...document.querySelectorAll("article *")]
    .filter((e) => e.getBoundingClientRect().right > innerWidth + 1)
    .filter((e) => e.checkVisibility() && !scrolls(e.parentElement))
    .map((e) => e.outerHTML.slice(0, 120));
}"""


class _Quiet(SimpleHTTPRequestHandler):
    def log_message(self, *_: object) -> None:
        """Print nothing."""


class _Server(ThreadingHTTPServer):
    def handle_error(self, *_: object) -> None:
        """Ignore requests aborted by leaving a page."""


@pytest.fixture(scope="module")
def address(site: Site) -> Iterator[str]:
    """The address of the site on a plain static server."""
    server = _Server(("127.0.0.1", 0), partial(_Quiet, directory=str(site.folder)))
    thread = threading.Thread(target=server.serve_forever)
    thread.start()
    yield f"http://127.0.0.1:{server.server_port}/"
    server.shutdown()
    thread.join()
    server.server_close()


def finish(opened: Watched, address: str) -> None:
    """Close the page; it must have neither errors nor requests to other hosts."""
    opened.context.close()
    assert opened.complaints == []
    assert [url for url in opened.requests if not url.startswith((address, "data:"))] == []


def test_text_has_contrast_and_nothing_overflows(browser: Browser, address: str) -> None:
    """In light and dark; on a phone wide elements scroll themselves, not the page."""
    opened = Watched(browser, address, viewport=WIDE)
    page = opened.page
    for kind in KINDS:
        page.set_viewport_size(WIDE)
        page.goto(address + kind)
        page.add_style_tag(
            content="* { transition: none !important; }"
        )  # otherwise colours appear late
        for scheme in ("default", "slate"):
            page.evaluate(
                "(one) => document.body.setAttribute(`data-md-color-scheme`, one)", scheme
            )
            ground = page.evaluate("getComputedStyle(document.body).backgroundColor")
            channels = [int(part) for part in ground[4:-1].split(",")]
            assert max(channels) < 60 if scheme == "slate" else min(channels) > 200
            ratio, where = page.evaluate(CONTRAST)
            assert ratio >= 4.5, (kind, scheme, where)
        page.set_viewport_size(PHONE)
        assert page.evaluate("document.documentElement.scrollWidth") <= PHONE["width"], kind
        assert page.evaluate(OUTSIDE) == [], kind
    finish(opened, address)


@pytest.mark.parametrize(
    ("asked", "leads_to"),
    [
        ("SampledILO", "/reference/library/observers/ilo/"),
        *((asked, "first") for asked in ("missing measurements", "kalman", "outliers", "resample")),
    ],
)
def test_site_search_leads_to_pages_for_users_first(
    browser: Browser, address: str, asked: str, leads_to: str
) -> None:
    opened = Watched(browser, address, viewport=WIDE)
    page = opened.page
    page.locator("input[name=query]").click()
    page.keyboard.type(asked)
    wanted = "" if leads_to == "first" else f"[href*='{leads_to}']"
    found = page.locator(f".md-search-result__link{wanted}").first
    found.wait_for()
    first = page.locator(".md-search-result__link").first.get_attribute("href") or ""
    assert re.search(r"/(start|how-to|tutorials|explanation)/", first), first
    finish(opened, address)


def test_colour_scheme_follows_the_system_until_chosen(browser: Browser, address: str) -> None:
    """The system's scheme, until another is chosen, which then persists."""
    scheme = "data-md-color-scheme"
    opened = Watched(browser, f"{address}findings/", viewport=PHONE, color_scheme="dark")
    page = opened.page
    assert page.locator("body").get_attribute(scheme) == "slate"
    page.locator("label[for=__palette_0]").first.click()
    page.goto(f"{address}findings/ilo/")
    assert page.locator("body").get_attribute(scheme) == "default"
    finish(opened, address)
