"""`burg-drake setup`: the scene editor in the browser."""

from __future__ import annotations

import argparse
import contextlib
import os
import sys
from typing import TYPE_CHECKING

from burg_drake import core
from burg_drake.apps import options
from burg_drake.apps.terminal import (
    ignore_interrupts,
    open_in_browser,
    print_remark,
    sigterm_as_interrupt,
    wait_for_interrupt,
)

if TYPE_CHECKING:
    from burg_drake.compose import ComposeSession
    from burg_drake.ui import ServedPage


def add_setup_options(parser: options.Parser) -> None:
    """Adds the options of `burg-drake setup`."""
    parser.epilog = options.examples_text(
        "burg-drake setup",
        "burg-drake setup my_scene.yaml --station my_station.yaml",
        "burg-drake setup my_library",
        "burg-drake setup tabletop_six --open",
        "burg-drake setup my_scene.yaml --host 0.0.0.0",
    )
    default_library = "household"
    parser.add_argument(
        "what",
        metavar="SCENE|LIBRARY",
        nargs="?",
        default=default_library,
        help="scene to edit, or library for a new scene: a path, or built-in:"
        f" {options.scene_names()}, {default_library} (default: %(default)s)",
    )
    options.add_station(parser)
    options.add_page_options(
        parser, "others can open it by the address that is printed, good for one browser"
    )


def run_setup(arguments: argparse.Namespace) -> int:
    """Serves the page until Ctrl-C."""
    from burg_drake.ui import require_viser

    require_viser()  # before steps that take time
    limit_picture_size()
    with sigterm_as_interrupt():
        closing = contextlib.ExitStack()
        try:
            from burg_drake.compose import ComposeSession
            from burg_drake.station import load_station

            station = load_station(arguments.station)
            session = closing.enter_context(ComposeSession.open(arguments.what, station))
            closing.callback(_print_unsaved, session)
            served = _serve_setup_page(arguments, session, closing)
            _print_opened(served, session)
            if arguments.open:
                open_in_browser(served.url)
            wait_for_interrupt()
        except KeyboardInterrupt:
            print(file=sys.stderr)
        finally:
            with ignore_interrupts():
                closing.close()
    return 0


def limit_picture_size() -> None:
    """Limits the size of pictures that OpenCV reads; to be called before its import."""
    max_pixels = 1 << 27  # OpenCV's own limit of 2**30 would allow three gigabytes.
    os.environ.setdefault("OPENCV_IO_MAX_IMAGE_PIXELS", str(max_pixels))


def _serve_setup_page(
    arguments: argparse.Namespace, session: ComposeSession, closing: contextlib.ExitStack
) -> ServedPage:
    """Serves the page until all is closed."""
    from burg_drake.ui import SetupPage, serve_page

    served = closing.enter_context(
        serve_page(arguments.host, arguments.port, title="burg_drake: setup")
    )
    closing.callback(SetupPage(served.server, session).close)
    session.announce(served.address)
    served.admission.on_admitted = lambda address: print(
        f"opened by {address}; another browser: open {served.url}", flush=True
    )
    return served


def _print_opened(served: ServedPage, session: ComposeSession) -> None:
    view = session.view
    count = len(view.instances)
    objects = "no objects yet" if count == 0 else core.count_with_noun(count, "object")
    where = view.path or f"not saved yet, to be saved in {session.folder}"
    print(f"{view.document.name} ({objects}, {where}): open {served.url} in a browser", flush=True)
    for notice in view.notices:
        print_remark(notice)
    print("Press Ctrl-C to end.", flush=True)


def _print_unsaved(session: ComposeSession) -> None:
    view = session.view
    if not view.saved and (view.undo_label or view.redo_label):
        print_remark(
            f"changes of {view.document.name} are not saved; opening the same scene"
            " again restores them"
        )
