"""The page in a real browser: whole and with gaps, on a phone, in the dark, printed, zoomed."""

from __future__ import annotations

import re
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path

import pytest
from playwright.sync_api import Browser, Page
from playwright.sync_api import TimeoutError as TooLate

from tests.browser import CONTRAST, PHONE, SMALLEST_TEXT, Watched

PAGES = ("whole_page", "page_with_gaps")

# Of each image: seen in the window once scrolled to, natural width, width, length of its text.
FIGURES = """async () => {
  const found = [];
  for (const image of document.querySelectorAll("article.drawn figure img")) {
    image.scrollIntoView({ behavior: "instant", block: "center" });
    await image.decode();
    const box = image.getBoundingClientRect();
    const seen = image.checkVisibility() && box.top < innerHeight && box.bottom > 0;
    found.push([seen, image.naturalWidth, box.width, image.alt.length]);
  }
  return found;
}"""

OPEN_ALL = "document.querySelectorAll('details').forEach((box) => (box.open = true))"


@pytest.fixture(scope="module", params=PAGES)
def file(request: pytest.FixtureRequest) -> Path:
    """Each of the two pages."""
    found: Path = request.getfixturevalue(request.param)
    return found


@pytest.fixture(scope="module")
def watched(browser: Browser, file: Path) -> Iterator[Watched]:
    """A page on a wide screen; it must neither complain nor ask the network for anything."""
    opened = Watched(browser, file.as_uri(), viewport={"width": 1400, "height": 900})
    yield opened
    outside = [url for url in opened.requests if not url.startswith(("data:", file.as_uri()))]
    opened.context.close()
    assert opened.complaints == []
    assert outside == []


def test_every_figure_is_seen(watched: Watched, file: Path) -> None:
    figures = watched.page.locator("article.drawn")
    missing = watched.page.locator("article.drawn .card .gap").count()
    found = watched.page.evaluate(FIGURES)
    assert len(found) == figures.count() - missing
    assert figures.count() > 0
    for seen, natural, width, told in found:
        assert seen
        assert natural > 0
        assert width > 250
        assert told > 20
    assert missing == (1 if "gaps" in file.parts[-3] else 0)


def test_links_work(watched: Watched, file: Path) -> None:
    page = watched.page
    dead = page.evaluate(
        """() => [...document.querySelectorAll("a[href^='#'], use[href^='#']")]
          .map((link) => link.getAttribute("href").slice(1))
          .filter((id) => !document.getElementById(id))"""
    )
    assert dead == []
    ids = page.evaluate("() => [...document.querySelectorAll('[id]')].map((e) => e.id)")
    assert len(ids) == len(set(ids))
    links = page.evaluate("() => [...document.links].map((link) => link.getAttribute('href'))")
    files = {link for link in links if not link.startswith(("#", "https://doi.org/"))}
    missing = [link for link in sorted(files) if not (file.parent / link).is_file()]
    assert missing == []


def test_a_link_into_something_closed_opens_it(watched: Watched) -> None:
    page = watched.page
    made = page.locator("article.drawn a", has_text="How it was made").first
    box = page.locator(f"[id='{made.get_attribute('href')[1:]}']")
    assert not box.evaluate("(box) => box.open")
    made.click()
    page.wait_for_function("(box) => box.open", arg=box.element_handle())
    assert box.locator("pre, .gap").first.is_visible()


def test_text_stands_out_in_both_schemes(watched: Watched) -> None:
    page = watched.page
    page.evaluate(OPEN_ALL)
    for scheme in ("light", "dark"):
        page.emulate_media(color_scheme=scheme)
        ground = page.evaluate("getComputedStyle(document.documentElement).backgroundColor")
        channels = [int(part) for part in re.findall(r"\d+", ground)]
        assert max(channels) < 60 if scheme == "dark" else min(channels) > 200
        ratio, where = page.evaluate(CONTRAST)
        assert ratio >= 4.5, where
        card = page.locator(".card").first
        assert card.evaluate("(c) => getComputedStyle(c).backgroundColor") == "rgb(255, 255, 255)"


def test_a_phone_shows_it_without_scrolling_sideways(browser: Browser, file: Path) -> None:
    opened = Watched(
        browser,
        file.as_uri(),
        viewport=PHONE,
        is_mobile=True,
        has_touch=True,
        device_scale_factor=2,
    )
    page = opened.page
    for _ in range(2):
        width = page.evaluate("document.documentElement.scrollWidth")
        assert width <= PHONE["width"]
        size, where = page.evaluate(SMALLEST_TEXT)
        assert size >= 13.9, where
        page.evaluate(OPEN_ALL)
    assert opened.complaints == []
    opened.context.close()


def scale(page: Page) -> float:
    return float(page.locator("dialog").get_attribute("data-scale"))


def test_a_figure_is_enlarged_by_keyboard_and_wheel(browser: Browser, small_page: Path) -> None:
    opened = Watched(browser, small_page.as_uri(), viewport={"width": 1400, "height": 900})
    page = opened.page
    dialog, image = page.locator("dialog"), page.locator("dialog img")
    first = page.locator("a.zoom").first
    first.focus()
    page.keyboard.press("Enter")
    assert dialog.is_visible()
    box = image.bounding_box()
    assert box["width"] > 1300 or box["height"] > 850, "it fills the window"
    fitted = scale(page)
    page.keyboard.press("+")
    page.keyboard.press("+")
    assert scale(page) == pytest.approx(1.96 * fitted, rel=1e-2)
    before = image.bounding_box()["x"]
    page.keyboard.press("ArrowLeft")
    assert image.bounding_box()["x"] > before
    page.keyboard.press("-")
    page.keyboard.press("0")
    assert scale(page) == pytest.approx(fitted, rel=1e-2)
    page.mouse.move(300, 300)
    page.mouse.wheel(0, -500)
    page.wait_for_function(f"document.querySelector('dialog').dataset.scale > {1.5 * fitted}")
    page.keyboard.press("Escape")
    dialog.wait_for(state="hidden")
    page.wait_for_function("(link) => link === document.activeElement", arg=first.element_handle())
    assert opened.complaints == []
    opened.context.close()


def test_two_fingers_enlarge_a_figure(browser: Browser, small_page: Path) -> None:
    opened = Watched(browser, small_page.as_uri(), viewport=PHONE, is_mobile=True, has_touch=True)
    page = opened.page
    page.locator("a.zoom").first.tap()
    start = scale(page)
    session = opened.context.new_cdp_session(page)
    for kind, half in (("touchStart", 40), ("touchMove", 80), ("touchMove", 120), ("touchEnd", 0)):
        points = [{"x": 180 + side * half, "y": 300, "id": side + 1} for side in (-1, 1)]
        session.send(
            "Input.dispatchTouchEvent", {"type": kind, "touchPoints": points if half else []}
        )
    page.wait_for_function(f"document.querySelector('dialog').dataset.scale > {2.8 * start}")
    assert scale(page) == pytest.approx(3 * start, rel=0.05)
    # The browser may take a tap right after two fingers for one of theirs; a person taps again.
    dialog, close = page.locator("dialog"), page.get_by_role("button", name="Close")
    for _ in range(3):
        close.tap()
        with suppress(TooLate):
            dialog.wait_for(state="hidden", timeout=5_000)
            break
    assert not dialog.is_visible()
    opened.context.close()


def test_without_a_script_a_figure_still_opens(browser: Browser, small_page: Path) -> None:
    opened = Watched(
        browser,
        small_page.as_uri(),
        java_script_enabled=False,
        viewport={"width": 1000, "height": 700},
    )
    page = opened.page
    figure = page.locator("article.drawn").first
    figure.locator("a.zoom").click()
    box = figure.locator("a.zoom").bounding_box()
    assert (box["x"], box["y"], box["width"], box["height"]) == (0, 0, 1000, 700)
    figure.locator("a.unzoom").click()
    assert figure.locator("a.zoom").bounding_box()["width"] < 800
    opened.context.close()


def test_print_has_no_contents_and_cuts_no_figure(watched: Watched) -> None:
    page = watched.page
    page.emulate_media(media="print")
    page.evaluate(OPEN_ALL.replace("true", "false"))
    assert not page.locator("nav.contents").is_visible()
    inside = page.locator("details:not([open]) > :not(summary)").first
    assert inside.bounding_box()["height"] > 0, "what is closed is shown"
    breaks = (
        "() => [...document.querySelectorAll('figure')].map((f) => getComputedStyle(f).breakInside)"
    )
    assert set(page.evaluate(breaks)) == {"avoid"}
    page.emulate_media(media="screen")


def test_print_to_pdf_opens_what_is_closed(browser: Browser, small_page: Path) -> None:
    opened = Watched(browser, small_page.as_uri())
    page = opened.page
    closed = "document.querySelectorAll('details:not([open])').length"
    before = page.evaluate(closed)
    assert before > 0
    page.evaluate(f"addEventListener('beforeprint', () => (window.closedInPrint = {closed}))")
    printed = page.pdf(prefer_css_page_size=True)
    assert printed.startswith(b"%PDF")
    assert page.evaluate("window.closedInPrint") == 0
    assert page.evaluate(closed) == before, "and closed again"
    sizes = set(re.findall(rb"/MediaBox \[0 0 ([\d.]+) ([\d.]+)\]", printed))
    assert {(round(float(w)), round(float(h))) for w, h in sizes} == {(595, 842)}, "A4"
    opened.context.close()
