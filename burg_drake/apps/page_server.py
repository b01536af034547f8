"""The HTTP server of local pages: connections, their limits and timeouts, requests and answers.

Requests are not trusted: unreadable ones are refused with a message.
"""

from __future__ import annotations

import asyncio
import ipaddress
import json
import logging
import threading
from collections import Counter
from collections.abc import Awaitable, Callable, Mapping, Sequence
from functools import partial
from http import HTTPStatus
from importlib.resources import files
from typing import Any, Literal

import uvicorn
from starlette.applications import Starlette
from starlette.concurrency import run_in_threadpool
from starlette.exceptions import HTTPException
from starlette.middleware import Middleware
from starlette.middleware.base import BaseHTTPMiddleware
from starlette.requests import ClientDisconnect, Request
from starlette.responses import Response
from starlette.routing import Route
from uvicorn.protocols.http.h11_impl import H11Protocol

from burg_drake import core
from burg_drake.apps import options

MAX_REFUSALS = 8
"""Maximum number of surplus connections answered with status 503 at a time; further ones are closed
without an answer."""

IDLE_TIMEOUT = 30.0  # Seconds between requests, and for a client to receive an answer.
REQUEST_TIMEOUT = 10.0  # Seconds for a request's head and body, and for the first request to begin.
REFUSAL_TIMEOUT = 2.0  # Seconds for the request of a surplus connection.


def json_response(
    data: Any, code: int = HTTPStatus.OK, headers: Mapping[str, str] | None = None
) -> Response:
    """A JSON response; lone surrogates, which file names may contain, are escaped."""
    return Response(json.dumps(data, allow_nan=False), code, headers, "application/json")


def get_route(path: str, answer: Callable[[Request], Response]) -> Route:
    """The route of a GET request, answered in its own thread."""
    return Route(path, answer, methods=["GET"])


def post_route(path: str, act: Callable[[dict[str, Any]], dict[str, Any]]) -> Route:
    """The route of a POST request: `act` takes the JSON object of the request, in its own thread,
    and returns the JSON object of the answer."""

    async def answer(request: Request) -> Response:
        return json_response(await run_in_threadpool(act, await _read_json_body(request)))

    return Route(path, answer, methods=["POST"])


def file_routes(folder: str, pages: Mapping[str, tuple[str, str]]) -> list[Route]:
    """The routes of the files of a page.

    Args:
        folder: folder of the files, in `burg_drake.apps`.
        pages: file name and content type by path.
    """

    def answer(name: str, kind: str, request: Request) -> Response:
        content = (files("burg_drake.apps") / folder / name).read_bytes()
        return Response(content, headers={"Content-Type": kind})

    return [get_route(path, partial(answer, *file)) for path, file in pages.items()]


async def _read_json_body(request: Request) -> dict[str, Any]:
    """The JSON object of a POST request; forms of other sites cannot send this content type.

    Raises:
        RequestError: the body has another type, is too long, or is not a JSON object.
    """
    max_body = 10_000  # Bytes.
    kind = request.headers.get("Content-Type", "").partition(";")[0]
    if kind.strip().lower() != "application/json":
        raise core.RequestError(HTTPStatus.UNSUPPORTED_MEDIA_TYPE, "send application/json")
    length = request.headers.get("Content-Length", "")
    chunked = "Transfer-Encoding" in request.headers  # its length would not be the body's
    if chunked or not _is_number(length) or int(length) > max_body:
        raise core.RequestError(HTTPStatus.BAD_REQUEST, "send a short body with its length")
    try:
        body = core.parse_json((await request.body()).decode(), "the body")
    except ClientDisconnect as error:
        raise core.RequestError(HTTPStatus.BAD_REQUEST, "the connection was closed") from error
    except ValueError as error:
        raise core.RequestError(HTTPStatus.BAD_REQUEST, f"no JSON: {error}") from error
    if not isinstance(body, dict):
        raise core.RequestError(HTTPStatus.BAD_REQUEST, "send a JSON object")
    return body


def parse_picture_number(request: Request, name: str = "after") -> int:
    """A picture number in the query, such as `after=N`; 0 if there is none.

    Raises:
        RequestError: it is not a valid picture number.
    """
    text = request.query_params.get(name, "0")
    if not _is_number(text):
        raise core.RequestError(
            HTTPStatus.BAD_REQUEST, f"{name}={text[:50]} is not a picture's number"
        )
    return int(text)


def _is_number(text: str) -> bool:
    max_digits = 12  # Python refuses to convert thousands of digits.
    return text.isdecimal() and len(text) <= max_digits


def request_header(request: Request, name: str) -> str | None:
    """The value of a header; None if there is none.

    Raises:
        RequestError: the header is given twice, which servers read in different ways.
    """
    values = request.headers.getlist(name)
    if len(values) > 1:
        raise core.RequestError(HTTPStatus.BAD_REQUEST, f"{name} is given twice")
    return values[0] if values else None


class _Connection(H11Protocol):
    """An open connection with its address, its state and its deadline."""

    places: ConnectionPlaces
    state: Literal["new", "admitted", "refused"] = "new"
    _deadline: asyncio.TimerHandle | None = None

    def connection_made(self, transport: asyncio.Transport) -> None:  # type: ignore[override]
        """Takes a place, or refuses the connection."""
        super().connection_made(transport)
        self.address = _address_key(self.client[0] if self.client else "127.0.0.1")
        self.places.add(self)
        self._set_deadline(REFUSAL_TIMEOUT if self.state == "refused" else REQUEST_TIMEOUT)

    def data_received(self, data: bytes) -> None:
        """Limits the time for a whole request, not only that between two bytes."""
        before = self.cycle
        is_next = before is not None and before.response_complete
        if self._deadline is None and is_next:
            self._set_deadline(REQUEST_TIMEOUT)
        super().data_received(data)
        is_partial = is_next and self.cycle is before  # its head has not arrived
        if self.cycle is not None and not self.cycle.more_body and not is_partial:
            self._set_deadline(None)

    def pause_writing(self) -> None:
        """Limits the time for the client to receive the buffered data."""
        super().pause_writing()
        self._set_deadline(IDLE_TIMEOUT)

    def resume_writing(self) -> None:
        """Ends the time limit after the client has received the data."""
        super().resume_writing()
        self._set_deadline(None)

    def connection_lost(self, exc: Exception | None) -> None:
        """Frees the place of the connection."""
        self._set_deadline(None)
        self.places.remove(self)
        super().connection_lost(exc)

    def _set_deadline(self, seconds: float | None) -> None:
        """Replaces the deadline of the connection; None for no deadline."""
        if self._deadline is not None:
            self._deadline.cancel()
        abort = self.transport.abort
        self._deadline = None if seconds is None else self.loop.call_later(seconds, abort)


LOOPBACK_KEY = "this machine"  # Key under which connections from this machine are counted.


def _address_key(host: str) -> str:
    """The key by which connections are counted: an IPv4 address, or the /64 network of an IPv6
    address."""
    ip = ipaddress.ip_address(host.partition("%")[0])
    mapped = getattr(ip, "ipv4_mapped", None) or ip
    if mapped.is_loopback:
        return LOOPBACK_KEY
    return str(mapped) if mapped.version == 4 else ip.exploded[:19]


class ConnectionPlaces:
    """The open connections, with a limit on how many are served.

    A connection is admitted by its first accepted request. If there are too many connections, one
    that is not yet admitted is closed, so that idle ones lock nobody out.

    Args:
        limit: maximum number of connections served at a time.
    """

    def __init__(self, limit: int) -> None:
        self.limit = limit
        self._open: dict[Any, _Connection] = {}  # By address and port, in the order of arrival.

    def connection_of(self, request: Request) -> _Connection | None:
        """The connection of a request; None if it was closed."""
        return self._open.get(request.scope["client"])

    def add(self, connection: _Connection) -> None:
        """Gives a new connection a place, refuses it, or closes it if too many are refused."""
        if not self._make_room(connection.address):
            connection.state = "refused"
            if sum(c.state == "refused" for c in self._open.values()) >= MAX_REFUSALS:
                connection.transport.abort()
                return
        self._open[connection.client] = connection

    def remove(self, connection: _Connection) -> None:
        """Removes a closed connection."""
        self._open.pop(connection.client, None)

    def _make_room(self, address: str) -> bool:
        """Whether one more connection from an address can be served. If there are too many, closes
        one that is not admitted."""
        browser_connections = 6  # Maximum number of connections from a browser to one server.
        served = [c for c in self._open.values() if c.state != "refused"]
        own = [c for c in served if c.address == address]
        share = max(browser_connections, self.limit // 2)
        address_limit = self.limit if address == LOOPBACK_KEY else share
        if len(own) < address_limit and len(served) < self.limit:
            return True
        waiting = [c for c in (own if len(own) >= address_limit else served) if c.state == "new"]
        if not waiting:
            return False
        counts = Counter(c.address for c in waiting)
        oldest = max(waiting, key=lambda c: counts[c.address])  # first of those with equal counts
        oldest.transport.abort()
        self.remove(oldest)
        return True


class PageServer:
    """Serves a page in its own thread until it is closed.

    Args:
        routes: routes of the page.
        host: address to listen on.
        port: port to listen on; the first free one from `first_port` on if None, any if 0.
        connections: maximum number served at a time; half as many, but at least six, for one
            address of another machine. If all are admitted, further ones get status 503.

    Attributes:
        first_port: the first port that is tried.
        title: title of the page, for messages.
        policy: the Content-Security-Policy of every answer.
        refused_code: status of the answer if an action raises a `BurgError`.
        host: address to listen on, as given.
        server_address: address and port that it listens on.

    Raises:
        InvalidInputError: the port is taken, or the address is not this machine's.
    """

    first_port: int
    title = "page"
    policy: str
    refused_code = HTTPStatus.CONFLICT

    def __init__(
        self,
        routes: Sequence[Route],
        *,
        host: str,
        port: int | None = None,
        connections: int = options.MAX_PAGE_CONNECTIONS,
    ) -> None:
        self.host = host
        self._socket = core.open_listener(host, port, first_port=self.first_port, title=self.title)
        self.server_address = self._socket.getsockname()[:2]
        self._places = ConnectionPlaces(connections)
        app = Starlette(
            routes=routes,
            middleware=[Middleware(BaseHTTPMiddleware, dispatch=self._answer)],
            exception_handlers={core.BurgError: self._answer_refusal, HTTPException: _no_route},
        )
        app.router.redirect_slashes = False
        config = uvicorn.Config(
            app,
            http=type("_", (_Connection,), {"places": self._places}),
            ws="none",
            lifespan="off",
            log_config=None,
            log_level="error",
            access_log=False,
            server_header=False,
            proxy_headers=False,  # headers about the client's address are not trusted
            timeout_keep_alive=IDLE_TIMEOUT,  # type: ignore[arg-type]
            timeout_graceful_shutdown=1,
        )
        self._server = uvicorn.Server(config)
        self._thread = threading.Thread(
            target=self._server.run,
            args=([self._socket],),
            name=f"{self.title} server",
            daemon=True,
        )

    @property
    def url(self) -> str:
        """Address of the page."""
        return core.page_url(self.host, self.server_address[1])

    def start(self) -> None:
        """Starts serving."""
        self._thread.start()

    def close(self) -> None:
        """Stops serving; requests that are being answered end soon."""
        # uvicorn would report requests that the end cuts off as errors.
        logging.getLogger("uvicorn.error").setLevel(logging.CRITICAL)
        self._server.should_exit = True
        if self._thread.is_alive():
            self._thread.join()
        self._socket.close()

    def admit(self, request: Request) -> str:
        """Refuses a request whose headers name another host.

        Returns:
            The cookie to set with the answer; empty if none.

        Raises:
            RequestError: the request is refused.
        """
        header, is_page = partial(request_header, request), request.scope["path"] == "/"
        core.require_local_host(header, served=self.host, is_page=is_page)
        return ""

    async def _answer(
        self, request: Request, answer: Callable[[Request], Awaitable[Response]]
    ) -> Response:
        """Answers an admitted request, and adds the headers of all answers."""
        common = {**core.SECURITY_HEADERS, "Content-Security-Policy": self.policy}
        try:
            cookie = self._admit_connection(request)
            response = await answer(request)
            if cookie:
                response.headers["Set-Cookie"] = cookie
        except core.RequestError as error:
            # the body of the request may not have been read
            response = json_response({"error": str(error)}, error.code, {"Connection": "close"})
        for name, value in common.items():
            response.headers.setdefault(name, value)
        return response

    def _admit_connection(self, request: Request) -> str:
        """Admits the connection of a request; returns the cookie to set with the answer.

        Raises:
            RequestError: the request is refused.
        """
        if not request.scope["path"].startswith("/"):
            raise core.RequestError(HTTPStatus.BAD_REQUEST, "this is no address of a page")
        if request.method not in ("GET", "POST"):
            raise core.RequestError(HTTPStatus.NOT_IMPLEMENTED, "send GET or POST")
        cookie = self.admit(request)
        connection = self._places.connection_of(request)
        if connection is None or connection.state == "refused":
            raise core.RequestError(
                HTTPStatus.SERVICE_UNAVAILABLE,
                f"{self._places.limit} connections are open, the most that this {self.title} serves"
                " at a time; close it in another browser, or allow more when it is started",
            )
        connection.state = "admitted"
        return cookie

    def _answer_refusal(self, request: Request, error: Exception) -> Response:
        """The answer to an action that raised a `BurgError`."""
        return json_response({"error": str(error)}, self.refused_code)


def _no_route(request: Request, error: Exception) -> Response:
    """Raises the error for a path without a route."""
    raise core.RequestError(HTTPStatus.NOT_FOUND, f"there is no {request.scope['path'][:100]}")
