"""Hashes and random generators that follow from content, never from order or time."""

from __future__ import annotations

import hashlib
from pathlib import Path
from typing import Any

import numpy as np

from burg_drake.core.files import open_regular


def content_hash(*parts: Any) -> str:
    """SHA-256 over a sequence of parts, each with its type and length, so that parts cannot run
    into each other.

    Args:
        parts: `str`, `bytes`, `int`, `float`, `bool`, `None`, `numpy.ndarray`, `Path` (the file's
            bytes are hashed, not its name) or nested lists, tuples and dicts (by sorted key).

    Returns:
        64 hexadecimal digits.
    """
    digest = hashlib.sha256()
    for part in parts:
        _update(digest, part)
    return digest.hexdigest()


def rng_from(*parts: Any) -> np.random.Generator:
    """Random generator seeded by content: the same parts give the same stream everywhere."""
    return np.random.default_rng(int(content_hash(*parts)[:32], 16))


def _update(digest: Any, part: Any) -> None:
    if isinstance(part, Path):
        with open_regular(part) as stream:
            tag, data = "file", stream.read()
    elif isinstance(part, np.ndarray) and not part.dtype.hasobject:
        array = np.ascontiguousarray(part)
        tag, data = f"array{array.dtype.str}{array.shape}", array.tobytes()
    elif isinstance(part, dict):
        digest.update(f"dict{len(part)}:".encode())
        for key in sorted(part):
            _update(digest, key)
            _update(digest, part[key])
        return
    elif isinstance(part, (list, tuple)):
        digest.update(f"list{len(part)}:".encode())
        for item in part:
            _update(digest, item)
        return
    elif isinstance(part, bytes):
        tag, data = "bytes", part
    elif part is None or isinstance(part, (str, bool, int, float, np.generic)):
        value = part.item() if isinstance(part, np.generic) else part
        tag, data = type(value).__name__, repr(value).encode()
    else:
        raise TypeError(f"cannot hash a {type(part).__name__}")
    digest.update(f"{tag}{len(data)}:".encode())
    digest.update(data)
