"""Numpy's `.npy` files of numbers, as several projects keep grasps in them."""

from __future__ import annotations

import io
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from burg_drake.core.damaged import DAMAGED, reason, without_warnings
from burg_drake.core.errors import InvalidInputError
from burg_drake.core.files import atomic_write

HEADERS = {
    (1, 0): np.lib.format.read_array_header_1_0,
    (2, 0): np.lib.format.read_array_header_2_0,
}
"""Readers by version of the file; version 3.0 is for records, which hold no grasps."""


def npy_shape(path: Path) -> tuple[int, ...] | None:
    """Shape of the numbers in a `.npy` file, from its header; None for anything else."""
    try:
        with path.open("rb") as stream, without_warnings():
            shape, _, dtype = HEADERS[np.lib.format.read_magic(stream)](stream)
    except (OSError, *DAMAGED):
        return None
    return shape if dtype.kind in "fiu" else None


def read_npy(path: Path) -> NDArray[np.float64]:
    """The numbers in a `.npy` file, in double precision.

    Raises:
        InvalidInputError: the file cannot be read, is cut off, or holds something else.
    """
    try:
        with path.open("rb") as stream, without_warnings():
            values = np.lib.format.read_array(stream, allow_pickle=False)
    except OSError as error:
        raise InvalidInputError(f"cannot read {path}: {error.strerror or error}") from error
    except DAMAGED as error:
        raise InvalidInputError(f"{path} is not a .npy file of numbers: {reason(error)}") from error
    if values.dtype.kind not in "fiu":
        raise InvalidInputError(f"{path} has values of type {values.dtype}; expected numbers")
    return values.astype(np.float64)


def write_npy(path: Path, values: NDArray[Any]) -> None:
    """Writes a `.npy` file, whole or not at all."""
    buffer = io.BytesIO()
    np.save(buffer, values, allow_pickle=False)
    atomic_write(path, buffer.getvalue())
