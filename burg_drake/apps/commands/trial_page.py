"""`burg-drake trials serve`: a page for the lab, on which trials are recorded."""

from __future__ import annotations

import argparse
import contextlib
import secrets
from pathlib import Path
from typing import TYPE_CHECKING, Any

from burg_drake.apps.commands.trial_records import (
    add_moved_run_option,
    add_show_simulated_option,
    add_trials_argument,
    print_damage,
)
from burg_drake.apps.options.arguments import (
    Parser,
    add_live_camera,
    add_measured_board,
    add_page_options,
    examples_text,
    intrinsics_from_options,
    print_scale_from_options,
)
from burg_drake.apps.terminal import print_remark, sigterm_as_interrupt, wait_for_interrupt

if TYPE_CHECKING:
    from burg_drake.experiment import LabBook, LabCamera
    from burg_drake.scene import Scene

SECRET_LENGTH = 24  # Random bytes of the secret of admitted browsers.


def add_trials_serve_options(parser: Parser) -> None:
    """Adds the options of `burg-drake trials serve`."""
    parser.epilog = examples_text(
        "burg-drake trials serve trials.yaml --open",
        "burg-drake trials serve trials.yaml --host 0.0.0.0",
        "burg-drake trials serve trials.yaml --camera 0 --intrinsics camera.yaml",
        "burg-drake trials serve trials.yaml --camera sim:panda_tabletop/board",
    )
    add_trials_argument(parser)
    add_moved_run_option(parser)
    add_page_options(parser, "tablets can open it, by the address with a token that is printed")
    add_show_simulated_option(parser)
    camera = parser.add_argument_group("camera")
    camera.add_argument(
        "--camera",
        metavar="SOURCE",
        help="camera number, stream address, video, image, folder of images, or"
        " sim:STATION/CAMERA; the page then shows where objects belong",
    )
    add_live_camera(camera)
    add_measured_board(camera)


def run_trials_serve(arguments: argparse.Namespace) -> int:
    """Serves the page until Ctrl-C."""
    from burg_drake.apps.lab_page_server import LabServer
    from burg_drake.apps.terminal import open_in_browser
    from burg_drake.experiment import LabBook, PictureCache, TriedRuns

    runs = TriedRuns(arguments.trials, dict(arguments.moved))
    lab = LabBook(runs, show_simulated=arguments.show_simulated)
    print_damage(lab.book)
    with sigterm_as_interrupt(), contextlib.ExitStack() as closing:
        camera = _open_lab_camera(arguments, lab) if arguments.camera else None
        if camera is not None:
            closing.callback(camera.close)
        pictures = PictureCache(runs)
        server = LabServer(
            lab,
            pictures,
            camera,
            host=arguments.host,
            port=arguments.port,
            secret=_load_or_create_secret(lab.plan),
        )
        server.on_admitted = lambda peer: print_remark(
            f"{peer} opened the page; for another browser: {server.url}"
        )
        closing.callback(pictures.close)
        server.start()
        closing.callback(server.close)
        print(f"{len(runs.sheet.trials)} trials: open {server.url} in a browser", flush=True)
        print(
            "Press Ctrl-C to end. Entries that the page shows as saved are in the file.", flush=True
        )
        if arguments.open:
            open_in_browser(server.url)
        with contextlib.suppress(KeyboardInterrupt):
            wait_for_interrupt()
    return 0


def _open_lab_camera(arguments: argparse.Namespace, lab: LabBook) -> LabCamera:
    from burg_drake.cameras import open_source
    from burg_drake.experiment import LabCamera

    intrinsics = intrinsics_from_options(arguments)
    size = (intrinsics.width, intrinsics.height)

    def opened(scene: Scene) -> Any:
        return open_source(arguments.camera, scene=scene, size=size, fps=arguments.fps)

    camera = LabCamera(lab, opened, intrinsics, print_scale=print_scale_from_options(arguments))
    trials = lab.sheet().trials
    first = next((trial for trial in trials if trial.outcome is None), trials[0])
    camera.watch(first.number)  # what does not work is said now
    return camera


def _load_or_create_secret(plan: str) -> str | None:
    """The secret of the browsers that were let in to these trials, so that they need no new address
    when the page is started again; None if it cannot be kept.

    It lies in the user's cache, for the user alone to read.
    """
    from burg_drake.core import cache_folder

    folder = cache_folder()
    if folder is None:
        return None
    path = folder / f"lab_{plan}.secret"
    try:
        folder.mkdir(parents=True, exist_ok=True)
        if not _read_secret(path):
            _write_secret(path)
        return _read_secret(path) or None
    except OSError:
        return None


def _read_secret(path: Path) -> str:
    """What the file holds; empty if that is no secret, or there is none."""
    try:
        text = path.read_text(encoding="ascii")
    except (FileNotFoundError, UnicodeDecodeError):
        return ""
    return text if len(text) >= SECRET_LENGTH else ""


def _write_secret(path: Path) -> None:
    """Writes a new one beside it, for the user alone to read, and renames it: whole or not."""
    import os
    import tempfile

    file, name = tempfile.mkstemp(dir=path.parent, prefix=f".{path.name}.")
    try:
        with os.fdopen(file, "w", encoding="ascii") as stream:
            stream.write(secrets.token_urlsafe(SECRET_LENGTH))
        os.replace(name, path)
    finally:
        Path(name).unlink(missing_ok=True)
