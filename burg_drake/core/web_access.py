"""Who may talk to a page that this machine serves: what all small servers share.

Any web site that the user has open can send requests to servers of this machine. Requests must
therefore name this machine as their host, which stops DNS rebinding, and must not come from another
site. Nothing here trusts the sender.
"""

from __future__ import annotations

import ipaddress
import re
import socket
from collections.abc import Callable, Mapping
from http import HTTPStatus

from burg_drake.core.errors import shown

LOCALHOST = "127.0.0.1"
EVERYWHERE = ("0.0.0.0", "::", "")
HEADERS: Mapping[str, str] = {
    "Cache-Control": "no-store",
    "Cross-Origin-Opener-Policy": "same-origin",
    "Cross-Origin-Resource-Policy": "same-origin",
    "Referrer-Policy": "no-referrer",
    "X-Content-Type-Options": "nosniff",
}
"""Of every answer, beside a Content-Security-Policy that fits the page."""
_HOST = re.compile(r"(?P<name>[^\s@/?#\[\]:]+|\[[0-9a-fA-F:.]+\])(:[0-9]{1,5})?")


class RequestError(Exception):
    """A request that is refused.

    Attributes:
        code: HTTP status.
    """

    def __init__(self, code: HTTPStatus, message: str) -> None:
        super().__init__(message)
        self.code = code


def is_local_host(name: str, served: str) -> bool:
    """Whether a `Host` header names this machine.

    A rebound DNS name is a name, so that any plain address will do.

    Args:
        name: the header.
        served: the address that is listened on.
    """
    match = _HOST.fullmatch(name)
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
    """Refuses what another site may have sent.

    Args:
        header: looks up one of the request's headers.
        served: the address that is listened on.
        is_page: the page itself is asked for, which links of other sites may lead to.

    Raises:
        RequestError: another host is meant, or another site asks.
    """
    host, origin = header("Host") or "", header("Origin")
    if not is_local_host(host, served):
        raise RequestError(
            HTTPStatus.FORBIDDEN,
            f"this server is not {shown(host) or 'a nameless host'}; open it by the address"
            " that was printed",
        )
    if origin is not None and origin != f"http://{host}":
        raise RequestError(HTTPStatus.FORBIDDEN, f"requests from {shown(origin)} are refused")
    if header("Sec-Fetch-Site") == "cross-site" and not is_page:
        raise RequestError(HTTPStatus.FORBIDDEN, "requests from other sites are refused")


def page_url(host: str, port: int) -> str:
    """Address of the page for browsers, with the machine's name if it is served everywhere."""
    name = socket.gethostname() if host in EVERYWHERE else host
    name = f"[{name}]" if ":" in name else name
    return f"http://{name}:{port}/"


def address_in_use_error(host: str, ports: range, *, any_of_them: bool) -> str:
    """Says that no port was free.

    Args:
        host: the address.
        ports: that were tried.
        any_of_them: the user left the choice to us.
    """
    if any_of_them:
        return f"all ports of {host} from {ports[0]} to {ports[-1]} are in use; choose another one"
    return (
        f"port {ports[0]} of {host} is in use; choose another one, or leave it out to take"
        " the first free one"
    )
