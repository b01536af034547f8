"""Serves a page to this machine, or to a browser that opens the one-time address."""

from __future__ import annotations

import http.client
import ipaddress
from dataclasses import dataclass
from http import HTTPStatus
from importlib.util import find_spec
from typing import TYPE_CHECKING

from burg_drake.core import MissingDependencyError, open_listener, page_url

if TYPE_CHECKING:
    import viser

    from burg_drake.ui.admission import Admission


@dataclass(frozen=True)
class ServedPage:
    """A page that is being served, until `close` or the end of a `with` block.

    Attributes:
        server: viser's server, to build the page on.
        host: address that the server listens on.
        port: port that the server listens on.
        admission: decides which requests are accepted.
    """

    server: viser.ViserServer
    host: str
    port: int
    admission: Admission

    @property
    def address(self) -> str:
        """Address of the page for admitted browsers."""
        return page_url(self.host, self.port)

    @property
    def url(self) -> str:
        """Address of the page for the next browser; with a token for one browser if other machines
        can reach the page."""
        token = self.admission.token
        return f"{self.address}?token={token}" if token else self.address

    def close(self) -> None:
        """Stops serving; browsers show that the connection is lost."""
        from burg_drake.ui.guarded_viser import stop_server

        stop_server(self.server)

    def __enter__(self) -> ServedPage:
        return self

    def __exit__(self, *error: object) -> None:
        self.close()


def require_viser() -> None:
    """Checks that the packages for the page are installed.

    Raises:
        MissingDependencyError: viser, websockets or msgspec is not installed.
    """
    for name in ("viser", "websockets", "msgspec"):
        if find_spec(name) is None:
            raise MissingDependencyError(f"the page needs {name}: pip install 'burg-drake[ui]'")


def serve_page(
    host: str = "127.0.0.1", port: int | None = None, *, title: str = "burg_drake"
) -> ServedPage:
    """Serves an empty page.

    Args:
        host: address to listen on; only this machine can reach the default.
        port: port to listen on; the first free one from 7200 on if None, any if 0.
        title: title of the page.

    Raises:
        InvalidInputError: the port is taken, or the address is not this machine's.
        MissingDependencyError: viser is not installed, or this version cannot be guarded.
    """
    require_viser()
    from burg_drake.ui.admission import Admission
    from burg_drake.ui.guarded_viser import guarded_server, stop_server

    # The live camera view starts at 7100.
    listener = open_listener(host, port, first_port=7200, title="page")
    address, bound = listener.getsockname()[:2]
    local = ipaddress.ip_address(address).is_loopback
    admission = Admission(host, bound, title=title, by_token=not local)
    server = guarded_server(listener, admission)
    try:
        require_guarded(address, bound)
    except BaseException:
        stop_server(server)
        raise
    server.gui.configure_theme(show_share_button=False, show_logo=False)
    return ServedPage(server, host, bound, admission)


def require_guarded(address: str, port: int) -> None:
    """Checks that the server refuses requests of foreign web sites.

    Args:
        address: address that the server listens on.
        port: port that the server listens on.

    Raises:
        MissingDependencyError: a foreign request was accepted.
    """
    foreign_host = "foreign.invalid"  # Host name of another site.
    # Headers of a websocket handshake.
    handshake = {
        "Connection": "Upgrade",
        "Upgrade": "websocket",
        "Sec-WebSocket-Version": "13",
        "Sec-WebSocket-Key": "AAAAAAAAAAAAAAAAAAAAAA==",
    }
    near = {"0.0.0.0": "127.0.0.1", "::": "::1"}.get(address, address)
    own = f"[{near}]:{port}" if ":" in near else f"{near}:{port}"
    foreign = (
        {"Host": own, "Origin": f"http://{foreign_host}", **handshake},
        {"Host": f"{foreign_host}:{port}", "Origin": f"http://{foreign_host}:{port}", **handshake},
        {"Host": own, **handshake},
        {"Host": f"{foreign_host}:{port}"},
        {"Host": own, "Origin": f"http://{foreign_host}"},
    )
    for headers in foreign:
        if _response_status(near, port, headers) != HTTPStatus.FORBIDDEN:
            raise MissingDependencyError(
                "the page was not opened, because other web sites could reach it with this"
                " version of viser; install another one: pip install 'burg-drake[ui]'"
            )


def _response_status(address: str, port: int, headers: dict[str, str]) -> int:
    connection = http.client.HTTPConnection(address, port, timeout=10.0)
    try:
        connection.putrequest("GET", "/", skip_host=True, skip_accept_encoding=True)
        for name, value in headers.items():
            connection.putheader(name, value)
        connection.endheaders()
        return connection.getresponse().status
    finally:
        connection.close()
