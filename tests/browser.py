"""A real browser (the system's Chromium) for tests of pages, and the requirements on a page."""

from __future__ import annotations

import atexit
import os
import shutil
import subprocess
from functools import cache
from pathlib import Path

import pytest
from playwright.sync_api import Browser, Page, sync_playwright

NAMES = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable")

MISSING = (
    "no Chromium on the PATH to open pages in; on Debian: apt-get install chromium, "
    "on Ubuntu: google-chrome from Google, since the package there is a stub for a snap"
)


def find_browser() -> str | None:
    """The first working browser on the PATH; a script that requests a snap does not count."""
    for name in NAMES:
        path = shutil.which(name)
        if path is None:
            continue
        with Path(path).open("rb") as stream:
            start = stream.read(4096)
        if start.startswith(b"#!") and b"/snap/" in start:
            continue
        reported = subprocess.run([path, "--version"], capture_output=True, text=True, check=False)
        if reported.returncode == 0 and "Chrom" in reported.stdout:
            return path
    return None


# All visible text; of many elements with the same style only the first.
TEXT = """
  const seen = new Set();
  const sort = (element) => element ? `${element.tagName}.${element.getAttribute("class")}` : "";
  const text = [...document.body.querySelectorAll("*")].filter((element) => {
    const own = [...element.childNodes].some((n) => n.nodeType === 3 && n.textContent.trim());
    if (!own) return false;
    const up = element.parentElement;
    const alike = [element, up, up.parentElement, up.parentElement?.parentElement].map(sort).join();
    if (seen.has(alike) || !element.checkVisibility()) return false;
    seen.add(alike);
    return true;
  });
"""

# WCAG: the minimum contrast between text and background. All colours here are opaque.
CONTRAST = f"""() => {{ {TEXT}
  const channels = (text) => text.match(/[\\d.]+/g).map(Number);
  const light = (text) => {{
    const [r, g, b] = channels(text).slice(0, 3).map((c) => c / 255)
      .map((c) => (c <= 0.04045 ? c / 12.92 : ((c + 0.055) / 1.055) ** 2.4));
    return 0.2126 * r + 0.7152 * g + 0.0722 * b;
  }};
  const ground = (e) => getComputedStyle(e).backgroundColor;
  const solid = (e) => (channels(ground(e))[3] ?? 1) === 1;
  let worst = [Infinity, ""];
  for (const element of text) {{
    let behind = element;
    while (behind && !solid(behind)) behind = behind.parentElement;
    const one = light(getComputedStyle(element).color);
    const other = light(ground(behind ?? document.documentElement));
    const ratio = (Math.max(one, other) + 0.05) / (Math.min(one, other) + 0.05);
    if (ratio < worst[0]) worst = [ratio, element.outerHTML.slice(0, 200)];
  }}
  return worst;
}}"""

SMALLEST_TEXT = f"""() => {{ {TEXT}
  let smallest = [Infinity, ""];
  for (const element of text) {{
    const size = parseFloat(getComputedStyle(element).fontSize);
    if (size < smallest[0]) smallest = [size, element.outerHTML.slice(0, 200)];
  }}
  return smallest;
}}"""

PHONE = {"width": 360, "height": 740}


class Watched:
    """A page, with its errors and the requests it made while open."""

    def __init__(self, browser: Browser, address: str, **options: object) -> None:
        self.context = browser.new_context(**options)
        self.page: Page = self.context.new_page()
        self.complaints: list[str] = []
        self.requests: list[str] = []
        self.page.on("console", lambda message: self.complaints.append(message.text))
        self.page.on("pageerror", lambda error: self.complaints.append(str(error)))
        self.page.on("request", lambda request: self.requests.append(request.url))
        self.page.goto(address)


@cache
def _launched(path: str) -> Browser:
    """One instance per process: Playwright cannot be started twice."""
    playwright = sync_playwright().start()
    atexit.register(playwright.stop)
    return playwright.chromium.launch(executable_path=path)


@pytest.fixture(scope="session")
def browser() -> Browser:
    """Headless Chromium. Without it tests are skipped; in CI they fail."""
    path = find_browser()
    if path is None:
        (pytest.fail if os.environ.get("CI") else pytest.skip)(MISSING)
    return _launched(path)
