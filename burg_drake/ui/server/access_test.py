"""Tries a door before anybody else does: what must be refused is refused, or it does not open."""

from __future__ import annotations

import http.client
from http import HTTPStatus

from burg_drake.core import MissingDependencyError

FOREIGN_HOST = "foreign.invalid"
ANSWER_TIMEOUT = 10.0
"""For an answer [s]."""
_HANDSHAKE = {
    "Connection": "Upgrade",
    "Upgrade": "websocket",
    "Sec-WebSocket-Version": "13",
    "Sec-WebSocket-Key": "AAAAAAAAAAAAAAAAAAAAAA==",
}


def require_guarded(address: str, port: int) -> None:
    """Connects as a foreign site would.

    Args:
        address: that is listened on.
        port: likewise.

    Raises:
        MissingDependencyError: what is foreign was let in.
    """
    near = {"0.0.0.0": "127.0.0.1", "::": "::1"}.get(address, address)
    own = f"[{near}]:{port}" if ":" in near else f"{near}:{port}"
    foreign = (
        {"Host": own, "Origin": f"http://{FOREIGN_HOST}", **_HANDSHAKE},
        {"Host": f"{FOREIGN_HOST}:{port}", "Origin": f"http://{FOREIGN_HOST}:{port}", **_HANDSHAKE},
        {"Host": own, **_HANDSHAKE},
        {"Host": f"{FOREIGN_HOST}:{port}"},
        {"Host": own, "Origin": f"http://{FOREIGN_HOST}"},
    )
    for headers in foreign:
        if _status(near, port, headers) != HTTPStatus.FORBIDDEN:
            raise MissingDependencyError(
                "the page was not opened, because other web sites could reach it with this"
                " version of viser; install another one: pip install 'burg-drake[ui]'"
            )


def _status(address: str, port: int, headers: dict[str, str]) -> int:
    connection = http.client.HTTPConnection(address, port, timeout=ANSWER_TIMEOUT)
    try:
        connection.putrequest("GET", "/", skip_host=True, skip_accept_encoding=True)
        for name, value in headers.items():
            connection.putheader(name, value)
        connection.endheaders()
        return connection.getresponse().status
    finally:
        connection.close()
