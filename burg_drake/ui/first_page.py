"""The one file that the door serves: viser's page, with words for browsers that cannot run it."""

from __future__ import annotations

import html
from functools import cache
from importlib.resources import files

POLICY = (
    "default-src 'none'; script-src 'unsafe-inline' 'unsafe-eval'; worker-src blob: data:;"
    " connect-src 'self' blob: data:; img-src blob: data:;"
    " style-src 'unsafe-inline'; font-src data:; base-uri 'none'; form-action 'none';"
    " frame-ancestors 'none'"
)
"""viser's page is one file, which unpacks its scripts and evaluates glue of WebAssembly. It may
load nothing, and connect to nothing but this server, whatever an address (`?websocket=`) says."""


def first_page(title: str) -> str:
    """viser's page under another title, with words for browsers that cannot show it.

    Args:
        title: of the page.
    """
    page, name = _of_viser(), html.escape(title)
    page = page.replace("<title>Viser</title>", f"<title>{name}</title>", 1)
    return page.replace("<body>", f"<body>\n{_ADDED}", 1)


@cache
def _of_viser() -> str:
    return (files("viser") / "client" / "build" / "index.html").read_text(encoding="utf-8")


_ADDED = ""
