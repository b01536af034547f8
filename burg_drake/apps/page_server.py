"""The HTTP server of local pages: ports, one thread per connection, requests and answers.

Requests are not trusted: what cannot be read is refused with a message.
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
from email.message import Message
from functools import partial
from http import HTTPStatus
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from importlib.resources import files
from io import BufferedIOBase
from typing import Any, Literal
from urllib.parse import parse_qs, urlsplit

from burg_drake.apps.options.arguments import MAX_PAGE_CONNECTIONS
from burg_drake.core import (
    SECURITY_HEADERS as ACCESS_HEADERS,
    BurgError,
    InvalidInputError,
    RequestError,
    address_in_use_error,
    page_url,
    parse_json,
)


def parse_address(target: str) -> tuple[str, dict[str, str]]:
    """Path and query of what is asked for; of a repeated field the last value.

    Raises:
        RequestError: it is not an address.
    """
    try:
        url = urlsplit(target)
        return url.path, {key: values[-1] for key, values in parse_qs(url.query).items()}
    except ValueError as error:
        raise RequestError(HTTPStatus.BAD_REQUEST, f"no address: {error}") from error


def read_json_body(headers: Message, stream: BufferedIOBase) -> dict[str, Any]:
    """The JSON object of a POST; a form of another site cannot send that type.

    Raises:
        RequestError: another type, too long, or no JSON object.
    """
    max_body = 10_000  # Bytes.
    if headers.get_content_type() != "application/json":
        raise RequestError(HTTPStatus.UNSUPPORTED_MEDIA_TYPE, "send application/json")
    length = headers.get("Content-Length", "")
    if not _is_number(length) or int(length) > max_body:
        raise RequestError(HTTPStatus.BAD_REQUEST, "send a short body with its length")
    try:
        body = parse_json(stream.read(int(length)).decode(), "the body")
    except ValueError as error:
        raise RequestError(HTTPStatus.BAD_REQUEST, f"no JSON: {error}") from error
    if not isinstance(body, dict):
        raise RequestError(HTTPStatus.BAD_REQUEST, "send a JSON object")
    return body


def parse_picture_number(query: dict[str, str]) -> int:
    """`after=N`; 0 without.

    Raises:
        RequestError: no number, or one that no picture has.
    """
    text = query.get("after", "0")
    if not _is_number(text):
        raise RequestError(HTTPStatus.BAD_REQUEST, f"after={text[:50]} is not a picture's number")
    return int(text)


def _is_number(text: str) -> bool:
    max_digits = 12  # Python refuses to convert thousands of digits.
    return text.isdecimal() and len(text) <= max_digits


MAX_REFUSALS = 8
"""Maximum number of surplus connections answered with status 503 at a time; further ones are closed
without an answer."""


IDLE_TIMEOUT = 30.0  # Seconds between requests, and for a client to receive an answer.
REQUEST_TIMEOUT = 10.0  # Seconds for a request's head and body, and for the first request to begin.
REFUSAL_TIMEOUT = 2.0  # Seconds for the request of a surplus connection.


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
        connections: int = MAX_PAGE_CONNECTIONS,
    ) -> None:
        max_ports = 50  # Ports that are tried if none is given.
        self.host, self.connections = host, connections
        self._lock = threading.Lock()
        self._open: dict[socket.socket, _Connection] = {}  # in the order in which they came
        if ":" in host:
            self.address_family = socket.AF_INET6
        first = self.first_port if port is None else port
        ports = range(first, first + (max_ports if port is None else 1))
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
        connection = _Connection(_connection_key(str(client_address[0])))
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
        browser_connections = 6  # Most connections that a browser opens to one server.
        served = self._in_state("new", "admitted")
        own = [c for c in served if self._open[c].address == address]
        share = max(browser_connections, self.connections // 2)
        most = self.connections if address == LOOPBACK_KEY else share
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


LOOPBACK_KEY = "this machine"  # Key under which connections from this machine are counted.


def _connection_key(host: str) -> str:
    """The key by which connections are counted: an IPv4 address, or the /64 network of an IPv6
    address."""
    ip = ipaddress.ip_address(host.partition("%")[0])
    mapped = getattr(ip, "ipv4_mapped", None) or ip
    if mapped.is_loopback:
        return LOOPBACK_KEY
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
        folder: of `burg_drake.apps`, with the files of the page.
        pages: file and type by path.
        policy: the Content-Security-Policy of every answer.
        refused_code: status of the answer where an action is refused by a `BurgError`.
        new_cookie: that the page brings along; empty if none.
    """

    protocol_version = "HTTP/1.1"
    timeout = IDLE_TIMEOUT
    server: PageServer
    folder: str
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
            found(read_json_body(self.headers, self.rfile) if self.command == "POST" else query)
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
        page = (files("burg_drake.apps") / self.folder / name).read_bytes()
        cookie = {"Set-Cookie": self.new_cookie} if self.new_cookie else None
        self.send(HTTPStatus.OK, kind, page, cookie)
