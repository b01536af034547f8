"""A process that renders pictures of objects, so that the page never waits for a renderer."""

from __future__ import annotations

import contextlib
from multiprocessing.connection import Connection
from typing import Any

from burg_drake.core import BurgError


def main(handle: int) -> None:
    """Answers requests (folder of a library, object, stable pose, size) until the pipe is closed:
    with a PNG, or with a line that says why there is none."""
    connection: Connection[Any, Any] = Connection(handle)
    with contextlib.suppress(EOFError, OSError):
        while True:
            connection.send(_answer(*connection.recv()))


def _answer(
    root: str, name: str, stable_pose: int | None, size: tuple[int, int]
) -> tuple[bytes | None, str]:
    from burg_drake.objects.library import load_library
    from burg_drake.visualization.pictures import ObjectRenderer

    try:
        renderer = ObjectRenderer(load_library(root), [name])
        return renderer.portrait(name, size, stable_pose=stable_pose).png(), ""
    except BurgError as error:
        return None, str(error)
