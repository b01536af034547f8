"""Images of a sample as PNG, and back.

Depth is kept in whole units, which follow from the depth range of the view; 0 is none. Normals have
16 bits for each component: 32768 is 0, and 1 is 32767 above it, so that a component is off by
1.6e-5 at most, and a normal by 0.002 degrees. Colours and labels are kept as they are.
"""

from __future__ import annotations

import zlib
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from burg_drake.core import InvalidInputError, Single

Pixels = NDArray[np.uint8] | NDArray[np.uint16]

SIGNATURE = b"\x89PNG\r\n\x1a\n"
HEADER_CHUNK = b"IHDR"
CHUNKS = (HEADER_CHUNK, b"IDAT", b"IEND")
"""All that these files have."""
COLOR_TYPES = {1: 0, 3: 2}
"""Of PNG, by the number of channels."""

DEPTH_UNITS = (1e-4, 1e-3)
"""That depth is kept in [m]: the first that reaches as far as the view does."""
LARGEST_DEPTH = 65535
"""Units."""
ZERO_NORMAL = 32768
ONE_NORMAL = 32767
"""Above `ZERO_NORMAL`."""


@dataclass(frozen=True)
class PngKind:
    """What a kind of image is as PNG.

    Attributes:
        types: of its numbers, one of them.
        channels: 1, or 3.
        strategy, filter: OpenCV's options, chosen for time first and bytes second, all at level 1;
            `benchmarks/dataset_io.py` measures them. Where there is grain, looking for anything but
            runs takes twice the time and more bytes.
    """

    types: tuple[type[np.uint8] | type[np.uint16], ...]
    channels: int
    strategy: int
    filter: int


KINDS = {
    "color": PngKind((np.uint8,), 3, cv2.IMWRITE_PNG_STRATEGY_RLE, cv2.IMWRITE_PNG_FILTER_UP),
    "depth": PngKind((np.uint16,), 1, cv2.IMWRITE_PNG_STRATEGY_DEFAULT, cv2.IMWRITE_PNG_FILTER_UP),
    "labels": PngKind(
        (np.uint8, np.uint16),
        1,
        cv2.IMWRITE_PNG_STRATEGY_FILTERED,
        cv2.IMWRITE_PNG_FILTER_NONE,
    ),
    "normals": PngKind(
        (np.uint16,), 3, cv2.IMWRITE_PNG_STRATEGY_DEFAULT, cv2.IMWRITE_PNG_FILTER_UP
    ),
    "sensor_depth": PngKind(
        (np.uint16,), 1, cv2.IMWRITE_PNG_STRATEGY_RLE, cv2.IMWRITE_PNG_FILTER_UP
    ),
}
"""By the name that it has in a sample and in the names of its files."""


def encode_image(name: str, image: NDArray[Any], depth_unit: float) -> bytes:
    """The file of an image.

    Args:
        name: a key of `KINDS`.
        image: as a sample has it.
        depth_unit: of depth [m].

    Raises:
        InvalidInputError: depth that cannot be kept, or normals beyond 1.
    """
    kind = KINDS[name]
    if name in ("depth", "sensor_depth"):
        image = _in_units(name, image, depth_unit)
    elif name == "normals":
        image = _whole_normals(image)
    elif name == "labels":
        image = image.astype(np.uint8 if image.max(initial=0) <= 255 else np.uint16)
    options = (
        *(cv2.IMWRITE_PNG_COMPRESSION, 1),
        *(cv2.IMWRITE_PNG_STRATEGY, kind.strategy),
        *(cv2.IMWRITE_PNG_FILTER, kind.filter),
    )
    return encode_png(image, options)


def encode_png(image: NDArray[Any], options: Sequence[int] = ()) -> bytes:
    """Numbers as PNG, without loss.

    Args:
        image: (H, W) of uint8 or uint16, or RGB (H, W, 3).
        options: OpenCV's, in pairs.
    """
    if image.ndim == 3:
        image = cv2.cvtColor(image, cv2.COLOR_RGB2BGR)
    return bytes(cv2.imencode(".png", np.ascontiguousarray(image), options)[1].tobytes())


def decode_image_of(
    name: str, data: bytes, size: tuple[int, int], depth_unit: float, where: str
) -> NDArray[Any]:
    """The image of a file, as a sample has it.

    Args:
        name: a key of `KINDS`.
        data: of the file.
        size: width and height that it has to have; nothing is decoded of another one.
        depth_unit: of depth [m].
        where: shard and member, for messages.

    Raises:
        InvalidInputError: it is cut off, damaged, of another kind or of another size.
    """
    kind = KINDS[name]
    _require_whole(data, where)
    _require_header(data, kind, size, where)
    try:
        pixels = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_UNCHANGED)
    except cv2.error:
        pixels = None
    shape = (size[1], size[0], 3)[: 3 if kind.channels == 3 else 2]
    if pixels is None or pixels.shape != shape:
        raise InvalidInputError(f"{where} is damaged: its pixels cannot be decoded")
    if kind.channels == 3:
        pixels = cv2.cvtColor(pixels, cv2.COLOR_BGR2RGB)
    if name in ("depth", "sensor_depth"):
        pixels = pixels.astype(np.float32) * np.float32(depth_unit)
    elif name == "normals":
        pixels = (pixels.astype(np.float32) - ZERO_NORMAL) / np.float32(ONE_NORMAL)
    elif name == "labels":
        pixels = pixels.astype(np.uint16)
    return np.asarray(pixels)


def depth_unit_of(depth_range: tuple[float, float]) -> float:
    """The unit that depth in this range is kept in [m].

    Raises:
        InvalidInputError: the range reaches farther than 16 bits do.
    """
    for unit in DEPTH_UNITS:
        if depth_range[1] <= LARGEST_DEPTH * unit:
            return unit
    raise InvalidInputError(
        f"a depth range up to {depth_range[1]:g} m cannot be stored; the limit is"
        f" {LARGEST_DEPTH * DEPTH_UNITS[-1]:g} m"
    )


def _in_units(name: str, depth: Single, unit: float) -> NDArray[np.uint16]:
    units: Single = np.rint(depth * np.float32(1.0 / unit))
    if not (units.min(initial=0.0) >= 0.0 and units.max(initial=0.0) <= LARGEST_DEPTH):
        raise InvalidInputError(
            f"{name.replace('_', ' ')} has values that are negative, not finite or above"
            f" {LARGEST_DEPTH * unit:g} m"
        )
    return units.astype(np.uint16)


def _whole_normals(normals: Single) -> NDArray[np.uint16]:
    whole: Single = np.rint(normals * np.float32(ONE_NORMAL))
    if not (whole.min(initial=0.0) >= -ONE_NORMAL and whole.max(initial=0.0) <= ONE_NORMAL):
        raise InvalidInputError("normals have components that are not finite or outside -1 to 1")
    return (whole + ZERO_NORMAL).astype(np.uint16)


def _require_whole(data: bytes, where: str) -> None:
    """Walks over the chunks and their check sums (PNG specification, 5.3)."""
    if not data.startswith(SIGNATURE):
        raise InvalidInputError(f"{where} is not a PNG")
    at, found = len(SIGNATURE), [b""]
    while at + 12 <= len(data) and found[-1] != CHUNKS[-1]:
        length = int.from_bytes(data[at : at + 4], "big")
        kind, end = data[at + 4 : at + 8], at + 8 + length
        if kind not in CHUNKS or (kind == HEADER_CHUNK) != (len(found) == 1):
            raise InvalidInputError(f"{where} is damaged: chunk {kind!r} is in the wrong place")
        sum_ = int.from_bytes(data[end : end + 4], "big")
        if end + 4 > len(data):
            break
        if zlib.crc32(memoryview(data)[at + 4 : end]) != sum_:
            raise InvalidInputError(f"{where} is damaged: a checksum is wrong")
        found.append(kind)
        at = end + 4
    if found[-1] != CHUNKS[-1] or at != len(data):
        raise InvalidInputError(f"{where} is truncated, or has data after its end")


def _require_header(data: bytes, kind: PngKind, size: tuple[int, int], where: str) -> None:
    """Compares what is announced, before anything of that size is made (specification, 11.2.2)."""
    header = data[16:29]
    width, height = (int.from_bytes(header[i : i + 4], "big") for i in (0, 4))
    if (width, height) != size:
        raise InvalidInputError(
            f"{where} has {width} x {height} pixels, but its view has {size[0]} x {size[1]}"
        )
    bits = [8 * np.dtype(numbers).itemsize for numbers in kind.types]
    depth, color_type, *methods = header[8:13]
    if depth not in bits or color_type != COLOR_TYPES[kind.channels] or any(methods):
        expected = " or ".join(map(str, bits))
        raise InvalidInputError(
            f"{where} has bit depth {depth} and PNG colour type {color_type}; expected {expected}"
            f" bits and colour type {COLOR_TYPES[kind.channels]}"
        )
