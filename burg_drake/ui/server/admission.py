"""Who may come in: looks at every request that reaches the door, websocket handshakes among them.

A page that only this machine can reach is open to its browsers, as long as they name this machine
as their host and no other site asks. One that other machines can reach wants a token besides: the
first browser that brings it gets a cookie in its place, and the token is used up.
"""

from __future__ import annotations

from collections.abc import Callable
from http import HTTPStatus
from urllib.parse import parse_qs

from websockets.asyncio.server import ServerConnection
from websockets.http11 import Request, Response

from burg_drake.core import HEADERS, BrowserToken, RequestError, require_local_host
from burg_drake.ui.server.html_page import POLICY, first_page

MAX_CONNECTIONS = 32
"""Of browsers, each of which costs memory for what has yet to be sent to it."""
SINGLE_HEADERS = ("Host", "Origin", "Sec-Fetch-Site", "Cookie", "Upgrade")
"""Headers that decide; twice in a request they would mean one thing here, another thing there."""


class Admission:
    """Judges requests.

    Args:
        host: the address that is listened on.
        port: likewise.
        title: of the page.
        by_token: whether browsers need one.

    Attributes:
        on_admitted: called, in the server's thread, when a browser has used up the token, with
            that browser's address.
    """

    def __init__(self, host: str, port: int, *, title: str, by_token: bool) -> None:
        self.host = host
        self.page = first_page(title)
        self.on_admitted: Callable[[str], None] = lambda address: None
        self._token = BrowserToken(f"burg_drake_{port}") if by_token else None

    @property
    def token(self) -> str | None:
        """What the next browser has to bring; None if none is asked for."""
        return None if self._token is None else self._token.token

    def process_request(self, connection: ServerConnection, request: Request) -> Response | None:
        """Answers a request, as websockets asks for it.

        Returns:
            The page, a refusal, or None to go on with a websocket's handshake.
        """
        try:
            return self._answer(connection, request)
        except RequestError as error:
            return self._response(connection, error.code, f"burg_drake: {error}\n")

    def _answer(self, connection: ServerConnection, request: Request) -> Response | None:
        for name in SINGLE_HEADERS:
            if len(request.headers.get_all(name)) > 1:
                raise RequestError(HTTPStatus.BAD_REQUEST, f"header {name} is given twice")
        path, _, query = request.path.partition("?")
        upgrade = "Upgrade" in request.headers
        require_local_host(
            request.headers.get, served=self.host, is_page=path == "/" and not upgrade
        )
        if path != "/":
            raise RequestError(HTTPStatus.NOT_FOUND, "the only page of this server is /")
        if upgrade:
            self._require_browser(connection, request)
            return None
        return self._page(connection, request, query)

    def _require_browser(self, connection: ServerConnection, request: Request) -> None:
        """What opens a websocket is our page: browsers always say whose page asks."""
        if "Origin" not in request.headers:
            raise RequestError(HTTPStatus.FORBIDDEN, "a websocket without Origin is refused")
        if not self._has_cookie(request):
            raise RequestError(HTTPStatus.FORBIDDEN, NO_TOKEN)
        if len(connection.server.connections) >= MAX_CONNECTIONS:
            raise RequestError(
                HTTPStatus.SERVICE_UNAVAILABLE, "too many browsers have the page open"
            )

    def _page(self, connection: ServerConnection, request: Request, query: str) -> Response:
        is_new = self._token is not None and not self._has_cookie(request)
        if is_new:
            self._use_token(parse_qs(query).get("token", [""])[-1], connection)
        response = self._response(connection, HTTPStatus.OK, self.page, "text/html")
        if is_new and self._token is not None:
            response.headers["Set-Cookie"] = self._token.set_cookie
        return response

    def _use_token(self, given: str, connection: ServerConnection) -> None:
        if self._token is None or not self._token.use(given):
            raise RequestError(HTTPStatus.FORBIDDEN, NO_TOKEN)
        peer = connection.remote_address
        self.on_admitted(str(peer[0]) if peer else "")

    def _has_cookie(self, request: Request) -> bool:
        """Whether this browser was admitted; without a token all are."""
        return self._token is None or self._token.admits(request.headers.get("Cookie", ""))

    def _response(
        self, connection: ServerConnection, code: HTTPStatus, body: str, kind: str = "text/plain"
    ) -> Response:
        response = connection.respond(code, body)
        del response.headers["Content-Type"]
        response.headers["Content-Type"] = f"{kind}; charset=utf-8"
        for name, value in HEADERS.items():
            response.headers[name] = value
        response.headers["Content-Security-Policy"] = POLICY
        return response


NO_TOKEN = (
    "open this page by the address with a token that burg-drake printed last; each address works"
    " in one browser"
)
