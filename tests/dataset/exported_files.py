"""Reads files of other formats by the words of their documents, and shares nothing with the
writers."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray


def read_ply(path: Path) -> tuple[dict[str, NDArray], NDArray]:
    """Properties of the vertices, and triangles, of an ASCII file."""
    head, _, body = path.read_text().partition("end_header\n")
    lines = head.splitlines()
    assert lines[:2] == ["ply", "format ascii 1.0"]
    count = int(next(x for x in lines if x.startswith("element vertex")).split()[-1])
    names = [x.split()[-1] for x in lines if x.startswith("property") and "list" not in x]
    rows = [list(map(float, x.split())) for x in body.splitlines()]
    faces = np.array(rows[count:], dtype=int)
    assert (faces[:, 0] == 3).all()
    return dict(zip(names, np.array(rows[:count]).T, strict=True)), faces[:, 1:]


def image(path: Path) -> NDArray:
    return cv2.imread(str(path), cv2.IMREAD_UNCHANGED)


def decoded(data: bytes) -> NDArray:
    return cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_UNCHANGED)


def mask_of(segmentation: dict) -> NDArray:
    """A mask from the text of its run lengths, by the words of COCO's maskApi.h."""
    counts, place = [], 0
    while place < len(segmentation["counts"]):
        number, shift, more = 0, 0, True
        while more:
            c = ord(segmentation["counts"][place]) - 48
            number |= (c & 31) << shift
            more, place, shift = bool(c & 32), place + 1, shift + 5
        if c & 16:
            number -= 1 << shift
        counts.append(number + (counts[-2] if len(counts) > 2 else 0))
    height, width = segmentation["size"]
    pixels = np.repeat(np.arange(len(counts)) % 2, counts)
    return pixels.reshape(width, height).T.astype(bool)
