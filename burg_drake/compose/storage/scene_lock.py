"""One session a scene: a lock on a file beside the scene's, which says where the session is."""

from __future__ import annotations

import contextlib
import os
from pathlib import Path

from burg_drake.core import InvalidInputError, shown
from burg_drake.core.files import try_lock


class SceneInUse(InvalidInputError):
    """A scene is open in another session.

    Attributes:
        address: of its page; empty if it has not told.
    """

    def __init__(self, message: str, address: str) -> None:
        super().__init__(message)
        self.address = address


class SceneLock:
    """A lock that its holder's end releases, however that comes about.

    Where nothing can be written there is no lock, and nothing that it would protect.
    """

    def __init__(self, scene: Path, address: str = "") -> None:
        """Takes the lock.

        Args:
            scene: the scene's file, which need not be there.
            address: of the session's page.

        Raises:
            SceneInUse: another session has it.
        """
        self.path = scene.with_name(f".{scene.name}.lock")
        self._file = _locked(self.path, scene)
        self.announce(address)

    def announce(self, address: str) -> None:
        """Says where the session's page is."""
        if self._file is not None:
            with contextlib.suppress(OSError):  # a full disk
                os.ftruncate(self._file, 0)
                os.pwrite(self._file, address.encode(), 0)

    def release(self) -> None:
        """Lets others open the scene."""
        if self._file is not None:
            with contextlib.suppress(OSError):
                self.path.unlink(missing_ok=True)
            os.close(self._file)
            self._file = None


def _locked(path: Path, scene: Path) -> int | None:
    """The descriptor of the locked file."""
    while True:
        try:
            file = os.open(path, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC | os.O_NOFOLLOW, 0o666)
        except OSError:
            return None
        try:
            locked = try_lock(file)
        except OSError:  # a file system without locks
            return file
        if not locked:
            address = os.pread(file, 200, 0).decode(errors="replace")
            os.close(file)
            where = f" at {shown(address, 200)}" if address else ""
            raise SceneInUse(
                f"{scene} is already open{where}; use it there, or close it first", address
            )
        with contextlib.suppress(OSError):
            if os.path.samestat(os.fstat(file), os.stat(path)):
                return file
        os.close(file)  # its last holder has removed it meanwhile
