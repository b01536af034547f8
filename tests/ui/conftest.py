"""A real Chromium without a window, for pages.

It renders WebGL in software: tests wait for what a page says, never for frames or for time. A test
that fails tells what its page said last.
"""

from __future__ import annotations

import contextlib
import shutil
from collections.abc import Generator, Iterator
from typing import Any

import pytest

from tests.hang_guard import HANG_GUARD

viser = pytest.importorskip("viser", reason="pages need viser: pip install 'burg-drake[ui]'")
sync_api = pytest.importorskip("playwright.sync_api", reason="driven by playwright")

NAMES = ("chromium", "chromium-browser", "google-chrome")
ARGUMENTS = (
    "--no-sandbox",
    "--disable-background-networking",
    "--use-gl=angle",
    "--use-angle=swiftshader",
    "--enable-unsafe-swiftshader",
)
BROWSER_TIMEOUT_MS = 1000.0 * HANG_GUARD
"""Timeout for one action of a browser; the slowest takes 3 s on an idle machine."""
SIZE = {"width": 1280, "height": 800}
LAST_WORDS = 3000
"""Characters of a page's text in the report of a test that failed."""
_open_pages: dict[Any, list[str]] = {}
"""With what each has said on its console."""


@pytest.fixture(scope="session")
def chromium() -> str:
    """The system's Chromium; skips without one."""
    found = next(filter(None, map(shutil.which, NAMES)), None)
    if found is None:
        pytest.skip(f"no browser: none of {', '.join(NAMES)} is on the PATH")
    return found


@pytest.fixture(scope="session")
def playwright(chromium: str) -> Iterator[sync_api.Playwright]:
    """Drives browsers, from this thread."""
    with sync_api.sync_playwright() as driver:
        yield driver


@pytest.fixture(scope="session")
def browser(playwright: sync_api.Playwright, chromium: str) -> Iterator[sync_api.Browser]:
    """One browser per process, shared by all tests; `page` gives each its own cookies."""
    browser = playwright.chromium.launch(
        executable_path=chromium, args=list(ARGUMENTS), timeout=BROWSER_TIMEOUT_MS
    )
    yield browser
    browser.close()


@pytest.fixture(scope="session", autouse=True)
def lamps_alone() -> Iterator[None]:
    """Pages are lit by lamps alone: without a graphics processor Chromium takes seconds for every
    picture of the surroundings that viser adds, and draws one frame a second meanwhile."""
    from burg_drake.ui import guarded_viser

    with pytest.MonkeyPatch.context() as patch:
        guarded_server = guarded_viser.guarded_server

        def lit_by_lamps(*arguments: Any) -> viser.ViserServer:
            server = guarded_server(*arguments)
            server.scene.configure_environment_map(None)
            server.scene.configure_default_lights(cast_shadow=False)
            return server

        patch.setattr(guarded_viser, "guarded_server", lit_by_lamps)
        yield


@contextlib.contextmanager
def open_page(browser: sync_api.Browser, size: dict[str, int]) -> Iterator[sync_api.Page]:
    """A new tab in a new profile; raises an error that a script of the page raises."""
    with browser.new_context(viewport=size) as context:
        sync_api.expect.set_options(timeout=BROWSER_TIMEOUT_MS)
        context.set_default_timeout(BROWSER_TIMEOUT_MS)
        context.set_default_navigation_timeout(BROWSER_TIMEOUT_MS)
        page = context.new_page()
        errors: list[str] = []
        said = _open_pages[page] = []
        page.on("pageerror", lambda error: errors.append(f"{error} {error.stack}"))
        page.on("console", lambda message: said.append(f"{message.type}: {message.text}"))
        try:
            yield page
        finally:
            del _open_pages[page]
        assert errors == []


@pytest.fixture
def page(browser: sync_api.Browser) -> Iterator[sync_api.Page]:
    """A fresh tab for one test."""
    with open_page(browser, SIZE) as page:
        yield page


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport(item: pytest.Item) -> Generator[None, Any, Any]:
    """Adds the text and the console output of pages to the report of a failed test."""
    report = yield
    if report.failed:
        for page, said in _open_pages.items():
            try:
                text = page.locator("body").inner_text(timeout=5000.0)
            except sync_api.Error as error:
                text = f"(it does not answer: {error.message.splitlines()[0]})"
            shown = text[:LAST_WORDS] + "\n\nConsole:\n" + "\n".join(said[-20:])
            report.sections.append((f"page {page.url}", shown))
    return report
