"""Serves the live view to browsers of this machine: page, pictures, status, actions.

    GET  /                 the page, with page.css and page.js
    GET  /frame.jpg        the newest picture; with ?after=N one that is newer than N (header
                           X-Picture has a picture's number), or 204 if none comes within a second
    GET  /stream.mjpg      pictures as they come (multipart/x-mixed-replace), for other programs
    GET  /status           JSON, see `status`; with ?after=N only events newer than N
    POST /settings         {"opacity": 0.5, ...}, fields of `ViewSettings`
    POST /snapshot         {}; answers with the folder
    POST /record           {"on": true}; answers with the video's path
    POST /check            {}; begins a placement check, whose result comes in the status

Other web sites that the browser has open can neither see nor do anything here: requests must name
this machine as their host (which stops DNS rebinding), and what acts must come from this page.
More connections than are served at a time are answered with 503 and the reason.
"""

from __future__ import annotations

import threading
from http import HTTPStatus
from typing import Any

from burg_drake.apps.ar.session_status import status
from burg_drake.apps.web import (
    MOST_CONNECTIONS,
    PageHandler,
    PageServer,
    address,
    picture_number,
)
from burg_drake.cameras.live import LiveSession, ViewActions
from burg_drake.core import LOCALHOST, RequestError, require_local_host

FIRST_PORT = 7100
"""Without a port the first free one from here on; Meshcat's begin at 7000."""
PATIENCE = 1.0
"""How long a request for a picture waits for a newer one [s]."""
BOUNDARY = "picture"
PAGES = {
    "/": ("page.html", "text/html; charset=utf-8"),
    "/page.css": ("page.css", "text/css; charset=utf-8"),
    "/page.js": ("page.js", "text/javascript; charset=utf-8"),
}
POLICY = "default-src 'self'; img-src 'self' blob: data:; frame-ancestors 'none'"


class ViewServer(PageServer):
    """Serves a live session until it is closed.

    Args:
        live: the session.
        actions: on it.
        host: address to listen on; only this machine can reach the default.
        port: to listen on; the first free one from `FIRST_PORT` on if None, any if 0.
        connections: that are served at a time.

    Raises:
        InvalidInputError: the port is taken, or the address is not this machine's.
    """

    first_port = FIRST_PORT
    title = "view"

    def __init__(
        self,
        live: LiveSession,
        actions: ViewActions,
        *,
        host: str = LOCALHOST,
        port: int | None = None,
        connections: int = MOST_CONNECTIONS,
    ) -> None:
        self.live, self.actions = live, actions
        self.closing = threading.Event()
        super().__init__(ViewHandler, host=host, port=port, connections=connections)

    def close(self) -> None:
        """Stops serving; requests that are being answered end soon."""
        self.closing.set()
        super().close()


class ViewHandler(PageHandler):
    """Answers one connection's requests."""

    server: ViewServer
    package = "burg_drake.apps.ar"
    pages = PAGES
    policy = POLICY

    def do_GET(self) -> None:
        """Pages, pictures, status."""
        self.answer(
            {
                "/frame.jpg": self._send_picture,
                "/stream.mjpg": self._send_stream,
                "/status": self._send_status,
            }
        )

    def do_POST(self) -> None:
        """Actions."""
        self.answer(
            {
                "/settings": self._change_settings,
                "/snapshot": self._take_snapshot,
                "/record": self._record,
                "/check": self._check,
            }
        )

    def admitted(self) -> tuple[str, dict[str, str]]:
        """Only this machine is meant, and only the page itself may be led to from elsewhere."""
        require_local_host(self.headers.get, served=self.server.host, is_page=self.path == "/")
        return address(self.path)

    def _send_picture(self, query: dict[str, str]) -> None:
        picture = self.server.live.next_picture(picture_number(query), PATIENCE)
        if picture is None:
            self.send(HTTPStatus.NO_CONTENT)
        else:
            self.send(HTTPStatus.OK, "image/jpeg", picture.jpeg, {"X-Picture": str(picture.number)})

    def _send_stream(self, query: dict[str, str]) -> None:
        self.close_connection = True
        kind = f"multipart/x-mixed-replace; boundary={BOUNDARY}"
        self.send_head(HTTPStatus.OK, {"Content-Type": kind})
        self.end_headers()
        number = 0
        while not self.server.closing.is_set():
            picture = self.server.live.next_picture(number, PATIENCE)
            if picture is None:
                continue
            number = picture.number
            head = (
                f"--{BOUNDARY}\r\nContent-Type: image/jpeg\r\n"
                f"Content-Length: {len(picture.jpeg)}\r\nX-Picture: {number}\r\n\r\n"
            )
            self.wfile.write(head.encode() + picture.jpeg + b"\r\n")

    def _send_status(self, query: dict[str, str]) -> None:
        self.send_json(status(self.server.live, self.server.actions, picture_number(query)))

    def _change_settings(self, body: dict[str, Any]) -> None:
        self.server.live.change(**body)
        self.send_json({})

    def _take_snapshot(self, body: dict[str, Any]) -> None:
        self.send_json({"path": str(self.server.actions.snapshot())})

    def _record(self, body: dict[str, Any]) -> None:
        if not isinstance(body.get("on"), bool):
            raise RequestError(HTTPStatus.BAD_REQUEST, '"on" must be true or false')
        actions = self.server.actions
        path = actions.start_recording() if body["on"] else actions.stop_recording()
        self.send_json({"path": path and str(path)})

    def _check(self, body: dict[str, Any]) -> None:
        self.server.actions.start_check()
        self.send_json({})
