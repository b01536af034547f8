"""What the small servers of pages share: a port, one thread a connection, answers to requests.

Other web sites that the browser has open can neither see nor do anything there: requests must name
this machine as their host (which stops DNS rebinding), and what acts must come from the page.
"""

from __future__ import annotations

import contextlib
import errno
import io
import ipaddress
import json
import socket
import sys
import threading
import time
from collections import Counter
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from http import HTTPStatus
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from importlib.resources import files
from typing import Any, Literal

from burg_drake.apps.web.limits import MOST_CONNECTIONS
from burg_drake.apps.web.requests import json_body
from burg_drake.core import (
    HEADERS as ACCESS_HEADERS,
    BurgError,
    InvalidInputError,
    RequestError,
    address_in_use_error,
    page_url,
)

PORTS = 50
"""How many ports are tried if none is given."""
IDLE_TIMEOUT = 30.0
"""Seconds without a request after which an admitted connection is closed; also the time that a
client has to take an answer."""
REQUEST_TIMEOUT = 10.0
"""Seconds for a whole request, head and body, and for the first one to begin."""
BROWSER_CONNECTIONS = 6
"""Most connections a browser opens to one server."""
MAX_REFUSALS = 8
"""Maximum number of surplus connections answered with status 503 at a time; further ones are closed
without an answer."""
REFUSAL_TIMEOUT = 2.0
"""Seconds that a surplus connection has for its request."""

Handler = Callable[[Any], None]
"""Answers a request, with the body of a POST, or the query of a GET."""


@dataclass
class _Connection:
    """An open connection: of which address, and what becomes of it."""

    address: str
    state: Literal["new", "admitted", "refused", "ending"] = "new"


class PageServer(ThreadingHTTPServer):
    """Serves a page until it is closed.

    A connection is admitted with its first request that is not refused. Where there are too many
    connections, those that are not admitted yet make room, so that they lock nobody out.

    Args:
        handler: answers requests.
        host: address to listen on.
        port: to listen on; the first free one from `first_port` on if None, any if 0.
        connections: that are served at a time, half as many for one address of another machine
            (but what a browser needs); where all are admitted the next ones are told so, with
            status 503.

    Attributes:
        first_port: the first port that is tried.
        title: of what is served, for messages.
        poll: seconds between checks whether to stop serving.
        host: as given.

    Raises:
        InvalidInputError: the port is taken, or the address is not this machine's.
    """

    daemon_threads = True
    allow_reuse_address = sys.platform != "win32"
    request_queue_size = 64
    first_port: int
    title = "page"
    poll = 0.5

    def __init__(
        self,
        handler: type[BaseHTTPRequestHandler],
        *,
        host: str,
        port: int | None = None,
        connections: int = MOST_CONNECTIONS,
    ) -> None:
        self.host, self.connections = host, connections
        self._lock = threading.Lock()
        self._open: dict[socket.socket, _Connection] = {}  # in the order in which they came
        if ":" in host:
            self.address_family = socket.AF_INET6
        first = self.first_port if port is None else port
        ports = range(first, first + (PORTS if port is None else 1))
        for candidate in ports:
            try:
                super().__init__((host, candidate), handler)
                break
            except OSError as error:
                failure = error
                if error.errno != errno.EADDRINUSE:
                    raise InvalidInputError(
                        f"the {self.title} cannot be served on {host}: {error.strerror or error}"
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
        serving = partial(self.serve_forever, poll_interval=self.poll)
        threading.Thread(target=serving, name=f"{self.title} server", daemon=True).start()

    def close(self) -> None:
        """Stops serving; requests that are being answered end soon."""
        self.shutdown()
        self.server_close()

    def refuses(self, connection: socket.socket) -> bool:
        """Whether a connection is one too many, and is to be told so."""
        return connection in self._in_state("refused")

    def admit(self, connection: socket.socket) -> None:
        """Notes that a connection has made a request that was not refused."""
        with self._lock:
            if connection in self._in_state("new"):
                self._open[connection].state = "admitted"

    def is_admitted(self, connection: socket.socket) -> bool:
        """Whether a connection was admitted."""
        return connection in self._in_state("admitted")

    def process_request(self, request: Any, client_address: Any) -> None:
        """Answers a connection in a thread of its own, as long as there are not too many."""
        connection = _Connection(_address(str(client_address[0])))
        with self._lock:
            if not self._make_room(connection.address):
                if len(self._in_state("refused", "ending")) >= MAX_REFUSALS:
                    super().shutdown_request(request)
                    return
                connection.state = "refused"
            self._open[request] = connection
        super().process_request(request, client_address)

    def shutdown_request(self, request: Any) -> None:
        """Closes a connection, which makes room for the next one."""
        with self._lock:
            self._open.pop(request, None)
        super().shutdown_request(request)

    def _in_state(self, *states: str) -> list[socket.socket]:
        """Connections in one of the states, in the order in which they came."""
        return [c for c, one in tuple(self._open.items()) if one.state in states]

    def _make_room(self, address: str) -> bool:
        """Whether one more connection from an address can be served. If there are too many, this
        closes one that is not admitted."""
        served = self._in_state("new", "admitted")
        own = [c for c in served if self._open[c].address == address]
        share = max(BROWSER_CONNECTIONS, self.connections // 2)
        most = self.connections if address == LOOPBACK else share
        if len(own) < most and len(served) < self.connections:
            return True
        among = own if len(own) >= most else served
        waiting = [c for c in among if self._open[c].state == "new"]
        if not waiting or len(self._in_state("ending")) >= MAX_REFUSALS:
            return False
        counts = Counter(self._open[c].address for c in waiting)
        # the first of those with equal counts
        oldest = max(waiting, key=lambda c: counts[self._open[c].address])
        self._open[oldest].state = "ending"
        with contextlib.suppress(OSError):
            oldest.shutdown(socket.SHUT_RDWR)  # its thread ends with it
        return True

    def handle_error(self, request: Any, client_address: Any) -> None:
        """A browser that goes away in the middle of an answer is no error."""
        if not isinstance(sys.exception(), (ConnectionError, TimeoutError)):
            super().handle_error(request, client_address)


LOOPBACK = "this machine"


def _address(host: str) -> str:
    """The key by which connections are counted: an IPv4 address, or the /64 network of an IPv6
    address."""
    ip = ipaddress.ip_address(host.partition("%")[0])
    mapped = getattr(ip, "ipv4_mapped", None) or ip
    if mapped.is_loopback:
        return LOOPBACK
    return str(mapped) if mapped.version == 4 else ip.exploded[:19]


class _TimedStream(io.RawIOBase):
    """The stream of a connection's data, with a deadline."""

    def __init__(self, connection: socket.socket, seconds: float) -> None:
        self._connection = connection
        self.expect_within(seconds)

    def expect_within(self, seconds: float) -> None:
        """Sets the deadline to this many seconds from now."""
        self._deadline = time.monotonic() + seconds

    def readable(self) -> bool:
        """The stream can be read, and not written."""
        return True

    def readinto(self, buffer: Any) -> int:
        """Reads the data that have arrived.

        Raises:
            TimeoutError: the deadline has passed.
        """
        left = self._deadline - time.monotonic()
        if left <= 0.0:
            raise TimeoutError("the request takes too long")
        before = self._connection.gettimeout()
        self._connection.settimeout(left)
        try:
            return self._connection.recv_into(buffer)
        finally:
            self._connection.settimeout(before)


class PageHandler(BaseHTTPRequestHandler):
    """Answers one connection's requests.

    Attributes:
        server: whose connection it is.
        package: that has the files of the page.
        pages: file and type by path.
        policy: the Content-Security-Policy of every answer.
        refused_code: status of the answer where an action is refused by a `BurgError`.
        new_cookie: that the page brings along; empty if none.
    """

    protocol_version = "HTTP/1.1"
    timeout = IDLE_TIMEOUT
    server: PageServer
    package: str
    pages: Mapping[str, tuple[str, str]]
    policy: str
    refused_code = HTTPStatus.CONFLICT
    new_cookie = ""

    def setup(self) -> None:
        """Bounds the time that requests take, and not only that between two bytes."""
        super().setup()
        self._stream = _TimedStream(self.connection, self._request_timeout)
        self.rfile.close()
        self.rfile = self._received = io.BufferedReader(self._stream)

    def handle_one_request(self) -> None:
        """Waits for a request, and answers it."""
        if self.server.is_admitted(self.connection):
            self._stream.expect_within(IDLE_TIMEOUT)
            try:
                self._received.peek(1)
            except TimeoutError:
                self.close_connection = True
                return
        self._stream.expect_within(self._request_timeout)
        super().handle_one_request()

    @property
    def _request_timeout(self) -> float:
        """Time for a request [s]."""
        return REFUSAL_TIMEOUT if self.server.refuses(self.connection) else REQUEST_TIMEOUT

    def admitted(self) -> tuple[str, dict[str, str]]:
        """Path and query of a request.

        Raises:
            RequestError: it is refused, whatever it asks for.
        """
        raise NotImplementedError

    def find(self, routes: Mapping[str, Handler], path: str) -> Handler:
        """Who answers a request for a path.

        Raises:
            RequestError: nobody does.
        """
        if self.command == "GET" and path in self.pages:
            return partial(self._send_page, path)
        if path not in routes:
            raise RequestError(HTTPStatus.NOT_FOUND, f"there is no {path[:100]}")
        return routes[path]

    def refusal(self, error: BurgError) -> tuple[Any, HTTPStatus]:
        """JSON values and status of the answer to what was refused."""
        return {"error": str(error)}, self.refused_code

    def answer(self, routes: Mapping[str, Handler]) -> None:
        """Answers a request by whoever is in charge of its path."""
        try:
            path, query = self.admitted()
            if self.server.refuses(self.connection):
                raise RequestError(
                    HTTPStatus.SERVICE_UNAVAILABLE,
                    f"{self.server.connections} connections are open, the most that this"
                    f" {self.server.title} serves at a time; close it in another browser, or allow"
                    " more when it is started",
                )
            self.server.admit(self.connection)
            found = self.find(routes, path)
            found(json_body(self.headers, self.rfile) if self.command == "POST" else query)
        except RequestError as error:
            self.close_connection = True  # its body may not have been read
            self.send_json({"error": str(error)}, error.code)
        except BurgError as error:
            self.send_json(*self.refusal(error))

    def send_json(self, data: Any, code: HTTPStatus = HTTPStatus.OK) -> None:
        """Answers with JSON."""
        self.send(code, "application/json", json.dumps(data, allow_nan=False).encode())

    def send(
        self,
        code: HTTPStatus,
        kind: str = "",
        body: bytes = b"",
        headers: Mapping[str, str] | None = None,
    ) -> None:
        """Answers with a body of a type."""
        self.send_head(code, headers or {})
        if code != HTTPStatus.NO_CONTENT:
            self.send_header("Content-Type", kind)
            self.send_header("Content-Length", str(len(body)))
        self.end_headers()
        self.wfile.write(body)

    def send_head(self, code: HTTPStatus, headers: Mapping[str, str]) -> None:
        """Begins an answer: its status, the headers of all answers, and its own."""
        self.send_response(code)
        common = {**ACCESS_HEADERS, "Content-Security-Policy": self.policy}
        for name, value in {**common, **headers}.items():
            self.send_header(name, value)

    def log_message(self, format: str, *args: Any) -> None:
        """Requests are not worth a line."""

    def _send_page(self, path: str, query: dict[str, str]) -> None:
        name, kind = self.pages[path]
        page = (files(self.package) / name).read_bytes()
        cookie = {"Set-Cookie": self.new_cookie} if self.new_cookie else None
        self.send(HTTPStatus.OK, kind, page, cookie)
