"""The door of a page: serves viser's page to this machine, or to whoever has the one-time address.

viser by itself serves anybody: any web site that the user has open may connect to it. `serve` puts
a guard (`admission`) before the one call by which viser opens its port, so that nothing reaches
viser unseen, and tries it before the address is handed out.

What a page may use: everything of viser but forms, `get_render` and sharing by a public tunnel, of
which the guard lets nothing through.
"""

from __future__ import annotations

import errno
import ipaddress
import socket
from dataclasses import dataclass
from importlib.util import find_spec
from types import TracebackType
from typing import TYPE_CHECKING

from burg_drake.core import (
    LOCALHOST,
    InvalidInputError,
    MissingDependencyError,
    address_in_use_error,
    page_url,
)

if TYPE_CHECKING:
    import viser

    from burg_drake.ui.server.admission import Admission

FIRST_PORT, PORTS = 7200, 50
"""Without a port the first free one of these; the live camera view's begin at 7100."""


@dataclass(frozen=True)
class ServedPage:
    """An open door; closed by `close` or at the end of a `with`.

    Attributes:
        server: viser's, to build the page on.
        host: the address that is listened on.
        port: likewise.
        admission: who may come in.
    """

    server: viser.ViserServer
    host: str
    port: int
    admission: Admission

    @property
    def address(self) -> str:
        """Of the page, for browsers that were let in."""
        return page_url(self.host, self.port)

    @property
    def url(self) -> str:
        """Address of the page for the next browser; with a token, good for this one alone, if
        other machines can reach it."""
        token = self.admission.token
        return f"{self.address}?token={token}" if token else self.address

    def close(self) -> None:
        """Stops serving; browsers see that the connection is lost."""
        from burg_drake.ui.server.guarded_viser import stop

        stop(self.server)

    def __enter__(self) -> ServedPage:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.close()


def require_viser() -> None:
    """Raises what is missing.

    Raises:
        MissingDependencyError: viser, or what the door needs besides, is not installed.
    """
    for name in ("viser", "websockets", "msgspec"):
        if find_spec(name) is None:
            raise MissingDependencyError(f"the page needs {name}: pip install 'burg-drake[ui]'")


def serve(
    host: str = LOCALHOST, port: int | None = None, *, title: str = "burg_drake"
) -> ServedPage:
    """Opens the door to an empty page.

    Args:
        host: address to listen on; only this machine can reach the default.
        port: to listen on; the first free one from `FIRST_PORT` on if None, any if 0.
        title: of the page.

    Raises:
        InvalidInputError: the port is taken, or the address is not this machine's.
        MissingDependencyError: viser is not installed, or is one that cannot be guarded.
    """
    require_viser()
    from burg_drake.ui.server.access_test import require_guarded
    from burg_drake.ui.server.admission import Admission
    from burg_drake.ui.server.guarded_viser import guarded_server, stop

    listener = listen(host, port)
    address, bound = listener.getsockname()[:2]
    local = ipaddress.ip_address(address).is_loopback
    admission = Admission(host, bound, title=title, by_token=not local)
    server = guarded_server(listener, admission)
    try:
        require_guarded(address, bound)
    except BaseException:
        stop(server)
        raise
    server.gui.configure_theme(show_share_button=False, show_logo=False)
    return ServedPage(server, host, bound, admission)


def listen(host: str, port: int | None) -> socket.socket:
    """A socket that listens.

    Args:
        host: address to listen on.
        port: as of `serve`.

    Raises:
        InvalidInputError: the port is taken, or the address is not this machine's.
    """
    ports = range(FIRST_PORT, FIRST_PORT + PORTS) if port is None else range(port, port + 1)
    family = socket.AF_INET6 if ":" in host else socket.AF_INET
    for candidate in ports:
        try:
            return socket.create_server(
                (host, candidate), family=family, dualstack_ipv6=host == "::"
            )
        except OSError as error:
            failure = error
            if error.errno != errno.EADDRINUSE:
                raise InvalidInputError(
                    f"the page cannot be served on {host}: {error.strerror or error}"
                ) from error
    raise InvalidInputError(
        address_in_use_error(host, ports, any_of_them=port is None)
    ) from failure
