"""Access to a page: which requests are accepted, the page that is served, and upload limits."""

from __future__ import annotations

import html
from collections.abc import Callable
from dataclasses import dataclass
from http import HTTPStatus
from importlib.resources import files
from urllib.parse import parse_qs

from websockets.asyncio.server import ServerConnection
from websockets.http11 import Request, Response

from burg_drake.core import SECURITY_HEADERS, BrowserToken, RequestError, require_local_host

MAX_UPLOAD_BYTES = 32 << 20
"""Maximum bytes of a file; a photo of a board has a few million."""
MAX_ALL_UPLOADS_BYTES = 64 << 20
"""Maximum bytes of all uploads in progress."""


class RefusedError(Exception):
    """A browser sent a message that no page sends; its connection is closed with this reason."""


@dataclass
class _Upload:
    """An upload in progress.

    Attributes:
        owner: the connection.
        size: announced size [bytes].
        bytes_left: announced bytes that are still to come.
        parts_left: announced parts that are still to come.
    """

    owner: object
    size: int
    bytes_left: int
    parts_left: int


class Uploads:
    """Tracks and limits all uploads to a server; used in the server's thread only."""

    def __init__(self) -> None:
        self._transfers: dict[str, _Upload] = {}

    def start(self, owner: object, key: str, name: str, *, size: int, parts: int) -> None:
        """Registers an announced upload.

        Args:
            owner: the connection.
            key: key of the transfer, chosen by the browser.
            name: name of the file.
            size: size of the file [bytes].
            parts: number of parts.

        Raises:
            RefusedError: the file is too large, or the announcement is not from our page.
        """
        max_uploads = 16  # Uploads in progress.
        min_part_bytes = 64 << 10  # Except for the last part; viser's page sends 512 KiB.
        max_name_length = 255  # Characters.
        if not 0 <= size <= MAX_UPLOAD_BYTES:
            raise RefusedError(
                f"a file of {size} bytes is refused; at most {MAX_UPLOAD_BYTES} bytes are allowed"
            )
        if not (size > 0) <= parts <= -(-size // min_part_bytes):
            raise RefusedError(f"a file in {parts} parts is refused")
        if len(name) > max_name_length or name in ("", ".", "..") or {*name} & {*"/\\\0"}:
            raise RefusedError("the file name is not allowed")
        if key in self._transfers or len(self._transfers) >= max_uploads:
            raise RefusedError("too many files are uploaded at once")
        announced = sum(transfer.size for transfer in self._transfers.values())
        if size + announced > MAX_ALL_UPLOADS_BYTES:
            raise RefusedError("the files uploaded at once are too large")
        if parts:
            self._transfers[key] = _Upload(owner, size, size, parts)

    def receive_part(self, owner: object, key: str, size: int) -> bool:
        """Counts a received part of a file.

        Returns:
            False if this connection has no such upload, for example after it was refused.

        Raises:
            RefusedError: the file is larger than announced.
        """
        transfer = self._transfers.get(key)
        if transfer is None or transfer.owner is not owner:
            return False
        transfer.bytes_left -= size
        transfer.parts_left -= 1
        if transfer.bytes_left < 0:
            raise RefusedError("a file is larger than announced")
        if transfer.parts_left == 0:
            del self._transfers[key]
        return True

    def forget(self, owner: object) -> None:
        """Drops the uploads of a closed connection."""
        self._transfers = {
            key: transfer
            for key, transfer in self._transfers.items()
            if transfer.owner is not owner
        }


CONTENT_SECURITY_POLICY = (
    "default-src 'none'; script-src 'unsafe-inline' 'unsafe-eval'; worker-src blob: data:;"
    " connect-src 'self' blob: data:; img-src blob: data:;"
    " style-src 'unsafe-inline'; font-src data:; base-uri 'none'; form-action 'none';"
    " frame-ancestors 'none'"
)
"""The page may load nothing, and may connect to this server only, whatever `?websocket=` says."""


def initial_page(title: str) -> str:
    """viser's page with another title, our script before its own, and our style sheet after its
    own.

    Args:
        title: title of the page.
    """
    no_scripts_text = (
        "This page needs JavaScript, which is switched off in this browser: allow it for this"
        " address and reload."
    )
    script = _read_resource("burg_drake", "ui/first_page.js")
    script = script.replace("MAX_UPLOAD_BYTES = 0;", f"MAX_UPLOAD_BYTES = {MAX_UPLOAD_BYTES};")
    style = _read_resource("burg_drake", "ui/page.css")
    page = _read_resource("viser", "client/build/index.html")
    for old, new in (
        ("<title>Viser</title>", f"<title>{html.escape(title)}</title>\n<script>{script}</script>"),
        ("You need to enable JavaScript to run this app.", no_scripts_text),
        ("</body>", f"<style>{style}</style>\n</body>"),
    ):
        page = page.replace(old, new, 1)
    return page


def _read_resource(package: str, path: str) -> str:
    return files(package).joinpath(*path.split("/")).read_text(encoding="utf-8")


MAX_CONNECTIONS = 32
"""Maximum number of browser connections; each costs memory for unsent messages."""


class Admission:
    """Decides which requests are accepted.

    Args:
        host: address that the server listens on.
        port: port that the server listens on.
        title: title of the page.
        by_token: whether browsers need a token.

    Attributes:
        on_admitted: called, in the server's thread, when a browser has used the token, with that
            browser's address.
    """

    def __init__(self, host: str, port: int, *, title: str, by_token: bool) -> None:
        self.host = host
        self.page = initial_page(title)
        self.on_admitted: Callable[[str], None] = lambda address: None
        self._token = BrowserToken(f"burg_drake_{port}") if by_token else None

    @property
    def token(self) -> str | None:
        """The token for the next browser; None if no token is needed."""
        return None if self._token is None else self._token.token

    def process_request(self, connection: ServerConnection, request: Request) -> Response | None:
        """Answers a request; a callback for `websockets`.

        Returns:
            The page, a refusal, or None to continue with the websocket handshake.
        """
        try:
            return self._answer(connection, request)
        except RequestError as error:
            return self._response(connection, error.code, f"burg_drake: {error}\n")

    def _answer(self, connection: ServerConnection, request: Request) -> Response | None:
        # Servers read a repeated header in different ways.
        for name in ("Host", "Origin", "Sec-Fetch-Site", "Cookie", "Upgrade"):
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
        """Refuses websockets of other programs and of browsers without a cookie."""
        if "Origin" not in request.headers:
            raise RequestError(HTTPStatus.FORBIDDEN, "a websocket without Origin is refused")
        if not self._has_cookie(request):
            raise RequestError(HTTPStatus.FORBIDDEN, TOKEN_ADVICE)
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
            raise RequestError(HTTPStatus.FORBIDDEN, TOKEN_ADVICE)
        peer = connection.remote_address
        self.on_admitted(str(peer[0]) if peer else "")

    def _has_cookie(self, request: Request) -> bool:
        """Whether this browser was admitted; always true without a token."""
        return self._token is None or self._token.admits(request.headers.get("Cookie", ""))

    def _response(
        self, connection: ServerConnection, code: HTTPStatus, body: str, kind: str = "text/plain"
    ) -> Response:
        response = connection.respond(code, body)
        del response.headers["Content-Type"]
        response.headers["Content-Type"] = f"{kind}; charset=utf-8"
        for name, value in SECURITY_HEADERS.items():
            response.headers[name] = value
        response.headers["Content-Security-Policy"] = CONTENT_SECURITY_POLICY
        return response


TOKEN_ADVICE = (
    "open this page by the address with a token that burg-drake printed last; each address works"
    " in one browser"
)
"""Answer to a request without a valid token."""
