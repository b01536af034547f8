"""`burg-drake ar`: the scene drawn over a camera's picture, live in the browser or in a script."""

from __future__ import annotations

import argparse
import contextlib
import math
import sys
from typing import TYPE_CHECKING, Any

from burg_drake import cameras
from burg_drake.apps import options
from burg_drake.apps.terminal import (
    ignore_interrupts,
    open_in_browser,
    print_remark,
    sigterm_as_interrupt,
)

if TYPE_CHECKING:
    from burg_drake.scene import Scene


def add_ar_options(parser: options.Parser) -> None:
    """Adds the options of `burg-drake ar`."""
    parser.epilog = options.examples_text(
        "burg-drake ar my_scene.yaml --camera 0 --intrinsics camera.yaml",
        "burg-drake ar my_scene.yaml --camera photo.png --intrinsics camera.yaml",
        "burg-drake ar tabletop_six --camera sim:panda_tabletop/board",
        "burg-drake ar my_scene.yaml --camera photo.png --intrinsics camera.yaml --no-browser"
        " --check --snapshot trial_7",
    )
    options.add_scene(parser)
    options.add_live_camera(parser, " (default: %(default)s)", default="0")
    _add_view_options(parser)
    _add_result_options(parser)


def _add_view_options(parser: Any) -> None:
    view = parser.add_argument_group("view")
    options.add_settings_options(
        view, cameras.OverlayStyle, "opacity", "tolerance", "angle_tolerance", unset=True
    )
    options.add_page_options(view, "all computers and tablets of the network can use it")
    view.add_argument(
        "--connections",
        type=options.positive_int,
        metavar="N",
        default=options.MAX_PAGE_CONNECTIONS,
        help="largest number of connections; a browser takes two to six (default: %(default)s)",
    )
    view.add_argument(
        "--no-browser",
        action="store_true",
        help="process all images without a page, print the result and end",
    )


def _add_result_options(parser: Any) -> None:
    results = parser.add_argument_group("results")
    results.add_argument(
        "--record", metavar="FILE", help="record a video (.mp4, .avi) and a table of camera poses"
    )
    results.add_argument(
        "--plain", action="store_true", help="also record the video without overlay"
    )
    results.add_argument(
        "--snapshot", metavar="FOLDER", help="at the end, save picture, overlay and camera pose"
    )
    results.add_argument(
        "--check",
        action="store_true",
        help="at the end, measure how far objects are from their targets",
    )
    results.add_argument(
        "--frames", type=options.positive_int, metavar="N", help="end after N images"
    )
    results.add_argument(
        "--seconds", type=options.positive, metavar="N", help="end after N seconds"
    )
    results.add_argument(
        "-o",
        "--output",
        metavar="FOLDER",
        default=".",
        help="folder for what is saved from the page (default: here)",
    )


def run_ar(arguments: argparse.Namespace) -> int:
    """Processes frames until stopped; returns 1 if no frame of a script gave a pose."""
    from burg_drake.scene import load_scene

    scene = load_scene(arguments.scene)
    _require_writable_outputs(arguments)
    intrinsics = options.intrinsics_from_options(arguments)
    size = (intrinsics.width, intrinsics.height)  # cameras of this computer deliver this size
    source = cameras.open_source(arguments.camera, scene=scene, size=size, fps=arguments.fps)
    with sigterm_as_interrupt():
        try:
            live, actions = _create_session(arguments, scene, intrinsics, source)
        except BaseException:
            source.close()
            raise
        return _run_live_view(arguments, live, actions)


def _run_live_view(
    arguments: argparse.Namespace, live: cameras.LiveSession, actions: cameras.ViewActions
) -> int:
    from burg_drake.apps.live_view import finish_script, report_missing_pose

    scripted = _is_scripted(arguments)
    interrupted = False
    with contextlib.ExitStack() as closing:
        closing.callback(actions.stop_recording)
        closing.callback(live.close)
        if not arguments.no_browser:
            _serve_live_view(arguments, live, actions, closing)
        if arguments.record is not None:
            actions.start_recording(arguments.record)
        try:
            live.start(arguments.frames)
            _print_how_to_stop(arguments, live)
            live.wait(seconds=arguments.seconds, to_end=arguments.no_browser)
        except KeyboardInterrupt:
            interrupted = True
            print(file=sys.stderr)
        with ignore_interrupts():
            closing.close()
        actions.wait_for_check()  # OpenCV must not be running when Python ends
    if scripted or arguments.check or arguments.snapshot:
        finish_script(live, actions, check=arguments.check, snapshot=arguments.snapshot)
    if interrupted and (arguments.frames or arguments.seconds):
        raise KeyboardInterrupt
    return report_missing_pose(live) if scripted else 0


def _print_how_to_stop(arguments: argparse.Namespace, live: cameras.LiveSession) -> None:
    """Prints how to stop a script whose frame source has no end."""
    limited = arguments.frames or arguments.seconds
    if arguments.no_browser and live.source.live and not limited:
        print(
            f"{live.source.name} does not end: Ctrl-C ends this, or --frames N, or --seconds N",
            file=sys.stderr,
        )


def _is_scripted(arguments: argparse.Namespace) -> bool:
    """Whether there is no page, or the number of frames or the time is limited."""
    return bool(arguments.no_browser or arguments.frames or arguments.seconds)


def _serve_live_view(
    arguments: argparse.Namespace,
    live: cameras.LiveSession,
    actions: cameras.ViewActions,
    closing: contextlib.ExitStack,
) -> None:
    """Serves the page until all is closed."""
    from burg_drake.apps.live_view import ViewServer

    server = ViewServer(
        live, actions, host=arguments.host, port=arguments.port, connections=arguments.connections
    )
    server.start()
    closing.callback(server.close)
    scene = live.processor.scene
    print(f"{scene.name} over {live.source.name}: open {server.url} in a browser", flush=True)
    print("Press Ctrl-C to end.", flush=True)
    if arguments.open:
        open_in_browser(server.url)


def _create_session(
    arguments: argparse.Namespace,
    scene: Scene,
    intrinsics: cameras.Intrinsics,
    source: cameras.FrameSource,
) -> tuple[cameras.LiveSession, cameras.ViewActions]:
    idle_timeout = 3.0  # Seconds without a request after which no frames are processed.

    style = options.settings_from(arguments, cameras.OverlayStyle)
    always = _is_scripted(arguments) or arguments.check or arguments.snapshot
    live = cameras.LiveSession(
        cameras.FrameProcessor(
            scene, intrinsics, print_scale=options.print_scale_from_options(arguments), style=style
        ),
        source,
        events=cameras.EventLog(lambda event: print_remark(event.text)),
        settings=cameras.ViewSettings(opacity=style.opacity),
        paced=not arguments.no_browser,
        idle_after=math.inf if always else idle_timeout,
    )
    return live, cameras.ViewActions(live, arguments.output, plain=arguments.plain)


def _require_writable_outputs(arguments: argparse.Namespace) -> None:
    """Refuses outputs that cannot be written, before any work."""
    from burg_drake.core import ensure_writable_folder

    if arguments.record is not None:
        cameras.require_video_path(arguments.record, plain=arguments.plain)
    if arguments.snapshot is not None:
        cameras.require_new_folder(arguments.snapshot)
    if not arguments.no_browser:
        ensure_writable_folder(arguments.output)
