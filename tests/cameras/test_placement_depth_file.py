"""Depth images from files, in metres whatever they are written in."""

from __future__ import annotations

import struct
import zlib
from pathlib import Path

import cv2
import numpy as np
import pytest

from burg_drake.cameras import decode_image, read_depth, read_image
from burg_drake.core import InvalidInputError

METRES = np.array([[0.5, 0.75], [0.0, 1.25]])


def test_millimetres_and_metres_are_told_by_type(tmp_path: Path) -> None:
    cv2.imwrite(str(tmp_path / "d.png"), (METRES * 1000).astype(np.uint16))
    np.save(tmp_path / "whole.npy", (METRES * 1000).astype(np.uint16))
    np.save(tmp_path / "metres.npy", np.where(METRES > 0, METRES, np.nan))
    for name in ("d.png", "whole.npy", "metres.npy"):
        np.testing.assert_allclose(read_depth(tmp_path / name), METRES, rtol=1e-6)
    np.testing.assert_allclose(read_depth(tmp_path / "d.png", 1e-4), METRES / 10, rtol=1e-6)


def test_what_is_not_depth_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InvalidInputError, match=r"no\.png does not exist"):
        read_depth(tmp_path / "no.png")
    (tmp_path / "text.npy").write_text("hello")
    with pytest.raises(InvalidInputError, match=r"text\.npy is not a \.npy file"):
        read_depth(tmp_path / "text.npy")
    (tmp_path / "text.png").write_text("hello")
    with pytest.raises(InvalidInputError, match=r"text\.png cannot be read as"):
        read_depth(tmp_path / "text.png")
    cv2.imwrite(str(tmp_path / "color.png"), np.zeros((4, 4, 3), np.uint8))
    with pytest.raises(InvalidInputError, match=r"color.png.*\(4, 4, 3\)"):
        read_depth(tmp_path / "color.png")


@pytest.mark.parametrize("side", [17_000, 60_000])
def test_large_images_of_small_files_are_not_decoded(tmp_path: Path, side: int) -> None:
    """A PNG whose pixels, all black, would take up to 7 GB."""
    chunks = [(b"IHDR", struct.pack(">IIBBBBB", side, 4, 16, 0, 0, 0, 0))]
    if side > 20_000:
        chunks = [(b"IHDR", struct.pack(">IIBBBBB", side, side, 16, 0, 0, 0, 0))]
    chunks += [(b"IDAT", zlib.compress(bytes(side))), (b"IEND", b"")]
    data = b"\x89PNG\r\n\x1a\n" + b"".join(
        struct.pack(">I", len(body)) + kind + body + struct.pack(">I", zlib.crc32(kind + body))
        for kind, body in chunks
    )
    path = tmp_path / "large.png"
    path.write_bytes(data)
    said = "has 17,000 x 4 pixels; a side" if side < 20_000 else "has more than 179 million pixels"
    for read in (read_depth, read_image):
        with pytest.raises(InvalidInputError, match=f"image {path} {said}") as error:
            read(path)
        assert "16,384" in str(error.value) and "\n" not in str(error.value)
    assert decode_image(data) is None
