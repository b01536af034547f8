"""Files on their way from browsers: how large they may be, each and all together.

A browser says how large a file is before it sends it, so that one that is too large costs nothing.
"""

from __future__ import annotations

from dataclasses import dataclass

LARGEST_UPLOAD = 32 << 20
"""[bytes]; a photo of a board has a few million."""
ALL_UPLOADS = 64 << 20
"""Of all files that are on their way [bytes]."""
MOST_UPLOADS = 16
SMALLEST_PART = 64 << 10
"""Of all parts but the last [bytes]; viser's page sends 512 KiB."""
LONGEST_NAME = 255


class RefusedError(Exception):
    """A browser sent what no page sends; its connection is closed with this reason."""


@dataclass
class _Transfer:
    """A file on its way.

    Attributes:
        owner: the connection that it comes by.
        size: that was announced [bytes].
        bytes_left: likewise, that are still to come.
        parts_left: likewise.
    """

    owner: object
    size: int
    bytes_left: int
    parts_left: int


class Uploads:
    """Keeps count of all files on their way to a server; used in the server's thread alone."""

    def __init__(self) -> None:
        self._transfers: dict[str, _Transfer] = {}

    def start(self, owner: object, key: str, name: str, *, size: int, parts: int) -> None:
        """A file is announced.

        Args:
            owner: the connection.
            key: of the transfer, chosen by the browser.
            name: of the file.
            size: of it [bytes].
            parts: in how many parts it comes.

        Raises:
            RefusedError: it is too large, or no page announces files like that.
        """
        if not 0 <= size <= LARGEST_UPLOAD:
            raise RefusedError(
                f"a file of {size} bytes is refused; at most {LARGEST_UPLOAD} bytes are allowed"
            )
        if not (size > 0) <= parts <= -(-size // SMALLEST_PART):
            raise RefusedError(f"a file in {parts} parts is refused")
        if len(name) > LONGEST_NAME or name in ("", ".", "..") or {*name} & {*"/\\\0"}:
            raise RefusedError("the file name is not allowed")
        if key in self._transfers or len(self._transfers) >= MOST_UPLOADS:
            raise RefusedError("too many files are uploaded at once")
        if size + sum(transfer.size for transfer in self._transfers.values()) > ALL_UPLOADS:
            raise RefusedError("the files uploaded at once are too large")
        if parts:
            self._transfers[key] = _Transfer(owner, size, size, parts)

    def take(self, owner: object, key: str, size: int) -> bool:
        """A part of a file comes.

        Returns:
            False if this connection announced no such file, as after it was refused.

        Raises:
            RefusedError: there is more than was announced.
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
        """A connection is gone, and what it was sending with it."""
        self._transfers = {
            key: transfer
            for key, transfer in self._transfers.items()
            if transfer.owner is not owner
        }
