"""Files of a `GraspSet`: `.npz` of numpy, and `.h5` for readers in any language.

Both hold the same: a header (format, version, provenance as JSON), the columns that every set has,
and further columns. In HDF5 these are attributes of the root (`format`, `version`, `provenance`),
datasets `X_OG`, `width`, `id`, `object`, `score`, and datasets of the group `columns`.
"""

from __future__ import annotations

import io
import json
import zipfile
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from burg_drake.core.damaged import DAMAGED, reason, without_warnings
from burg_drake.core.errors import InvalidInputError
from burg_drake.core.files import atomic_write
from burg_drake.core.grasps import GraspSet

FORMAT = "burg_drake.grasps"
VERSION = 2
READABLE = (1, 2)
"""Version 1 had no further columns."""

FIXED = ("X_OG", "width", "id", "object", "score")
TEXT = ("id", "object")
PREFIX = "column:"
"""Of the names of further columns in `.npz`."""

HDF5_SIGNATURE = b"\x89HDF\r\n\x1a\n"

Columns = dict[str, NDArray[Any]]


def save_grasps(grasps: GraspSet, path: str | Path) -> None:
    """See `GraspSet.save`."""
    suffix = Path(path).suffix.lower()
    if suffix not in (".npz", ".h5", ".hdf5"):
        raise InvalidInputError(f"{path} ends in {suffix!r}; give a name that ends in .npz or .h5")
    header = {"format": FORMAT, "version": VERSION, "provenance": dict(grasps.provenance)}
    fixed = {name: getattr(grasps, name) for name in FIXED}
    write = _npz if suffix == ".npz" else _hdf5
    atomic_write(path, write(header, fixed, dict(grasps.columns)))


def load_grasps(path: str | Path) -> GraspSet:
    """See `GraspSet.load`."""
    try:
        with open(path, "rb") as stream:
            is_hdf5 = stream.read(len(HDF5_SIGNATURE)) == HDF5_SIGNATURE
        read = _read_hdf5 if is_hdf5 else _read_npz
        with without_warnings():
            header, fixed, columns = read(Path(path))
            _check_types(header, fixed)
            return GraspSet(**fixed, provenance=header["provenance"], columns=columns)
    except InvalidInputError:
        raise
    except OSError as error:
        raise InvalidInputError(f"cannot read {path}: {error.strerror or error}") from error
    except DAMAGED as error:
        raise InvalidInputError(
            f"{path} is not a grasp set written by burg_drake: {reason(error)}"
        ) from error


def _check(path: Path, header: dict[str, Any]) -> None:
    if header["format"] != FORMAT or header["version"] not in READABLE:
        raise InvalidInputError(
            f"{path} has format {header['format']!r} version {header['version']!r};"
            f" this release reads {FORMAT!r} version {' and '.join(map(str, READABLE))}"
        )


def _check_types(header: dict[str, Any], fixed: Columns) -> None:
    if not isinstance(header["provenance"], dict):
        raise ValueError("its provenance is no mapping")
    for name, values in fixed.items():
        if values.dtype.kind != ("U" if name in TEXT else "f"):
            raise ValueError(f"{name} has values of type {values.dtype}")


def _npz(header: dict[str, Any], fixed: Columns, columns: Columns) -> bytes:
    buffer = io.BytesIO()
    further = {PREFIX + name: values for name, values in columns.items()}
    arrays: dict[str, Any] = {"header": np.array(json.dumps(header)), **fixed, **further}
    np.savez_compressed(buffer, **arrays)
    return buffer.getvalue()


def _read_npz(path: Path) -> tuple[dict[str, Any], Columns, Columns]:
    with zipfile.ZipFile(path):  # np.load takes other kinds of file as well
        pass
    with np.load(path, allow_pickle=False) as data:
        header = json.loads(str(data["header"]))
        _check(path, header)
        names = [name for name in data.files if name.startswith(PREFIX)]
        columns = {name.removeprefix(PREFIX): data[name] for name in names}
        return header, {name: data[name] for name in FIXED}, columns


def _hdf5(header: dict[str, Any], fixed: Columns, columns: Columns) -> bytes:
    import h5py

    buffer = io.BytesIO()
    with h5py.File(buffer, "w") as file:
        file.attrs.update(format=FORMAT, version=VERSION)
        file.attrs["provenance"] = json.dumps(header["provenance"])
        for name, values in fixed.items():
            _write_dataset(file, name, values)
        further = file.create_group("columns", track_order=True)
        for name, values in columns.items():
            _write_dataset(further, name, values)
    return buffer.getvalue()


def _write_dataset(group: Any, name: str, values: NDArray[Any]) -> None:
    """Text becomes UTF-8 of variable length; everything is compressed without loss."""
    import h5py

    text = values.dtype.kind == "U"
    data = values.astype(object) if text else values
    packed = {"compression": "gzip", "shuffle": True} if values.size else {}
    group.create_dataset(
        name, data=data, dtype=h5py.string_dtype() if text else values.dtype, **packed
    )


def _read_hdf5(path: Path) -> tuple[dict[str, Any], Columns, Columns]:
    import h5py

    with h5py.File(path, "r") as file:
        if "format" not in file.attrs:
            raise ValueError("an HDF5 file without the attribute `format`")
        version = int(file.attrs["version"])
        header: dict[str, Any] = {"format": str(file.attrs["format"]), "version": version}
        _check(path, header)
        header["provenance"] = json.loads(file.attrs["provenance"])
        columns = {name: _read_dataset(data) for name, data in file["columns"].items()}
        return header, {name: _read_dataset(file[name]) for name in FIXED}, columns


def _read_dataset(data: Any) -> NDArray[Any]:
    import h5py

    if h5py.check_string_dtype(data.dtype) is None:
        return np.asarray(data[()])
    return np.array(data.asstr()[()], dtype=str)
