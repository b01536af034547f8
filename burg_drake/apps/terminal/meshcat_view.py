"""Shows a Meshcat view: as a saved page, or live until the user has seen enough."""

from __future__ import annotations

import argparse
import logging
import select
import sys
import time
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from pydrake.geometry import Meshcat

    from burg_drake.visualization.grasps import GraspPicker
    from burg_drake.visualization.style import ColorBar, LegendEntry

POLL_INTERVAL = 0.1
"""Between looks at the controls of a live view [s]."""


def open_view(arguments: argparse.Namespace) -> Meshcat:
    """The Meshcat that a verb draws into; an unwritable page is refused before any work.

    Raises:
        InvalidInputError: the page's folder cannot be written, or the port is taken.
    """
    from pathlib import Path

    from burg_drake.core import InvalidInputError
    from burg_drake.core.files import writable_folder
    from burg_drake.visualization.scenes import open_meshcat

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
    controls: GraspPicker | None = None,
) -> None:
    """Saves the page if --html was given; else prints the address and waits, unless told not to.

    Args:
        meshcat: the view.
        arguments: those of `add_view`.
        title: of the page.
        caption: lines of the page.
        legend: of the page.
        controls: of the page; in the live view a slider of Meshcat does the same.
    """
    if arguments.html is not None:
        from burg_drake.visualization import save_html

        save_html(
            meshcat, arguments.html, title=title, caption=caption, legend=legend, controls=controls
        )
        print(f"wrote {arguments.html}")
        return
    if arguments.no_wait:  # the address would be gone before anyone can open it
        print(f"{title}: not kept open; give --html FILE for a page that stays")
        return
    print(f"{title}: open {meshcat.web_url()} in a browser", flush=True)
    if controls is not None:
        controls.add_slider(meshcat)
    meshcat.Flush()
    wait(None if controls is None else lambda: controls.follow_slider(meshcat))


def wait(poll: Callable[[], None] | None = None) -> None:
    """Returns on Enter (at a terminal) or Ctrl-C.

    Args:
        poll: called several times a second until then.
    """
    terminal = sys.stdin is not None and sys.stdin.isatty()
    try:
        key = "Enter" if terminal else "Ctrl-C"
        print(f"It is served until you press {key}.", flush=True)
        while True:
            if poll is not None:
                poll()
            if not terminal:
                time.sleep(POLL_INTERVAL)
            elif select.select([sys.stdin], [], [], POLL_INTERVAL)[0]:
                return
    except KeyboardInterrupt:
        print()


def open_in_browser(url: str) -> None:
    """Opens a page in the user's browser, or says that there is none."""
    import webbrowser

    if not webbrowser.open(url):
        print("burg-drake: no browser was found to open it in", file=sys.stderr)
