"""The one file that the door serves: viser's page in our style, with words for browsers that cannot
run it."""

from __future__ import annotations

import html
from importlib.resources import files

from burg_drake.ui.server.uploads import LARGEST_UPLOAD

POLICY = (
    "default-src 'none'; script-src 'unsafe-inline' 'unsafe-eval'; worker-src blob: data:;"
    " connect-src 'self' blob: data:; img-src blob: data:;"
    " style-src 'unsafe-inline'; font-src data:; base-uri 'none'; form-action 'none';"
    " frame-ancestors 'none'"
)
"""viser's page is one file, which unpacks its scripts and evaluates glue of WebAssembly. It may
load nothing, and connect to nothing but this server, whatever an address (`?websocket=`) says."""
WITHOUT_SCRIPTS = (
    "This page needs JavaScript, which is switched off in this browser: allow it for this address"
    " and reload."
)


def first_page(title: str) -> str:
    """viser's page under another title, with a script before its own and a style sheet after its
    own, which counts whether panels are open or folded.

    Args:
        title: of the page.
    """
    script = _read("burg_drake", "ui/server/first_page.js")
    script = script.replace("LARGEST_UPLOAD = 0;", f"LARGEST_UPLOAD = {LARGEST_UPLOAD};")
    style = _read("burg_drake", "ui/server/page.css")
    page = _read("viser", "client/build/index.html")
    for old, new in (
        ("<title>Viser</title>", f"<title>{html.escape(title)}</title>\n<script>{script}</script>"),
        ("You need to enable JavaScript to run this app.", WITHOUT_SCRIPTS),
        ("</body>", f"<style>{style}</style>\n</body>"),
    ):
        page = page.replace(old, new, 1)
    return page


def _read(package: str, path: str) -> str:
    return files(package).joinpath(*path.split("/")).read_text(encoding="utf-8")
