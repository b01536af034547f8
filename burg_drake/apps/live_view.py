"""The live view of `burg-drake ar`: HTTP server, state as JSON, summary of a scripted session."""

from __future__ import annotations

import math
import threading
from collections.abc import Iterator
from dataclasses import asdict
from http import HTTPStatus
from typing import Any

from starlette.requests import Request
from starlette.responses import Response, StreamingResponse

from burg_drake.apps import options
from burg_drake.apps.commands.camera_placement import extra_object_line
from burg_drake.apps.page_server import (
    PageServer,
    file_routes,
    get_route,
    json_response,
    parse_picture_number,
    post_route,
)
from burg_drake.apps.terminal import print_remark
from burg_drake.cameras import (
    LiveSession,
    OverlayStyle,
    Picture,
    Placement,
    PlacementCheck,
    ViewActions,
    describe_pose,
    placement_order,
    placement_summary,
    position_sd,
)
from burg_drake.core import RequestError


def session_status(live: LiveSession, actions: ViewActions, after: int = 0) -> dict[str, Any]:
    """All that the page shows beside the picture.

    Args:
        live: the session.
        actions: actions on the session.
        after: number of the last event that is left out.

    Returns:
        JSON data without NaN; None for unknown values.
    """
    scene, recording = live.processor.scene, actions.recording
    style = live.processor.style
    return {
        "scene": {"name": scene.name, "objects": placement_order(scene)},
        "source": {
            "name": live.source.name,
            "live": live.source.live,
            "state": live.reader.state,
            "fault": live.reader.fault,
        },
        "frames": live.counts.frames,
        "settings": asdict(live.settings),
        "tolerance": {"mm": 1e3 * style.tolerance, "deg": math.degrees(style.angle_tolerance)},
        "picture": None if live.picture is None else _picture_status(live, live.picture),
        "recording": recording
        and {
            "path": str(recording.path),
            "seconds": recording.frames / recording.frames_per_second,
        },
        "checking": actions.checking,
        "placement": None if live.placement is None else _placement_status(live.placement, style),
        "events": [asdict(event) for event in live.events.after(after)],
    }


def _picture_status(live: LiveSession, picture: Picture) -> dict[str, Any]:
    sight, board = picture.located, live.processor.scene.board
    estimate = sight.estimate
    return {
        "number": picture.number,
        "name": sight.frame.name,
        "time": sight.frame.time,
        "valid": estimate.valid,
        "doubt": estimate.reason if estimate.valid else "",
        "line": describe_pose(estimate, board),
        "markers": len(estimate.ids),
        "of_markers": len(board.layout.ids),
        "reprojection_error": _finite_or_none(estimate.reprojection_error),
        "position_sd_mm": _finite_or_none(1e3 * position_sd(estimate)),
        "p_SC_mm": [round(1e3 * x, 2) for x in estimate.X_SC[:3, 3]] if estimate.valid else None,
        "scale": _finite_or_none(estimate.scale),
        "rate": live.rate,
        "milliseconds": picture.milliseconds,
    }


def _placement_status(check: PlacementCheck, style: OverlayStyle) -> dict[str, Any]:
    return {
        "reason": check.reason,
        "summary": placement_summary(check),
        "method": check.method,
        "taken": check.taken,
        "objects": {name: placement_row(placed, style) for name, placed in check.instances.items()},
        "extra": [
            {"xy_mm": [round(1e3 * c, 1) for c in e.position], "wide_mm": round(1e3 * e.width, 1)}
            for e in check.extra
        ],
    }


def placement_row(placed: Placement, style: OverlayStyle) -> dict[str, Any]:
    """The row of an object: distance and turn, with their standard deviations."""
    distance_mm = None if placed.displacement is None else 1e3 * math.hypot(*placed.displacement)
    turn = None if placed.angle is None else math.degrees(placed.angle)
    sd = placed.displacement_sd
    within = (
        distance_mm is not None
        and distance_mm <= 1e3 * style.tolerance
        and abs(turn or 0.0) <= math.degrees(style.angle_tolerance)
    )
    return {
        "status": placed.status,
        "reason": placed.reason,
        "within": within,
        "mm": distance_mm,
        "xy_mm": placed.displacement and [1e3 * d for d in placed.displacement],
        "sd_mm": None if sd is None else 1e3 * math.hypot(*sd),
        "deg": turn,
        "sd_deg": None if placed.angle_sd is None else math.degrees(placed.angle_sd),
        "seen": placed.seen,
    }


def _finite_or_none(value: float) -> float | None:
    return value if math.isfinite(value) else None


LIVE_PICTURE_TIMEOUT = 1.0
"""Seconds that a request for a picture waits for a newer one."""
STREAM_BOUNDARY = "picture"  # Between pictures of a stream.
LIVE_VIEW_FILES = {
    "/": ("page.html", "text/html; charset=utf-8"),
    "/page.css": ("page.css", "text/css; charset=utf-8"),
    "/page.js": ("page.js", "text/javascript; charset=utf-8"),
}
"""File name and content type of the live view's page, by path."""


class ViewServer(PageServer):
    """Serves a live session until it is closed.

    Args:
        live: the session.
        actions: actions on the session.
        host: address to listen on; only this machine can reach the default.
        port: port to listen on; the first free one from `first_port` on if None, any if 0.
        connections: maximum number served at a time.

    Raises:
        InvalidInputError: the port is taken, or the address is not this machine's.
    """

    first_port = 7100
    title = "view"
    policy = "default-src 'self'; img-src 'self' blob: data:; frame-ancestors 'none'"

    def __init__(
        self,
        live: LiveSession,
        actions: ViewActions,
        *,
        host: str = "127.0.0.1",
        port: int | None = None,
        connections: int = options.MAX_PAGE_CONNECTIONS,
    ) -> None:
        self.live, self.actions = live, actions
        self._closing = threading.Event()
        routes = [
            *file_routes("live_page", LIVE_VIEW_FILES),
            get_route("/frame.jpg", self._picture),
            get_route("/stream.mjpg", self._stream),
            get_route("/status", self._status),
            post_route("/settings", self._change_settings),
            post_route("/snapshot", lambda body: {"path": str(actions.snapshot())}),
            post_route("/record", self._record),
            post_route("/check", self._check),
        ]
        super().__init__(routes, host=host, port=port, connections=connections)

    def close(self) -> None:
        """Stops serving; requests that are being answered end soon."""
        self._closing.set()
        super().close()

    def _picture(self, request: Request) -> Response:
        picture = self.live.next_picture(parse_picture_number(request), LIVE_PICTURE_TIMEOUT)
        if picture is None:
            return Response(status_code=HTTPStatus.NO_CONTENT)
        return Response(
            picture.jpeg, headers={"X-Picture": str(picture.number)}, media_type="image/jpeg"
        )

    def _stream(self, request: Request) -> Response:
        kind = f"multipart/x-mixed-replace; boundary={STREAM_BOUNDARY}"
        return StreamingResponse(self._parts(), media_type=kind, headers={"Connection": "close"})

    def _parts(self) -> Iterator[bytes]:
        """Pictures until the server or the client ends."""
        number = 0
        while not self._closing.is_set():
            picture = self.live.next_picture(number, LIVE_PICTURE_TIMEOUT)
            if picture is None:
                yield b""  # lets the server notice that the client has left
                continue
            number = picture.number
            head = (
                f"--{STREAM_BOUNDARY}\r\nContent-Type: image/jpeg\r\n"
                f"Content-Length: {len(picture.jpeg)}\r\nX-Picture: {number}\r\n\r\n"
            )
            yield head.encode() + picture.jpeg + b"\r\n"

    def _status(self, request: Request) -> Response:
        return json_response(session_status(self.live, self.actions, parse_picture_number(request)))

    def _change_settings(self, body: dict[str, Any]) -> dict[str, Any]:
        self.live.change(**body)
        return {}

    def _record(self, body: dict[str, Any]) -> dict[str, Any]:
        if not isinstance(body.get("on"), bool):
            raise RequestError(HTTPStatus.BAD_REQUEST, '"on" must be true or false')
        actions = self.actions
        path = actions.start_recording() if body["on"] else actions.stop_recording()
        return {"path": path and str(path)}

    def _check(self, body: dict[str, Any]) -> dict[str, Any]:
        self.actions.start_check()
        return {}


def finish_script(
    live: LiveSession, actions: ViewActions, *, check: bool, snapshot: str | None
) -> None:
    """Prints a summary of a scripted session, and checks or saves the last frame with a pose.

    Args:
        live: the session, closed.
        actions: actions on the session.
        check: whether to measure the placement errors of objects.
        snapshot: folder for a snapshot; None for no snapshot.
    """
    located, counts = live.last_located, live.counts
    if located is None:
        return
    if counts.frames > 1:
        print(f"{live.source.name}: {counts.valid} of {counts.frames} frames gave a pose")
    estimate = located.estimate
    print(f"{located.frame.name}: {describe_pose(estimate, live.processor.scene.board)}")
    if estimate.valid:
        x, y, z = 1e3 * estimate.X_SC[:3, 3]
        print(
            f"camera at x {x:.2f}, y {y:.2f}, z {z:.2f} mm from the board's origin, reprojection"
            f" error {estimate.reprojection_error:.3f} px"
        )
    placement = None
    if check and estimate.valid:
        placement = live.processor.check(located)
        for line in placement_lines(placement, live.processor.style):
            print(line)
    if snapshot is not None:
        actions.snapshot(snapshot, live.picture_of(located, placement))


def report_missing_pose(live: LiveSession) -> int:
    """Prints why no frame of a scripted session gave a pose; returns 1 then, else 0."""
    if live.counts.valid:
        return 0
    reason = live.counts.reason or live.reader.fault or "no image arrived"
    print_remark(f"no frame gave a pose: {reason}")
    return 1


def placement_lines(check: PlacementCheck, style: OverlayStyle) -> list[str]:
    """A placement check as text, one line per object."""
    if not check.instances:
        return [f"placement: {check.reason}"]
    width = max(map(len, check.instances))
    return [
        f"  {name:{width}}  {_placement_row_text(placement_row(placed, style))}"
        for name, placed in check.instances.items()
    ] + [f"  {extra_object_line(extra)}" for extra in check.extra]


def _placement_row_text(row: dict[str, Any]) -> str:
    if row["mm"] is None:
        return ": ".join(filter(None, (row["status"].replace("_", " "), row["reason"])))
    x, y = row["xy_mm"]
    words = (
        f"{row['mm']:5.2f} mm off (x {x:+.2f}, y {y:+.2f}{_standard_deviation_text(row['sd_mm'])})"
    )
    if row["deg"] is not None:
        words += f", rotated by {row['deg']:+.2f}{_standard_deviation_text(row['sd_deg'], '')} deg"
    if row["status"] != "measured":
        return f"{words}; {row['status']}: {row['reason']}"
    return f"{words}; {'placed' if row['within'] else 'off its target'}"


def _standard_deviation_text(sd: float | None, before: str = ",") -> str:
    """Text of a standard deviation, to follow its value; empty if unknown."""
    return "" if sd is None else f"{before} ± {sd:.2f}"
