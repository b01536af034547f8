"""A viser server that checks requests, messages and uploads before viser sees them."""

from __future__ import annotations

import asyncio
import contextlib
import logging
import socket
import sys
import threading
import time
import traceback
from collections.abc import Callable, Iterator
from functools import partial
from typing import Any

import msgspec
import rich
import viser
import websockets.asyncio.server
from viser._messages import FileTransferPartAck
from websockets.asyncio.server import ServerConnection

from burg_drake.core import MissingDependencyError
from burg_drake.ui.admission import Admission, RefusedError, Uploads

MAX_MESSAGE_BYTES = 1 << 20
"""Maximum bytes of a message; the parts of an upload are half as large."""
MESSAGE_RATE = 200.0  # Maximum messages per second in the long run; a drag sends 50.
MESSAGE_BURST = 400.0  # Maximum messages at once.
FIRST_MESSAGE_TYPE = "ViewerCameraMessage"
"""First message of a page; viser cleans up only after pages that sent it."""
ACCEPTED_TYPES = frozenset(
    {
        FIRST_MESSAGE_TYPE,
        "CommandTriggerMessage",
        "FileTransferPart",
        "FileTransferStartUpload",
        "GuiButtonHoldMessage",
        "GuiUpdateMessage",
        "LocalStorageGetItemResponseMessage",
        "SceneNodeClickMessage",
        "SceneNodeDragMessage",
        "ScenePointerMessage",
        "TransformControlsDragEndMessage",
        "TransformControlsDragStartMessage",
        "TransformControlsUpdateMessage",
    }
)
"""Accepted types of messages: no forms, rendered pictures or sharing by a public tunnel."""
_log = logging.getLogger(__name__)
_log.addHandler(logging.NullHandler())  # keeps errors of clients out of the terminal


class _Message(msgspec.Struct):
    """The fields of a message that are checked; viser reads the others."""

    type: str
    transfer_uuid: str = ""
    filename: str = ""
    size_bytes: int = 0
    part_count: int = 0
    content: bytes = b""
    updates: dict[str, msgspec.Raw] = {}


_MESSAGE_DECODER = msgspec.msgpack.Decoder(_Message)


class BoundedConnection(ServerConnection):
    """A connection that limits the rate of messages and is closed after an unexpected one.

    Args:
        uploads: uploads of all connections.
    """

    def __init__(self, *arguments: Any, uploads: Uploads, **options: Any) -> None:
        super().__init__(*arguments, **options)
        self._uploads = uploads
        self._connected = False
        self._credit, self._refilled = MESSAGE_BURST, time.monotonic()

    async def recv(self, decode: bool | None = None) -> Any:
        """The next accepted message."""
        while True:
            raw = await super().recv(decode)
            await self._limit_rate()
            if isinstance(raw, str):
                await self.close(1003)
                continue  # the next call raises ConnectionClosed
            try:
                if self._accepts(_MESSAGE_DECODER.decode(raw)):
                    return raw
            except (msgspec.MsgspecError, UnicodeError, RecursionError):
                await self.close(1007)
            except RefusedError as error:
                await self.close(1008, str(error))

    def connection_lost(self, exc: Exception | None) -> None:
        """Forgets the uploads of this connection, as viser does."""
        self._uploads.forget(self)
        super().connection_lost(exc)

    def _accepts(self, message: _Message) -> bool:
        """Whether a message is passed on to viser.

        Raises:
            RefusedError: our page sends no such message.
        """
        if message.type not in ACCEPTED_TYPES:
            _log.debug("dropped a %.60s from a browser", message.type)
            return False
        self._connected |= message.type == FIRST_MESSAGE_TYPE
        if message.type == "GuiUpdateMessage" and message.updates.keys() != {"value"}:
            raise RefusedError("only values of controls can be set")
        if message.type == "FileTransferStartUpload":
            if not self._connected:
                raise RefusedError("a file can only be uploaded after the page has sent its camera")
            self._uploads.start(
                self,
                message.transfer_uuid,
                message.filename,
                size=message.size_bytes,
                parts=message.part_count,
            )
        if message.type == "FileTransferPart":
            return self._uploads.receive_part(self, message.transfer_uuid, len(message.content))
        return True

    async def _limit_rate(self) -> None:
        """Waits if messages come too fast; further ones wait at the sender meanwhile."""
        now = time.monotonic()
        self._credit = (
            min(MESSAGE_BURST, self._credit + MESSAGE_RATE * (now - self._refilled)) - 1.0
        )
        self._refilled = now
        if self._credit < 0.0:
            await asyncio.sleep(-self._credit / MESSAGE_RATE)


_PATCH_LOCK = threading.Lock()  # Held while viser's output is suppressed.


def guarded_server(listener: socket.socket, admission: Admission) -> viser.ViserServer:
    """Starts viser with checks of requests, messages and uploads.

    Args:
        listener: listens on the port; viser closes it.
        admission: decides which requests are accepted.

    Raises:
        MissingDependencyError: this version of viser opens its port without the checks.
    """
    host, port = listener.getsockname()[:2]
    with _silence_viser(), _patch_viser_serve(listener, admission) as calls:
        server = viser.ViserServer(host=host, port=port, verbose=False)
    if calls:
        _forget_uploads(server)
        return server
    stop_server(server)
    raise MissingDependencyError(
        f"viser {viser.__version__} cannot be protected from other web sites; install another"
        " version: pip install 'burg-drake[ui]'"
    )


def stop_server(server: viser.ViserServer) -> None:
    """Stops a server."""
    with _silence_viser():
        server.stop()


@contextlib.contextmanager
def _patch_viser_serve(listener: socket.socket, admission: Admission) -> Iterator[list[None]]:
    """Makes viser open its port with our checks; yields a list with one entry per opened port."""
    original = websockets.asyncio.server.serve
    calls: list[None] = []

    def serve(handler: Callable[..., Any], *place: Any, **options: Any) -> Any:
        if handler.__module__ != viser.infra._infra.__name__:
            return original(handler, *place, **options)
        calls.append(None)
        asyncio.get_running_loop().set_exception_handler(_handle_error)
        return original(
            _require_same_version(handler),
            sock=listener,
            process_request=admission.process_request,
            select_subprotocol=options["select_subprotocol"],
            compression=None,
            max_size=MAX_MESSAGE_BYTES,
            create_connection=partial(BoundedConnection, uploads=Uploads()),  # type: ignore[arg-type]
            logger=_log,
            server_header=None,
        )

    websockets.asyncio.server.serve = serve  # type: ignore[assignment, misc]
    try:
        yield calls
    finally:
        websockets.asyncio.server.serve = original  # type: ignore[misc]


def _handle_error(loop: asyncio.AbstractEventLoop, context: dict[str, Any]) -> None:
    """Reports errors, except for those raised in viser about values that no page sends."""
    error = context.get("exception")
    places = [] if error is None else [*traceback.walk_tb(error.__traceback__)]
    if places and places[-1][0].f_globals.get("__name__", "").startswith("viser."):
        _log.debug("a message could not be handled", exc_info=error)
    else:
        loop.default_exception_handler(context)


def _forget_uploads(server: viser.ViserServer) -> None:
    """Keeps viser from sending the progress of other pages' uploads to new pages."""

    def forget(client: object) -> None:
        server._websock_server.get_message_buffer().remove_from_buffer(
            lambda message: isinstance(message, FileTransferPartAck)
        )

    server._websock_server.on_client_connect(forget)


def _require_same_version(handler: Callable[[ServerConnection], Any]) -> Callable[..., Any]:
    """viser's handler, for pages of the same version only; it prints a line for each other one."""
    wanted = f"viser-v{viser.__version__}"

    async def checked(connection: ServerConnection) -> None:
        if connection.subprotocol == wanted:
            await handler(connection)
        else:
            await connection.close(1002, "The server has another version: reload this page")

    return checked


@contextlib.contextmanager
def _silence_viser() -> Iterator[None]:
    """Suppresses the output of viser only. One thread at a time."""
    with _PATCH_LOCK:
        original = rich.print

        def printed(*objects: Any, **options: Any) -> None:
            if not sys._getframe(1).f_globals.get("__name__", "").startswith("viser."):
                original(*objects, **options)

        rich.print = printed
        try:
            yield
        finally:
            rich.print = original
