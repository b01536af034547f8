"""Encodings of the parts of a sample: images as PNG, masks as run lengths, grasps as `.npz`."""

from __future__ import annotations

import io
import zipfile
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from burg_drake.core import (
    Booleans,
    Indices,
    InvalidInputError,
    NpzFile,
    Single,
    check_pose,
    report_read_errors,
)
from burg_drake.dataset.sample import LabelledGrasps

MAX_DEPTH_NUMBER = 65535
"""Largest pixel value of a depth image."""
NORMAL_OFFSET = 32768  # Pixel value of 0 in an image of normals.
NORMAL_SCALE = 32767
"""Difference of the pixel values of 1 and 0 in an image of normals."""


@dataclass(frozen=True)
class PngKind:
    """PNG format of a kind of image.

    Attributes:
        types: allowed types of the pixel values.
        channels: 1 or 3.
        strategy, filter: OpenCV's options, chosen for speed first and size second, all at level 1;
            `benchmarks/dataset_io.py` measures them. For grainy images, any strategy other than
            run lengths takes twice the time and more bytes.
    """

    types: tuple[type[np.uint8] | type[np.uint16], ...]
    channels: int
    strategy: int
    filter: int


_RLE, _UP = cv2.IMWRITE_PNG_STRATEGY_RLE, cv2.IMWRITE_PNG_FILTER_UP
_FILTERED, _NONE = cv2.IMWRITE_PNG_STRATEGY_FILTERED, cv2.IMWRITE_PNG_FILTER_NONE
_DEFAULT = cv2.IMWRITE_PNG_STRATEGY_DEFAULT

PNG_KINDS = {
    "color": PngKind((np.uint8,), 3, _RLE, _UP),
    "depth": PngKind((np.uint16,), 1, _DEFAULT, _UP),
    "labels": PngKind((np.uint8, np.uint16), 1, _FILTERED, _NONE),
    "normals": PngKind((np.uint16,), 3, _DEFAULT, _UP),
    "sensor_depth": PngKind((np.uint16,), 1, _RLE, _UP),
}
"""Kinds of images by their names in a sample and in file names."""


def encode_image(name: str, image: NDArray[Any], depth_unit: float) -> bytes:
    """Encodes an image of a sample.

    Args:
        name: a key of `PNG_KINDS`.
        image: the image, as in `Images`.
        depth_unit: unit of depth images [m].

    Raises:
        InvalidInputError: a depth is out of range, or a component of a normal exceeds 1.
    """
    kind = PNG_KINDS[name]
    if name in ("depth", "sensor_depth"):
        image = _quantize_depth(name, image, depth_unit)
    elif name == "normals":
        image = _quantize_normals(image)
    elif name == "labels":
        image = image.astype(np.uint8 if image.max(initial=0) <= 255 else np.uint16)
    options = (
        *(cv2.IMWRITE_PNG_COMPRESSION, 1),
        *(cv2.IMWRITE_PNG_STRATEGY, kind.strategy),
        *(cv2.IMWRITE_PNG_FILTER, kind.filter),
    )
    return encode_png(image, options)


def encode_png(image: NDArray[Any], options: Sequence[int] = ()) -> bytes:
    """Encodes an image as PNG, without loss.

    Args:
        image: grey values (H, W) of uint8 or uint16, or RGB (H, W, 3).
        options: OpenCV's options, as pairs of key and value.
    """
    if image.ndim == 3:
        image = cv2.cvtColor(image, cv2.COLOR_RGB2BGR)
    return bytes(cv2.imencode(".png", np.ascontiguousarray(image), options)[1].tobytes())


def decode_image_of(
    name: str, data: bytes, size: tuple[int, int], depth_unit: float, where: str
) -> NDArray[Any]:
    """Decodes an image of a sample.

    Args:
        name: a key of `PNG_KINDS`.
        data: content of the file.
        size: required width and height, checked before decoding.
        depth_unit: unit of depth images [m].
        where: shard and member, for messages.

    Raises:
        InvalidInputError: the image is truncated, damaged, of another kind or of another size.
    """
    kind = PNG_KINDS[name]
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
        pixels = (pixels.astype(np.float32) - NORMAL_OFFSET) / np.float32(NORMAL_SCALE)
    elif name == "labels":
        pixels = pixels.astype(np.uint16)
    return np.asarray(pixels)


def depth_unit_of(depth_range: tuple[float, float]) -> float:
    """Unit of 16-bit depth images for a depth range [m].

    Raises:
        InvalidInputError: the range does not fit into 16 bits.
    """
    # Metres. The first unit that can represent the farthest depth is taken.
    depth_units = (1e-4, 1e-3)
    for unit in depth_units:
        if depth_range[1] <= MAX_DEPTH_NUMBER * unit:
            return unit
    raise InvalidInputError(
        f"a depth range up to {depth_range[1]:g} m cannot be stored; the limit is"
        f" {MAX_DEPTH_NUMBER * depth_units[-1]:g} m"
    )


def _quantize_depth(name: str, depth: Single, unit: float) -> NDArray[np.uint16]:
    units: Single = np.rint(depth * np.float32(1.0 / unit))
    if not (units.min(initial=0.0) >= 0.0 and units.max(initial=0.0) <= MAX_DEPTH_NUMBER):
        raise InvalidInputError(
            f"{name.replace('_', ' ')} has values that are negative, not finite or above"
            f" {MAX_DEPTH_NUMBER * unit:g} m"
        )
    return units.astype(np.uint16)


def _quantize_normals(normals: Single) -> NDArray[np.uint16]:
    whole: Single = np.rint(normals * np.float32(NORMAL_SCALE))
    if not (whole.min(initial=0.0) >= -NORMAL_SCALE and whole.max(initial=0.0) <= NORMAL_SCALE):
        raise InvalidInputError("normals have components that are not finite or outside -1 to 1")
    return (whole + NORMAL_OFFSET).astype(np.uint16)


def _require_header(data: bytes, kind: PngKind, size: tuple[int, int], where: str) -> None:
    """Checks the header of a PNG before memory is allocated (PNG specification, 11.2.2).
    libpng compares the check sums."""
    start, end = b"\x89PNG\r\n\x1a\n\0\0\0\rIHDR", b"\0\0\0\0IEND\xaeB`\x82"
    if not data.startswith(start):
        raise InvalidInputError(f"{where} is not a PNG")
    if not data.endswith(end):
        raise InvalidInputError(f"{where} is truncated, or has data after its end")
    color_types = {1: 0, 3: 2}  # PNG colour type by number of channels.
    header = data[16:29]
    width, height = (int.from_bytes(header[i : i + 4], "big") for i in (0, 4))
    if (width, height) != size:
        raise InvalidInputError(
            f"{where} has {width} x {height} pixels, but its view has {size[0]} x {size[1]}"
        )
    bits = [8 * np.dtype(numbers).itemsize for numbers in kind.types]
    depth, color_type, *methods = header[8:13]
    if depth not in bits or color_type != color_types[kind.channels] or any(methods):
        expected = " or ".join(map(str, bits))
        raise InvalidInputError(
            f"{where} has bit depth {depth} and PNG colour type {color_type}; expected {expected}"
            f" bits and colour type {color_types[kind.channels]}"
        )


FIRST_CHARACTER = 48  # Code of the character for 0.
CHARACTER_BITS = 5  # Bits of a number per character.
CONTINUATION_BIT = 1 << CHARACTER_BITS
"""Bit of a character that is not the last of its number."""
SIGN_BIT = 1 << (CHARACTER_BITS - 1)  # Sign bit of the last character of a number.
FIRST_DIFFERENCE_RUN = 3
"""Index of the first run that is encoded as a difference."""


def encode_mask(mask: Booleans) -> str:
    """Encodes a mask as text.

    Args:
        mask: (H, W) mask.
    """
    runs = run_lengths(mask)
    steps = runs.copy()
    steps[FIRST_DIFFERENCE_RUN:] -= runs[FIRST_DIFFERENCE_RUN - 2 : -2]
    return "".join(map(_encode_number, steps.tolist()))


def decode_mask(text: str, height: int, width: int) -> NDArray[np.bool_]:
    """Decodes a mask (H, W) from text.

    Args:
        text: text that `encode_mask` wrote.
        height, width: size of the mask; the caller has to limit it.

    Raises:
        InvalidInputError: the text is no mask, or a mask of another size.
    """
    runs = _decode_runs(text)
    total, size = sum(runs), height * width
    if min(runs, default=0) < 0 or total != size:
        raise InvalidInputError(
            f"the run lengths of a mask have {total} pixels; a mask of {width} x {height} has"
            f" {size}"
        )
    mask = np.zeros((height, width), dtype=bool)
    if len(runs) < 2:
        return mask
    is_on = np.zeros(len(runs), dtype=bool)
    is_on[1::2] = True
    columns = np.repeat(is_on, runs).reshape(width, height)
    first = runs[0] // height  # all columns outside `first` to `last` are off
    last = width - (runs[-1] // height if len(runs) % 2 else 0)
    mask[:, first:last] = columns[first:last].T
    return mask


def run_lengths(mask: Booleans) -> Indices:
    """(N,) lengths of a mask's runs; the first run is of pixels that are off.

    Args:
        mask: (H, W) mask.
    """
    height, width = mask.shape
    used = np.flatnonzero(mask.any(axis=0))
    if not len(used):
        return np.array([mask.size], dtype=np.intp)
    first, last = int(used[0]), int(used[-1]) + 1  # all other columns are off
    column = np.zeros((last - first) * height + 2, dtype=bool)
    column[1:-1] = mask[:, first:last].T.ravel()
    changes = np.flatnonzero(column[1:] != column[:-1]) + first * height
    runs = np.diff(changes, prepend=0)
    rest = width * height - changes[-1]
    return np.append(runs, rest) if rest else runs


def _encode_number(number: int) -> str:
    characters = []
    while True:
        group, number = number & (CONTINUATION_BIT - 1), number >> CHARACTER_BITS
        is_last = number == (-1 if group & SIGN_BIT else 0)  # the rest follows from the sign
        characters.append(chr(FIRST_CHARACTER + (group if is_last else group | CONTINUATION_BIT)))
        if is_last:
            return "".join(characters)


def _decode_runs(text: str) -> list[int]:
    max_characters = 8  # Of a number: 40 bits.
    runs: list[int] = []
    number = shift = 0
    for character in text:
        group = ord(character) - FIRST_CHARACTER
        if not 0 <= group < 2 * CONTINUATION_BIT or shift >= CHARACTER_BITS * max_characters:
            raise InvalidInputError(
                f"the run lengths of a mask have the invalid character {character!r}"
            )
        number |= (group & (CONTINUATION_BIT - 1)) << shift
        shift += CHARACTER_BITS
        if group & CONTINUATION_BIT:
            continue
        if group & SIGN_BIT:
            number -= 1 << shift
        runs.append(number + runs[-2] if len(runs) >= FIRST_DIFFERENCE_RUN else number)
        number = shift = 0
    if shift:
        raise InvalidInputError("the run lengths of a mask end within a number")
    return runs


MARGIN_PREFIX = "margin."
"""Prefix of the names of arrays of margins."""


def encode_grasps(grasps: LabelledGrasps) -> bytes:
    """Encodes grasps as an `.npz` file with reproducible bytes."""
    timestamp = (1980, 1, 1, 0, 0, 0)  # Earliest time of the ZIP format.
    unix_system = 3  # ZIP's number of the operating system.
    # Readable by all, writable by the owner; in the upper half of the attributes.
    permissions = 0o644 << 16
    compression_level = 1  # Higher levels save nothing: outcomes shrink at any, poses at none.
    arrays: dict[str, NDArray[Any]] = {
        "X_CG": np.asarray(grasps.X_CG, dtype="<f8"),
        "width": np.asarray(grasps.width, dtype="<f8"),
        "number": np.asarray(grasps.number, dtype="<u2"),
        "outcome": np.array(grasps.outcome.tolist(), dtype="<U"),  # no wider than it has to be
    }
    for name in sorted(grasps.margins):
        arrays[MARGIN_PREFIX + name] = np.asarray(grasps.margins[name], dtype="<f8")
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w") as archive:
        for name, array in arrays.items():
            info = zipfile.ZipInfo(f"{name}.npy", timestamp)
            info.create_system, info.external_attr = unix_system, permissions
            content = io.BytesIO()
            np.lib.format.write_array(content, np.ascontiguousarray(array), allow_pickle=False)
            archive.writestr(info, content.getvalue(), zipfile.ZIP_DEFLATED, compression_level)
    return buffer.getvalue()


def decode_grasps(data: bytes, where: str) -> LabelledGrasps:
    """Decodes grasps.

    Args:
        data: content of the file.
        where: shard and member, for messages.

    Raises:
        InvalidInputError: the file is damaged, or is no file of grasps.
    """
    with (
        report_read_errors(where, "a .npz file of grasps"),
        zipfile.ZipFile(io.BytesIO(data)) as archive,
    ):
        file = NpzFile(Path(where), archive)
        poses = file.array("X_CG")
        n = poses.require_rows(4, 4)
        grasps = LabelledGrasps(
            X_CG=check_pose(poses.read("f"), "X_CG"),
            width=file.array("width").read("f", (n,)).astype(float),
            number=file.array("number").read("fiu", (n,)).astype(np.uint16),
            outcome=file.array("outcome").read("U", (n,)),
            margins={
                name.removeprefix(MARGIN_PREFIX): file.array(name).read("f", (n,)).astype(float)
                for name in file.names
                if name.startswith(MARGIN_PREFIX)
            },
        )
    return grasps


def require_fitting(grasps: LabelledGrasps, instances: int, where: str) -> None:
    """Refuses grasps whose arrays have different lengths or whose instances do not exist.

    Raises:
        InvalidInputError: lengths differ, or an instance does not exist.
    """
    if grasps.X_CG.shape != (len(grasps), 4, 4):
        raise InvalidInputError(
            f"{where}: X_CG of grasps has shape {grasps.X_CG.shape}; expected (N, 4, 4)"
        )
    columns: dict[str, NDArray[Any]] = {
        "width": grasps.width,
        "number": grasps.number,
        "outcome": grasps.outcome,
    }
    for name, column in (columns | dict(grasps.margins)).items():
        if column.shape != (len(grasps),):
            raise InvalidInputError(
                f"{where}: {name} of grasps has shape {column.shape}; expected one value for each"
                f" of the {len(grasps)} grasps"
            )
    if len(grasps) and not 1 <= grasps.number.min() <= grasps.number.max() <= instances:
        raise InvalidInputError(
            f"{where}: grasps are of instances {grasps.number.min()} to {grasps.number.max()}; the"
            f" sample has instances 1 to {instances}"
        )
