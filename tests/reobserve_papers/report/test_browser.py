"""The page in a real browser: whole and with gaps, wide and narrow, dark, printed, zoomed."""

from __future__ import annotations

import re
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path

import pytest
from playwright.sync_api import Browser, Page
from playwright.sync_api import TimeoutError as TooLate

from tests.browser import CONTRAST, PHONE, SMALLEST_TEXT, Watched

pytestmark = pytest.mark.nightly

WIDE = {"width": 1400, "height": 900}

# For each image: its visibility after scrolling, natural width, width, and length of its text.
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


@pytest.fixture(scope="module", params=["whole_page", "page_with_gaps"])
def file(request: pytest.FixtureRequest) -> Path:
    """Each of the two pages."""
    found: Path = request.getfixturevalue(request.param)
    return found


@pytest.fixture(scope="module")
def watched(browser: Browser, file: Path) -> Iterator[Watched]:
    """A page on a wide screen; it must have no errors and no network requests."""
    opened = Watched(browser, file.as_uri(), viewport=WIDE)
    yield opened
    outside = [url for url in opened.requests if not url.startswith(("data:", file.as_uri()))]
    opened.context.close()
    assert opened.complaints == []
    assert outside == []


def test_every_figure_is_visible(watched: Watched, file: Path) -> None:
    figures = watched.page.locator("article.drawn")
    missing = watched.page.locator("article.drawn .card .gap").count()
    found = watched.page.evaluate(FIGURES)
    assert len(found) == figures.count() - missing
    assert figures.count() > 0
    for seen, natural, width, reported in found:
        assert seen
        assert natural > 0
        assert width > 250
        assert reported > 20
    assert missing == (1 if "gaps" in file.parts[-3] else 0)


def test_link_into_a_closed_section_opens_it(watched: Watched) -> None:
    page = watched.page
    name = page.locator("details:not([open]) [id]").first.get_attribute("id")
    inside = page.locator(f"[id='{name}']")
    assert not inside.is_visible()
    page.evaluate("(name) => (location.hash = name)", name)
    inside.wait_for(state="visible")


def test_text_has_contrast_in_both_colour_schemes(watched: Watched) -> None:
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


@pytest.mark.parametrize("width", [1280, 1152, 961, 800])
def test_window_needs_no_horizontal_scrolling(watched: Watched, width: int) -> None:
    page = watched.page
    page.set_viewport_size({"width": width, "height": 900})
    for _ in range(2):
        assert page.evaluate("document.documentElement.scrollWidth - innerWidth") <= 0
        fits = "(table) => table.scrollWidth <= table.parentElement.clientWidth"
        assert page.locator("table.papers").evaluate(fits), "the first table is seen whole"
        page.evaluate(OPEN_ALL)
    page.set_viewport_size(WIDE)


def test_phone_needs_no_horizontal_scrolling(browser: Browser, file: Path) -> None:
    phone = {"is_mobile": True, "has_touch": True, "device_scale_factor": 2}
    opened = Watched(browser, file.as_uri(), viewport=PHONE, **phone)
    for _ in range(2):
        assert opened.page.evaluate("document.documentElement.scrollWidth") <= PHONE["width"]
        size, where = opened.page.evaluate(SMALLEST_TEXT)
        assert size >= 13.9, where
        opened.page.evaluate(OPEN_ALL)
    assert opened.complaints == []
    opened.context.close()


def scale(page: Page) -> float:
    return float(page.locator("dialog").get_attribute("data-scale"))


def test_figure_zooms_by_keyboard_and_wheel(browser: Browser, small_page: Path) -> None:
    opened = Watched(browser, small_page.as_uri(), viewport=WIDE)
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


def test_figure_zooms_by_pinch(browser: Browser, small_page: Path) -> None:
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
    # The browser may merge a tap right after a pinch into it; a person would tap again.
    dialog, close = page.locator("dialog"), page.get_by_role("button", name="Close")
    for _ in range(3):
        close.tap()
        with suppress(TooLate):
            dialog.wait_for(state="hidden", timeout=5_000)
            break
    assert not dialog.is_visible()
    opened.context.close()


def test_figure_opens_without_javascript(browser: Browser, small_page: Path) -> None:
    size = {"width": 1000, "height": 700}
    opened = Watched(browser, small_page.as_uri(), java_script_enabled=False, viewport=size)
    figure = opened.page.locator("article.drawn").first
    figure.locator("a.zoom").click()
    box = figure.locator("a.zoom").bounding_box()
    assert (box["x"], box["y"], box["width"], box["height"]) == (0, 0, 1000, 700)
    figure.locator("a.unzoom").click()
    assert figure.locator("a.zoom").bounding_box()["width"] < 800
    opened.context.close()


def test_print_shows_what_is_open_and_cuts_no_figure(browser: Browser, small_page: Path) -> None:
    opened = Watched(browser, small_page.as_uri())
    page = opened.page
    short = page.pdf(prefer_css_page_size=True)
    sizes = set(re.findall(rb"/MediaBox \[0 0 ([\d.]+) ([\d.]+)\]", short))
    assert {(round(float(w)), round(float(h))) for w, h in sizes} == {(595, 842)}, "A4"
    page.emulate_media(media="print")
    assert not page.locator("nav.contents").is_visible()
    assert not page.locator("article.claim").first.is_visible()
    breaks = "(figures) => figures.map((one) => getComputedStyle(one).breakInside)"
    assert set(page.locator("figure").evaluate_all(breaks)) == {"avoid"}
    page.emulate_media(media="screen")
    page.get_by_role("button", name="Open all details").click()
    page.emulate_media(media="print")
    assert page.locator("article.claim").first.is_visible()
    assert len(page.pdf(prefer_css_page_size=True)) > len(short)
    opened.context.close()


def test_claims_are_filtered_by_verdict_and_links_show_them_again(
    browser: Browser, whole_page: Path
) -> None:
    opened = Watched(browser, whole_page.as_uri(), viewport=WIDE)
    page = opened.page
    rows = page.locator("tr[data-verdict]")
    verdicts = rows.evaluate_all("(all) => all.map((one) => one.dataset.verdict)")
    mains = page.locator("tr[data-main]").count()
    counted = page.locator("td.count a[data-filter]").first
    word, number = counted.get_attribute("data-filter"), int(counted.inner_text().split()[0])
    counted.click()
    shown = "(all) => all.filter((one) => one.checkVisibility()).map((one) => one.dataset.verdict)"
    assert rows.evaluate_all(shown) == [one for one in verdicts if one == word]
    claims = counted.get_attribute("href").removeprefix("#")
    of_paper = page.locator(f"section[aria-labelledby='{claims}'] tr[data-verdict='{word}']")
    assert number == of_paper.count()
    assert page.locator("#filter output").inner_text() == f"{verdicts.count(word)} claims"
    page.get_by_role("button", name="All", exact=True).click()
    page.get_by_label("main claims only").check()
    assert page.locator("#filter output").inner_text() == f"{mains} claims"
    hidden = page.locator("article.claim:not([data-main])").first.get_attribute("id")
    page.evaluate("(name) => (location.hash = name)", hidden)
    page.locator(f"[id='{hidden}']").wait_for(state="visible")
    assert opened.complaints == []
    opened.context.close()


def test_title_of_an_enlarged_figure_covers_nothing(browser: Browser, small_page: Path) -> None:
    opened = Watched(browser, small_page.as_uri(), viewport={"width": 1280, "height": 900})
    page = opened.page
    page.locator("a.zoom").first.click()
    image, title = (page.locator(one).bounding_box() for one in ("dialog img", ".controls p"))
    assert image["y"] + image["height"] <= title["y"]
    opened.context.close()


def test_phone_has_a_way_back_to_the_contents(browser: Browser, small_page: Path) -> None:
    opened = Watched(browser, small_page.as_uri(), viewport=PHONE, is_mobile=True, has_touch=True)
    page = opened.page
    page.evaluate("scrollTo(0, document.body.scrollHeight)")
    page.get_by_role("link", name="Contents").last.tap()
    page.wait_for_function("scrollY < 200")
    opened.context.close()
