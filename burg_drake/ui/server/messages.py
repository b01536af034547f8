"""What browsers send to viser, looked at message by message before viser spends memory on it.

viser keeps whatever is sent until it is complete, opens a public tunnel to the page for whoever
asks, and sets any attribute of a control that a message names. Honest pages need none of that.
"""

from __future__ import annotations

import asyncio
import logging
import time
from typing import Any

import msgspec
from websockets.asyncio.server import ServerConnection

from burg_drake.ui.server.uploads import RefusedError, Uploads

LARGEST_MESSAGE = 1 << 20
"""[bytes]; the parts of an upload are half as large."""
RATE, BURST = 200.0, 400.0
"""Messages a second in the long run and at once; a drag sends 50 a second."""
CONNECTED = "ViewerCameraMessage"
"""What a page sends first; only who has sent it is missed by viser when gone, uploads included."""
TYPES = frozenset(
    {
        CONNECTED,
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
"""Let through. Of what viser's page can send that leaves out forms, whose messages viser keeps for
ever, rendered pictures, which are too large, and sharing by a public tunnel."""
UNSUPPORTED, MALFORMED, REFUSED = 1003, 1007, 1008
"""Codes by which a websocket is closed [RFC 6455, 7.4.1]."""
_LOG = logging.getLogger(__name__)


class _Message(msgspec.Struct):
    """What decides about a message; the rest is viser's to read."""

    type: str
    transfer_uuid: str = ""
    filename: str = ""
    size_bytes: int = 0
    part_count: int = 0
    content: bytes = b""
    updates: dict[str, msgspec.Raw] = {}


_DECODER = msgspec.msgpack.Decoder(_Message)


class BoundedConnection(ServerConnection):
    """A connection whose messages are paced and looked at; who sends what no page does, is out.

    Args:
        uploads: of all connections.
    """

    def __init__(self, *arguments: Any, uploads: Uploads, **options: Any) -> None:
        super().__init__(*arguments, **options)
        self._uploads = uploads
        self._connected = False
        self._credit, self._paced = BURST, time.monotonic()

    async def recv(self, decode: bool | None = None) -> Any:
        """The next message that is let through."""
        while True:
            raw = await super().recv(decode)
            await self._pace()
            if isinstance(raw, str):
                await self.close(UNSUPPORTED)
                continue  # which raises that the connection is closed
            try:
                if self._is_let_through(_DECODER.decode(raw)):
                    return raw
            except (msgspec.MsgspecError, UnicodeError, RecursionError):
                await self.close(MALFORMED)
            except RefusedError as error:
                await self.close(REFUSED, str(error))

    def connection_lost(self, exc: Exception | None) -> None:
        """Forgets the uploads of this connection, as viser does."""
        self._uploads.forget(self)
        super().connection_lost(exc)

    def _is_let_through(self, message: _Message) -> bool:
        """Whether viser gets a message.

        Raises:
            RefusedError: no page sends that.
        """
        if message.type not in TYPES:
            _LOG.debug("dropped a %.60s from a browser", message.type)
            return False
        self._connected |= message.type == CONNECTED
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
            return self._uploads.take(self, message.transfer_uuid, len(message.content))
        return True

    async def _pace(self) -> None:
        """Waits if messages come too fast; what else is sent waits with the sender meanwhile."""
        now = time.monotonic()
        self._credit = min(BURST, self._credit + RATE * (now - self._paced)) - 1.0
        self._paced = now
        if self._credit < 0.0:
            await asyncio.sleep(-self._credit / RATE)
