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
"""

from __future__ import annotations

import errno
import json
import socket
import sys
import threading
from collections.abc import Callable
from functools import partial
from http import HTTPStatus
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from importlib.resources import files
from typing import Any

from burg_drake.apps.ar.session_status import status
from burg_drake.apps.web import address, json_body, picture_number
from burg_drake.cameras.live import LiveSession, ViewActions
from burg_drake.core import (
    HEADERS as ACCESS_HEADERS,
    LOCALHOST,
    BurgError,
    InvalidInputError,
    RequestError,
    address_in_use_error,
    page_url,
    require_local_host,
)

FIRST_PORT, PORTS = 7100, 50
"""Without a port the first free one of these; Meshcat's begin at 7000."""
PATIENCE = 1.0
"""How long a request for a picture waits for a newer one [s]."""
IDLE = 30.0
"""A connection without requests is closed after this [s]."""
BOUNDARY = "picture"
PAGES = {
    "/": ("page.html", "text/html; charset=utf-8"),
    "/page.css": ("page.css", "text/css; charset=utf-8"),
    "/page.js": ("page.js", "text/javascript; charset=utf-8"),
}
HEADERS = {
    **ACCESS_HEADERS,
    "Content-Security-Policy": "default-src 'self'; img-src 'self' blob: data:;"
    " frame-ancestors 'none'",
}


class ViewServer(ThreadingHTTPServer):
    """Serves a live session until it is closed.

    Args:
        live: the session.
        actions: on it.
        host: address to listen on; only this machine can reach the default.
        port: to listen on; the first free one from `FIRST_PORT` on if None, any if 0.

    Raises:
        InvalidInputError: the port is taken, or the address is not this machine's.
    """

    daemon_threads = True
    allow_reuse_address = sys.platform != "win32"

    def __init__(
        self,
        live: LiveSession,
        actions: ViewActions,
        *,
        host: str = LOCALHOST,
        port: int | None = None,
    ) -> None:
        self.live, self.actions, self.host = live, actions, host
        if ":" in host:
            self.address_family = socket.AF_INET6
        self.closing = threading.Event()
        ports = range(FIRST_PORT, FIRST_PORT + PORTS) if port is None else range(port, port + 1)
        for candidate in ports:
            try:
                super().__init__((host, candidate), ViewHandler)
                break
            except OSError as error:
                failure = error
                if error.errno != errno.EADDRINUSE:
                    raise InvalidInputError(
                        f"the view cannot be served on {host}: {error.strerror or error}"
                    ) from error
        else:
            raise InvalidInputError(
                address_in_use_error(host, ports, any_of_them=port is None)
            ) from failure

    @property
    def url(self) -> str:
        """Address of the page."""
        return page_url(self.host, self.server_address[1])

    def start(self) -> None:
        """Serves in a thread of its own."""
        threading.Thread(target=self.serve_forever, name="view server", daemon=True).start()

    def close(self) -> None:
        """Stops serving; requests that are being answered end soon."""
        self.closing.set()
        self.shutdown()
        self.server_close()

    def handle_error(self, request: Any, client_address: Any) -> None:
        """A browser that goes away in the middle of an answer is no error."""
        if not isinstance(sys.exception(), (ConnectionError, TimeoutError)):
            super().handle_error(request, client_address)


class ViewHandler(BaseHTTPRequestHandler):
    """Answers one connection's requests."""

    server: ViewServer
    protocol_version = "HTTP/1.1"
    timeout = IDLE

    def do_GET(self) -> None:
        """Pages, pictures, status."""
        routes: dict[str, Callable[[dict[str, str]], None]] = {
            "/frame.jpg": self._send_picture,
            "/stream.mjpg": self._send_stream,
            "/status": self._send_status,
        }
        routes |= {path: partial(self._send_page, path) for path in PAGES}
        self._answer(routes)

    def do_POST(self) -> None:
        """Actions."""
        self._answer(
            {
                "/settings": self._change_settings,
                "/snapshot": self._take_snapshot,
                "/record": self._record,
                "/check": self._check,
            }
        )

    def _answer(self, routes: dict[str, Callable[[Any], None]]) -> None:
        try:
            require_local_host(self.headers.get, served=self.server.host, is_page=self.path == "/")
            path, query = address(self.path)
            if path not in routes:
                raise RequestError(HTTPStatus.NOT_FOUND, f"there is no {path}")
            routes[path](json_body(self.headers, self.rfile) if self.command == "POST" else query)
        except RequestError as error:
            self.close_connection = True  # its body may not have been read
            self._send_json({"error": str(error)}, error.code)
        except BurgError as error:
            self._send_json({"error": str(error)}, HTTPStatus.CONFLICT)

    def _send_page(self, path: str, query: dict[str, str]) -> None:
        name, kind = PAGES[path]
        page = (files("burg_drake.apps.ar") / name).read_bytes()
        self._send(HTTPStatus.OK, kind, page)

    def _send_picture(self, query: dict[str, str]) -> None:
        picture = self.server.live.next_picture(picture_number(query), PATIENCE)
        if picture is None:
            self._send(HTTPStatus.NO_CONTENT)
        else:
            self._send(
                HTTPStatus.OK, "image/jpeg", picture.jpeg, {"X-Picture": str(picture.number)}
            )

    def _send_stream(self, query: dict[str, str]) -> None:
        self.close_connection = True
        self.send_response(HTTPStatus.OK)
        for name, value in HEADERS.items():
            self.send_header(name, value)
        self.send_header("Content-Type", f"multipart/x-mixed-replace; boundary={BOUNDARY}")
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
        self._send_json(status(self.server.live, self.server.actions, picture_number(query)))

    def _change_settings(self, body: dict[str, Any]) -> None:
        self.server.live.change(**body)
        self._send_json({})

    def _take_snapshot(self, body: dict[str, Any]) -> None:
        self._send_json({"path": str(self.server.actions.snapshot())})

    def _record(self, body: dict[str, Any]) -> None:
        if not isinstance(body.get("on"), bool):
            raise RequestError(HTTPStatus.BAD_REQUEST, '"on" must be true or false')
        actions = self.server.actions
        path = actions.start_recording() if body["on"] else actions.stop_recording()
        self._send_json({"path": path and str(path)})

    def _check(self, body: dict[str, Any]) -> None:
        self.server.actions.start_check()
        self._send_json({})

    def _send_json(self, data: Any, code: HTTPStatus = HTTPStatus.OK) -> None:
        self._send(code, "application/json", json.dumps(data, allow_nan=False).encode())

    def _send(
        self,
        code: HTTPStatus,
        kind: str = "",
        body: bytes = b"",
        headers: dict[str, str] | None = None,
    ) -> None:
        self.send_response(code)
        for name, value in {**HEADERS, **(headers or {})}.items():
            self.send_header(name, value)
        if code != HTTPStatus.NO_CONTENT:
            self.send_header("Content-Type", kind)
            self.send_header("Content-Length", str(len(body)))
        self.end_headers()
        self.wfile.write(body)

    def log_message(self, format: str, *args: Any) -> None:
        """Requests are not worth a line."""
