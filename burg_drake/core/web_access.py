"""Access control of the local web pages: host checks, tokens and session cookies."""

from __future__ import annotations

import errno
import hmac
import ipaddress
import re
import secrets
import socket
import threading
from collections.abc import Callable, Mapping
from http import HTTPStatus

from burg_drake.core.errors import InvalidInputError, shorten_text

SECURITY_HEADERS: Mapping[str, str] = {
    "Cache-Control": "no-store",
    "Cross-Origin-Opener-Policy": "same-origin",
    "Cross-Origin-Resource-Policy": "same-origin",
    "Referrer-Policy": "no-referrer",
    "X-Content-Type-Options": "nosniff",
}
"""Headers of every response; each page adds its own Content-Security-Policy."""


class RequestError(Exception):
    """A rejected request.

    Attributes:
        code: HTTP status.
    """

    def __init__(self, code: HTTPStatus, message: str) -> None:
        super().__init__(message)
        self.code = code


def is_local_host(name: str, served: str) -> bool:
    """Whether a `Host` header names this machine.

    DNS rebinding uses names, so any plain address is accepted.

    Args:
        name: the header.
        served: the address of the server.
    """
    match = re.fullmatch(r"(?P<name>[^\s@/?#\[\]:]+|\[[0-9a-fA-F:.]+\])(:[0-9]{1,5})?", name)
    if match is None:
        return False
    host = match["name"].strip("[]").lower()
    mine = socket.gethostname().lower()
    if host in ("localhost", served.lower(), mine, f"{mine}.local"):
        return True
    try:
        ipaddress.ip_address(host)
    except ValueError:
        return False
    return True


def require_local_host(header: Callable[[str], str | None], *, served: str, is_page: bool) -> None:
    """Rejects requests from other sites.

    Args:
        header: returns a header of the request.
        served: the address of the server.
        is_page: the request is for the page itself, to which other sites may link.

    Raises:
        RequestError: the host is another one, or the request comes from another site.
    """
    host, origin = header("Host") or "", header("Origin")
    if not is_local_host(host, served):
        raise RequestError(
            HTTPStatus.FORBIDDEN,
            f"this server is not {shorten_text(host) or 'a nameless host'}; open it by the address"
            " that was printed",
        )
    if origin is not None and origin != f"http://{host}":
        raise RequestError(
            HTTPStatus.FORBIDDEN, f"requests from {shorten_text(origin)} are refused"
        )
    if header("Sec-Fetch-Site") == "cross-site" and not is_page:
        raise RequestError(HTTPStatus.FORBIDDEN, "requests from other sites are refused")


def page_url(host: str, port: int) -> str:
    """URL of the page, with the machine's name if the server listens on all addresses."""
    name = socket.gethostname() if host in ("0.0.0.0", "::", "") else host
    name = f"[{name}]" if ":" in name else name
    return f"http://{name}:{port}/"


def open_listener(host: str, port: int | None, *, first_port: int, title: str) -> socket.socket:
    """Opens a listening socket.

    Args:
        host: address to listen on.
        port: port to listen on; any if 0, the first free one of 50 if None.
        first_port: first of these 50 ports.
        title: title of the server, for messages.

    Raises:
        InvalidInputError: the port is in use, or the address is not this machine's.
    """
    ports = range(first_port, first_port + 50) if port is None else range(port, port + 1)
    family = socket.AF_INET6 if ":" in host else socket.AF_INET
    for candidate in ports:
        try:
            return socket.create_server(
                (host, candidate), family=family, backlog=64, dualstack_ipv6=host == "::"
            )
        except OSError as error:
            failure = error
            if error.errno != errno.EADDRINUSE:
                raise InvalidInputError(
                    f"the {title} cannot be served on {host}: {error.strerror or error}"
                ) from error
    if port is None:
        taken = f"all ports of {host} from {ports[0]} to {ports[-1]} are in use; choose another one"
    else:
        taken = (
            f"port {port} of {host} is in use; choose another one, or leave it out to take the"
            " first free one"
        )
    raise InvalidInputError(taken) from failure


TOKEN_BYTES = 24  # Random bytes of a token or session secret.


class BrowserToken:
    """Admits browsers by a one-time token and a cookie; thread-safe.

    Args:
        cookie: name of the cookie.
        secret: its value; a new one if None.
    """

    def __init__(self, cookie: str, secret: str | None = None) -> None:
        self._cookie = cookie
        self._secret = secret or secrets.token_urlsafe(TOKEN_BYTES)
        self._lock = threading.Lock()
        self._token = secrets.token_urlsafe(TOKEN_BYTES)

    @property
    def token(self) -> str:
        """The token for the next browser."""
        with self._lock:
            return self._token

    def use(self, given: str) -> bool:
        """Whether a given token is valid; a valid token is used up."""
        with self._lock:
            if not _constant_time_equal(given, self._token):
                return False
            self._token = secrets.token_urlsafe(TOKEN_BYTES)
            return True

    @property
    def set_cookie(self) -> str:
        """Header that sets the cookie of an admitted browser."""
        return f"{self._cookie}={self._secret}; Path=/; HttpOnly; SameSite=Strict"

    def admits(self, cookies: str) -> bool:
        """Whether a `Cookie` header belongs to an admitted browser."""
        given = (cookie.strip().partition("=") for cookie in cookies.split(";"))
        return any(
            name == self._cookie and _constant_time_equal(value, self._secret)
            for name, _, value in given
        )


def _constant_time_equal(given: str, expected: str) -> bool:
    """Compares texts in constant time; characters that servers could not decode never match."""
    return hmac.compare_digest(given.encode(errors="replace"), expected.encode())
