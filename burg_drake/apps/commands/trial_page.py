"""`burg-drake trials serve`: a page for the lab, on which trials are recorded."""

from __future__ import annotations

import argparse
import contextlib
import secrets
from typing import TYPE_CHECKING, Any

from burg_drake import experiment
from burg_drake.apps import options
from burg_drake.apps.commands.trial_records import (
    add_moved_run_option,
    add_show_simulated_option,
    add_trials_argument,
    print_damage,
)
from burg_drake.apps.terminal import print_remark, sigterm_as_interrupt, wait_for_interrupt

if TYPE_CHECKING:
    from burg_drake.scene import Scene

SECRET_LENGTH = 24  # Random bytes of the secret for cookies of admitted browsers.


def add_trials_serve_options(parser: options.Parser) -> None:
    """Adds the options of `burg-drake trials serve`."""
    parser.epilog = options.examples_text(
        "burg-drake trials serve trials.yaml --open",
        "burg-drake trials serve trials.yaml --host 0.0.0.0",
        "burg-drake trials serve trials.yaml --camera 0 --intrinsics camera.yaml",
        "burg-drake trials serve trials.yaml --camera sim:panda_tabletop/board",
    )
    add_trials_argument(parser)
    add_moved_run_option(parser)
    options.add_page_options(
        parser, "tablets can open it, by the address with a token that is printed"
    )
    add_show_simulated_option(parser)
    camera = parser.add_argument_group("camera")
    options.add_live_camera(camera, "; the page then shows where objects belong")


def run_trials_serve(arguments: argparse.Namespace) -> int:
    """Serves the page until Ctrl-C."""
    from burg_drake.apps.lab_page_server import LabServer
    from burg_drake.apps.terminal import open_in_browser

    runs = experiment.TriedRuns(arguments.trials, dict(arguments.moved))
    lab = experiment.LabBook(runs, show_simulated=arguments.show_simulated)
    print_damage(lab.book)
    with sigterm_as_interrupt(), contextlib.ExitStack() as closing:
        camera = _open_lab_camera(arguments, lab) if arguments.camera else None
        if camera is not None:
            closing.callback(camera.close)
        pictures = experiment.PictureCache(runs)
        server = LabServer(
            lab,
            pictures,
            camera,
            host=arguments.host,
            port=arguments.port,
            secret=_load_or_create_secret(lab.plan_hash),
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


def _open_lab_camera(
    arguments: argparse.Namespace, lab: experiment.LabBook
) -> experiment.LabCamera:
    from burg_drake.cameras import open_source

    intrinsics = options.intrinsics_from_options(arguments)
    size = (intrinsics.width, intrinsics.height)

    def opened(scene: Scene) -> Any:
        return open_source(arguments.camera, scene=scene, size=size, fps=arguments.fps)

    camera = experiment.LabCamera(
        lab, opened, intrinsics, print_scale=options.print_scale_from_options(arguments)
    )
    trials = lab.sheet().trials
    first = next((trial for trial in trials if trial.outcome is None), trials[0])
    camera.watch(first.number)  # reports errors now
    return camera


def _load_or_create_secret(plan: str) -> str | None:
    """The secret for cookies of browsers admitted to these trials, so that they stay valid when the
    page is started again; None if it cannot be stored.

    It is in the user's cache, readable by the user only.
    """
    from burg_drake.core import InvalidInputError, atomic_write, cache_folder

    folder = cache_folder()
    if folder is None:
        return None
    path = folder / f"lab_{plan}.secret"
    try:
        folder.mkdir(parents=True, exist_ok=True)
        path.touch()
        path.chmod(0o600)
        known = path.read_bytes()
        if len(known) < SECRET_LENGTH or not known.isascii():
            atomic_write(path, secrets.token_urlsafe(SECRET_LENGTH))  # keeps the permissions
        return path.read_text(encoding="ascii")
    except (OSError, InvalidInputError):
        return None
