"""What a saved page shows when it is opened, found out from what is written in it alone."""

from __future__ import annotations

import base64
import re
import struct

import numpy as np

VIEWS = [(968, 800), (488, 600), (390, 464), (1280, 800), (800, 600)]
"""Views in pixels: of pages in windows of 1280 x 800, 800 x 600 and 390 x 844, beside or above a
panel; and live ones, without a panel, in the first two."""


def messages(page: str) -> list[bytes]:
    """What the page tells the viewer, in order."""
    found = re.findall(r"octet-binary;base64,([A-Za-z0-9+/=]+)", page)
    return [base64.b64decode(part) for part in found]


def eye(page: str) -> tuple[np.ndarray, np.ndarray, float]:
    """Place of the eye and what it looks at (3,), in the world [m], and the vertical angle of
    view [rad]; the viewer has y up, z towards our -y."""
    position = target = fov = None
    for message in messages(page):
        if b"rotated/<object>" in message and b"position" in message:
            position = np.array(_doubles(message, 3))
        elif b"rotated/<object>" in message and b"\xa3fov" in message:
            (fov,) = _doubles(message, 1)
        elif b"set_target" in message:
            target = np.array(_doubles(message, 3))
    assert position is not None and target is not None and fov is not None
    R_WV = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])
    return R_WV @ position, R_WV @ target, float(np.deg2rad(fov))


def placed(page: str, path: str) -> np.ndarray:
    """(4, 4) where what has a path was put last, in its parent, which is the world."""
    said = b"set_transform\xa4path\xd9" + bytes([len(path)]) + path.encode() + b"\xa6matrix"
    (*_, last) = (message for message in messages(page) if said in message)
    return np.reshape(_doubles(last, 16), (4, 4)).T


def in_view(page: str, p_WQ: np.ndarray, view: tuple[int, int]) -> np.ndarray:
    """(N, 2) image points of points (N, 3); between -1 and 1 they are in a view [pixel].

    A page makes the angle of view wider, by tangents, in views that are narrower than 1.2.
    """
    p_WC, p_WT, fov = eye(page)
    p = np.asarray(p_WQ) - p_WC
    forward = (p_WT - p_WC) / np.linalg.norm(p_WT - p_WC)
    right = np.cross(forward, (0.0, 0.0, 1.0))
    right /= np.linalg.norm(right)
    up = np.cross(right, forward)
    depth = p @ forward
    assert (depth > 0.0).all()
    aspect = view[0] / view[1]
    half = np.tan(fov / 2.0) / min(1.0, aspect / 1.2)
    return np.stack([p @ right / depth / half / aspect, p @ up / depth / half], axis=1)


def _doubles(message: bytes, count: int) -> tuple[float, ...]:
    """The last numbers of a message; msgpack has them as 0xCB and eight bytes."""
    return tuple(v for _, v in struct.iter_unpack(">Bd", message[-9 * count :]))
