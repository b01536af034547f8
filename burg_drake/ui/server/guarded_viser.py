"""A viser server whose port has a guard.

viser opens its port by one call, `websockets.asyncio.server.serve`, in a thread of its own. That
call is replaced while the server is constructed: it gets a socket that listens already, our
`process_request`, and smaller limits. All of viser that is not public is used here and in
`messages`, and nowhere else.
"""

from __future__ import annotations

import asyncio
import contextlib
import logging
import socket
import sys
import threading
import traceback
from collections.abc import Callable, Iterator
from functools import partial
from typing import Any

import rich
import viser
import websockets.asyncio.server
from viser._messages import FileTransferPartAck
from websockets.asyncio.server import ServerConnection

from burg_drake.core import MissingDependencyError
from burg_drake.ui.server.admission import Admission
from burg_drake.ui.server.messages import LARGEST_MESSAGE, BoundedConnection
from burg_drake.ui.server.uploads import Uploads

_PATCHED = threading.Lock()
_LOG = logging.getLogger(__name__)
_LOG.addHandler(logging.NullHandler())  # what clients do wrong is not worth a line in the terminal


def guarded_server(listener: socket.socket, admission: Admission) -> viser.ViserServer:
    """Starts viser behind a guard.

    Args:
        listener: listens on the port; viser closes it.
        admission: judges requests.

    Raises:
        MissingDependencyError: this viser does not open its port as the guard expects.
    """
    host, port = listener.getsockname()[:2]
    with _quiet(), _guarded_serve(listener, admission) as calls:
        server = viser.ViserServer(host=host, port=port, verbose=False)
    if calls:
        _forget_uploads(server)
        return server
    stop(server)
    raise MissingDependencyError(
        f"viser {viser.__version__} cannot be protected from other web sites; install another"
        " version: pip install 'burg-drake[ui]'"
    )


def stop(server: viser.ViserServer) -> None:
    """Stops a server."""
    with _quiet():
        server.stop()


@contextlib.contextmanager
def _guarded_serve(listener: socket.socket, admission: Admission) -> Iterator[list[None]]:
    """While it lasts, viser opens its port with a guard; yields a list of the calls that did."""
    original = websockets.asyncio.server.serve
    calls: list[None] = []

    def serve(handler: Callable[..., Any], *place: Any, **options: Any) -> Any:
        if handler.__module__ != viser.infra._infra.__name__:
            return original(handler, *place, **options)
        calls.append(None)
        asyncio.get_running_loop().set_exception_handler(_handle_error)
        return original(
            _of_one_version(handler),
            sock=listener,
            process_request=admission.process_request,
            select_subprotocol=options["select_subprotocol"],
            compression=None,
            max_size=LARGEST_MESSAGE,
            create_connection=partial(BoundedConnection, uploads=Uploads()),  # type: ignore[arg-type]
            logger=_LOG,
            server_header=None,
        )

    websockets.asyncio.server.serve = serve  # type: ignore[assignment, misc]
    try:
        yield calls
    finally:
        websockets.asyncio.server.serve = original  # type: ignore[misc]


def _handle_error(loop: asyncio.AbstractEventLoop, context: dict[str, Any]) -> None:
    """Errors are told, but for those of viser itself about values that no page sends."""
    error = context.get("exception")
    places = [] if error is None else [*traceback.walk_tb(error.__traceback__)]
    if places and places[-1][0].f_globals.get("__name__", "").startswith("viser."):
        _LOG.debug("a message could not be handled", exc_info=error)
    else:
        loop.default_exception_handler(context)


def _forget_uploads(server: viser.ViserServer) -> None:
    """viser keeps for pages to come how far uploads got, which they would show as their own."""

    def forget(client: object) -> None:
        server._websock_server.get_message_buffer().remove_from_buffer(
            lambda message: isinstance(message, FileTransferPartAck)
        )

    server._websock_server.on_client_connect(forget)


def _of_one_version(handler: Callable[[ServerConnection], Any]) -> Callable[..., Any]:
    """viser's handler, for pages of the same version; of others it would print a line each time."""
    wanted = f"viser-v{viser.__version__}"

    async def checked(connection: ServerConnection) -> None:
        if connection.subprotocol == wanted:
            await handler(connection)
        else:
            await connection.close(1002, "The server has another version: reload this page")

    return checked


@contextlib.contextmanager
def _quiet() -> Iterator[None]:
    """While it lasts, viser prints nothing; others do. One thread at a time."""
    with _PATCHED:
        original = rich.print

        def printed(*objects: Any, **options: Any) -> None:
            if not sys._getframe(1).f_globals.get("__name__", "").startswith("viser."):
                original(*objects, **options)

        rich.print = printed
        try:
            yield
        finally:
            rich.print = original
