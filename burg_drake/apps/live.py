"""Shows a Meshcat view: as a saved page, or live until the user has seen enough."""

from __future__ import annotations

import argparse
import logging
import sys
import threading
from collections.abc import Sequence
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from pydrake.geometry import Meshcat

    from burg_drake.visualization.legend import ColorBar, LegendEntry


def open_view(arguments: argparse.Namespace) -> Meshcat:
    """The Meshcat that a verb draws into; an unwritable page is refused before any work.

    Raises:
        InvalidInputError: the page's folder cannot be written, or the port is taken.
    """
    from pathlib import Path

    from burg_drake.core.errors import InvalidInputError
    from burg_drake.core.files import writable_folder
    from burg_drake.visualization.scene_view import open_meshcat

    if arguments.html is not None:
        page = Path(arguments.html)
        if page.is_dir():
            raise InvalidInputError(
                f"--html {page} is a folder; give a file such as {page}/view.html"
            )
        writable_folder(page.parent)
    logging.getLogger("drake").setLevel(logging.WARNING)  # pydrake sets it when imported
    return open_meshcat(arguments.port)


def present(
    meshcat: Meshcat,
    arguments: argparse.Namespace,
    *,
    title: str,
    caption: Sequence[str] = (),
    legend: Sequence[LegendEntry | ColorBar] = (),
) -> None:
    """Saves the page if --html was given; else prints the address and waits, unless told not to."""
    if arguments.html is not None:
        from burg_drake.visualization.page import save_html

        save_html(meshcat, arguments.html, title=title, caption=caption, legend=legend)
        print(f"wrote {arguments.html}")
        return
    if arguments.no_wait:  # the address would be gone before anyone can open it
        print(f"{title}: not kept open; give --html FILE for a page that stays")
        return
    print(f"{title}: open {meshcat.web_url()} in a browser", flush=True)
    meshcat.Flush()
    wait()


def wait() -> None:
    """Returns on Enter (at a terminal) or Ctrl-C."""
    try:
        if sys.stdin is not None and sys.stdin.isatty():
            input("Press Enter to end. ")
        else:
            print("Press Ctrl-C to end.", flush=True)
            threading.Event().wait()
    except (KeyboardInterrupt, EOFError):
        print()
