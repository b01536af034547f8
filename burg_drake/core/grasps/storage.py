"""Files of a `GraspSet`: `.npz` of numpy, and `.h5` for readers in any language.

Both hold the same: a header (format, version, provenance as JSON), the columns that every set has,
and further columns. In HDF5 these are attributes of the root (`format`, `version`, `provenance`),
datasets `X_OG`, `width`, `id`, `object`, `score`, and datasets of the group `columns`. A dataset's
attributes say its `unit` and `description`, see `core.grasps.column_meanings`. Paths in the
provenance are relative to the file, and absolute again once it is read.
"""

from __future__ import annotations

import io
import json
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from burg_drake.core.documents import parse_json
from burg_drake.core.errors import InvalidInputError, listing
from burg_drake.core.files import (
    DOCUMENT,
    NUMBERS,
    StoredArray,
    atomic_write,
    is_hdf5,
    open_hdf5,
    open_npz,
)
from burg_drake.core.grasps.column_meanings import describe
from burg_drake.core.paths import with_resolved_references, with_shareable_references

FORMAT = "burg_drake.grasps"
VERSION = 2
READABLE = (1, 2)
"""Version 1 had no further columns."""

FIXED_COLUMNS = ("width", "id", "object", "score")
"""Columns that every set has."""
FIXED = ("X_OG", *FIXED_COLUMNS)
"""Arrays that every set has."""
TEXT = ("id", "object")
PREFIX = "column:"
"""Of the names of further columns in `.npz`."""

SetColumns = dict[str, NDArray[Any]]


def write_arrays(
    path: str | Path, provenance: Mapping[str, Any], fixed: SetColumns, columns: SetColumns
) -> None:
    """Writes a set of N grasps; see `GraspSet.save`.

    Args:
        path: ends in `.npz` or `.h5`.
        provenance: JSON values.
        fixed: the arrays of `FIXED`: (N, 4, 4) poses, and (N,) each of the others.
        columns: (N,) further values by name.

    Raises:
        InvalidInputError: another suffix, or the place cannot be written to.
    """
    suffix = Path(path).suffix.lower()
    if suffix not in (".npz", ".h5", ".hdf5"):
        raise InvalidInputError(f"{path} ends in {suffix!r}; give a name that ends in .npz or .h5")
    shareable = with_shareable_references(provenance, Path(path).absolute().parent)
    header = {"format": FORMAT, "version": VERSION, "provenance": shareable}
    write = _npz if suffix == ".npz" else _hdf5
    atomic_write(path, write(header, fixed, columns))


def read_arrays(path: Path) -> tuple[dict[str, Any], SetColumns, SetColumns]:
    """Provenance, fixed arrays and further columns, as `write_arrays` takes them.

    Raises:
        ValueError: or another of `core.files.READ_ERRORS`, where the file is not as it was written.
        InvalidInputError: a file of another format or of a newer version.
    """
    header, fixed, columns = (_read_hdf5 if is_hdf5(path) else _read_npz)(path)
    if not isinstance(header["provenance"], dict):
        raise ValueError("its provenance is not a mapping")
    provenance = with_resolved_references(header["provenance"], path.absolute().parent)
    return provenance, fixed, columns


def _check(path: Path, header: dict[str, Any]) -> None:
    if header["format"] != FORMAT or header["version"] not in READABLE:
        raise InvalidInputError(
            f"{path} is a file of format {header['format']!r}, version "
            f"{header['version']!r}; this release reads {FORMAT!r} version "
            f"{' and '.join(map(str, READABLE))}"
        )


def _read_arrays(
    array: Callable[[str], StoredArray], further: dict[str, str]
) -> tuple[SetColumns, SetColumns]:
    """The columns that every set has, and further ones.

    Args:
        array: what a file says of an array by its name.
        further: names of arrays by names of columns.
    """
    for name in {*FIXED_COLUMNS, ""} & set(further):
        raise ValueError(f"it has a further column {name!r}, which must not be called that")
    poses = array("X_OG")
    n = poses.rows(4, 4)
    fixed = {"X_OG": poses.read("f").astype(float)}
    for name in FIXED[1:]:
        values = array(name).read("U" if name in TEXT else "f", (n,))
        fixed[name] = values if name in TEXT else values.astype(float)
    columns = {name: array(key).read(NUMBERS + "U", (n,)) for name, key in further.items()}
    return fixed, columns


def _npz(header: dict[str, Any], fixed: SetColumns, columns: SetColumns) -> bytes:
    buffer = io.BytesIO()
    further = {PREFIX + name: values for name, values in columns.items()}
    arrays: dict[str, Any] = {"header": np.array(json.dumps(header)), **fixed, **further}
    np.savez_compressed(buffer, **arrays)
    return buffer.getvalue()


def _read_npz(path: Path) -> tuple[dict[str, Any], SetColumns, SetColumns]:
    with open_npz(path) as file:
        if "header" not in file.names:
            raise InvalidInputError(
                f"{path} is not a grasp set: it has no array 'header', only {listing(file.names)};"
                " write it with GraspSet.create(X_OG, object=NAME).save(FILE), where X_OG has shape"
                " (N, 4, 4); a plain .npy of that shape is read as poses of BURG-Toolkit"
            )
        stored = file.array("header")
        if stored.itemsize > 4 * DOCUMENT.size:
            raise ValueError("its header is too long")
        header = parse_json(str(stored.read("U", ())), f"{path}: header")
        _check(path, header)
        further = {n.removeprefix(PREFIX): n for n in file.names if n.startswith(PREFIX)}
        return header, *_read_arrays(file.array, further)


def _hdf5(header: dict[str, Any], fixed: SetColumns, columns: SetColumns) -> bytes:
    import h5py

    buffer = io.BytesIO()
    with h5py.File(buffer, "w") as file:
        file.attrs.update(format=FORMAT, version=VERSION)
        file.attrs["provenance"] = json.dumps(header["provenance"])
        for name, values in fixed.items():
            _write_dataset(file, name, values)
        further = file.create_group("columns", track_order=True)
        for name, values in columns.items():
            if "/" in name or name in (".", ""):
                raise InvalidInputError(
                    f"HDF5 cannot have a column called {name!r}; rename it, or write .npz"
                )
            _write_dataset(further, name, values)
    return buffer.getvalue()


def _write_dataset(group: Any, name: str, values: NDArray[Any]) -> None:
    """Text becomes UTF-8 of fixed length, whose size a reader knows before it reads it; everything
    is compressed without loss."""
    import h5py

    packed = {"compression": "gzip", "shuffle": True} if values.size else {}
    if values.dtype.kind == "U":
        encoded = np.char.encode(values, "utf-8")
        type = h5py.string_dtype("utf-8", max(1, encoded.dtype.itemsize))
        data = group.create_dataset(name, data=encoded.astype(type), dtype=type, **packed)
    else:
        data = group.create_dataset(name, data=values, **packed)
    if (column := describe(name)) is not None:
        data.attrs.update(unit=column.unit, description=column.description)


def _read_hdf5(path: Path) -> tuple[dict[str, Any], SetColumns, SetColumns]:
    with open_hdf5(path) as file:
        version = int(file.attribute("version"))
        header: dict[str, Any] = {"format": str(file.attribute("format")), "version": version}
        _check(path, header)
        provenance = str(file.attribute("provenance"))
        header["provenance"] = parse_json(provenance, f"{path}: provenance")
        further = {name: f"columns/{name}" for name in file.names("columns")}
        return header, *_read_arrays(file.array, further)
