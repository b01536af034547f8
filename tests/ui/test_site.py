"""The built site can be read by everyone, on a phone as well, and search finds what is asked."""

from __future__ import annotations

import functools
import threading
from collections.abc import Iterator
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer

import pytest

sync_api = pytest.importorskip("playwright.sync_api")
axe = pytest.importorskip("axe_playwright_python.sync_playwright")
pytest.importorskip("furo")
pytestmark = pytest.mark.thorough

from tools.site import build_site  # noqa: E402

PAGES = (
    "index.html",
    "start.html",
    "gallery.html",
    "gallery/04_evaluate.html",
    "comparison.html",
    "howto/index.html",
    "reference/index.html",
    "tutorials/own_object.html",
    "reference/documents.html",
    "reference/commands/evaluate.html",
    "reference/python/index.html",
    "concepts/outcomes.html",
)

WCAG = {"runOnly": ["wcag2a", "wcag2aa", "wcag21a", "wcag21aa"]}
"""What the Web Content Accessibility Guidelines 2.1 demand at level AA."""


class Quiet(SimpleHTTPRequestHandler):
    def log_message(self, format: str, *arguments: object) -> None:
        pass


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Iterator[str]:
    """The address of the site, which is built without a warning."""
    folder = tmp_path_factory.mktemp("site")
    assert build_site(folder / "html", source=folder / "source") == 0
    handler = functools.partial(Quiet, directory=str(folder / "html"))
    with ThreadingHTTPServer(("127.0.0.1", 0), handler) as server:
        threading.Thread(target=server.serve_forever, daemon=True).start()
        yield f"http://127.0.0.1:{server.server_port}"
        server.shutdown()


@pytest.mark.parametrize("scheme", ["light", "dark"])
@pytest.mark.parametrize("width", [1280, 390])
def test_pages_are_accessible(
    site: str,
    browser: sync_api.Browser,
    width: int,
    scheme: str,
) -> None:
    found = {}
    with browser.new_page(viewport={"width": width, "height": 900}, color_scheme=scheme) as page:
        for name in PAGES:
            page.goto(f"{site}/{name}")
            found[name] = [
                f"{v['id']}: {[node['html'][:100] for node in v['nodes'][:3]]}"
                for v in axe.Axe().run(page, options=WCAG).response["violations"]
            ]
            wide = page.evaluate("document.documentElement.scrollWidth")
            assert wide <= width, f"{name} is {wide} pixels wide"
    assert {name: violations for name, violations in found.items() if violations} == {}


def test_search_finds_a_question(site: str, browser: sync_api.Browser) -> None:
    with browser.new_page() as page:
        page.goto(f"{site}/search.html?q=watertight")
        page.get_by_role("link", name="My mesh is not watertight").first.wait_for()


def test_schemas_and_3d_pages_are_published(site: str, browser: sync_api.Browser) -> None:
    with browser.new_page() as page:
        for name in ("schema/scene.json", "live/frames.html"):
            answer = page.goto(f"{site}/{name}")
            assert answer is not None and answer.ok
