"""A real Chromium without a window, for pages.

It renders WebGL in software: tests wait for what a page says, never for frames or for time.
"""

from __future__ import annotations

import shutil
from collections.abc import Iterator
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
PATIENCE_MS = 1000.0 * HANG_GUARD
SIZE = {"width": 1280, "height": 800}


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
    """One a process, which all tests share; each has cookies of its own by `page`."""
    browser = playwright.chromium.launch(
        executable_path=chromium, args=list(ARGUMENTS), timeout=PATIENCE_MS
    )
    yield browser
    browser.close()


@pytest.fixture(scope="session", autouse=True)
def lamps_alone() -> Iterator[None]:
    """Pages are lit by lamps alone: without a graphics processor Chromium takes seconds for every
    picture of the surroundings that viser adds, and draws one frame a second meanwhile."""
    from burg_drake.ui.server import guarded_viser

    with pytest.MonkeyPatch.context() as patch:
        guarded_server = guarded_viser.guarded_server

        def lit_by_lamps(*arguments: Any) -> viser.ViserServer:
            server = guarded_server(*arguments)
            server.scene.configure_environment_map(None)
            server.scene.configure_default_lights(cast_shadow=False)
            return server

        patch.setattr(guarded_viser, "guarded_server", lit_by_lamps)
        yield


@pytest.fixture
def page(browser: sync_api.Browser) -> Iterator[sync_api.Page]:
    """A fresh tab of a fresh profile; the test fails if a script of the page does."""
    with browser.new_context(viewport=SIZE) as context:
        sync_api.expect.set_options(timeout=PATIENCE_MS)
        context.set_default_timeout(PATIENCE_MS)
        context.set_default_navigation_timeout(PATIENCE_MS)
        page = context.new_page()
        errors: list[str] = []
        page.on("pageerror", lambda error: errors.append(f"{error} {error.stack}"))
        yield page
        assert errors == []
