"""A real browser for tests of pages: the system's Chromium, driven by Playwright."""

from __future__ import annotations

import atexit
import os
import shutil
import subprocess
from functools import cache
from pathlib import Path

import pytest
from playwright.sync_api import Browser, sync_playwright

NAMES = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable")

MISSING = (
    "no Chromium on the PATH to open pages in; on Debian: apt-get install chromium, "
    "on Ubuntu: google-chrome from Google, since the package there is a stub for a snap"
)


def find_browser() -> str | None:
    """The first browser on the PATH that runs; a script that calls for a snap does not count."""
    for name in NAMES:
        path = shutil.which(name)
        if path is None:
            continue
        with Path(path).open("rb") as stream:
            start = stream.read(4096)
        if start.startswith(b"#!") and b"/snap/" in start:
            continue
        told = subprocess.run([path, "--version"], capture_output=True, text=True, check=False)
        if told.returncode == 0 and "Chrom" in told.stdout:
            return path
    return None


@cache
def _launched(path: str) -> Browser:
    """One for the whole process: Playwright cannot be started in it again while it runs."""
    playwright = sync_playwright().start()
    atexit.register(playwright.stop)
    return playwright.chromium.launch(executable_path=path)


@pytest.fixture(scope="session")
def browser() -> Browser:
    """Headless Chromium. Where there is none, tests are skipped; in CI they fail."""
    path = find_browser()
    if path is None:
        (pytest.fail if os.environ.get("CI") else pytest.skip)(MISSING)
    return _launched(path)
