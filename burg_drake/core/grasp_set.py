"""`GraspSet`: grasps as a struct of arrays, with identifiers, stored as `.npz` or `.h5`."""

from __future__ import annotations

import hashlib
import io
import json
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
from numpy.typing import ArrayLike, NDArray

from burg_drake.core.array_files import NUMBER_KINDS, StoredArray, is_hdf5, open_hdf5, open_npz
from burg_drake.core.arrays import Array
from burg_drake.core.column_descriptions import describe_column
from burg_drake.core.errors import InvalidInputError, UnknownNameError, list_names, suggest_names
from burg_drake.core.files import FileLimits, atomic_write, report_read_errors
from burg_drake.core.frames import MAX_POSE_COORDINATE, canonical_fingers, check_pose
from burg_drake.core.paths import with_resolved_references, with_shareable_references
from burg_drake.core.structured_text import parse_json


def distinct_texts(texts: NDArray[np.str_]) -> set[str]:
    """The distinct texts of an array (N,)."""
    if _is_repeated(texts):
        texts = texts[:1]
    step = 1 << 14  # Texts that are converted to Python objects at a time.
    parts = (texts[begin : begin + step].tolist() for begin in range(0, len(texts), step))
    return set().union(*parts)


def grasp_identifiers(object: NDArray[np.str_], X_OG: Array, width: Array) -> NDArray[np.str_]:
    """(N,) hashes of names, poses and widths (BLAKE2b, which takes a microsecond a grasp)."""
    prefixes = {
        name: hashlib.blake2b(f"{name}\0".encode(), digest_size=6)
        for name in distinct_texts(object)
    }
    # collision probability 2e-5 for 100,000 grasps
    ids = np.empty(len(X_OG), dtype="<U12")
    step = 1 << 14  # Grasps whose numbers are copied at a time.
    for begin in range(0, len(X_OG), step):
        part = slice(begin, begin + step)
        numbers = np.column_stack([X_OG[part].reshape(-1, 16), width[part]]).astype("<f8")
        rows = zip(object[part].tolist(), numbers, strict=True)
        for place, (name, row) in enumerate(rows, begin):
            digest = prefixes[name].copy()
            digest.update(row.data)
            ids[place] = digest.hexdigest()
    return ids


FIXED_COLUMNS = ("width", "id", "object", "score")
"""Columns that every set has."""


class GraspSetFormat:
    """Values in the header of a grasp file."""

    name = "burg_drake.grasps"
    version = 2
    readable_versions = (1, 2)  # Version 1 had no additional columns.


COLUMN_PREFIX = "column:"
"""Prefix of the names of additional columns in `.npz`."""

SetColumns = dict[str, NDArray[Any]]


def _check_header(path: Path, header: dict[str, Any]) -> None:
    if (
        header["format"] != GraspSetFormat.name
        or header["version"] not in GraspSetFormat.readable_versions
    ):
        raise InvalidInputError(
            f"{path} is a file of format {header['format']!r}, version "
            f"{header['version']!r}; this release reads {GraspSetFormat.name!r} version "
            f"{' and '.join(map(str, GraspSetFormat.readable_versions))}"
        )


def _read_columns(
    array: Callable[[str], StoredArray], additional: dict[str, str]
) -> tuple[SetColumns, SetColumns]:
    """Reads the columns that every set has, and additional ones.

    Args:
        array: returns the array of a name in the file.
        additional: names of the arrays of additional columns, by column.
    """
    for name in {*FIXED_COLUMNS, ""} & set(additional):
        raise ValueError(f"it has a further column {name!r}, which must not be called that")
    poses = array("X_OG")
    n = poses.require_rows(4, 4)
    fixed = {"X_OG": poses.read("f").astype(float, copy=False)}
    for name in FIXED_COLUMNS:
        is_text = name in ("id", "object")
        values = array(name).read("U" if is_text else "f", (n,))
        fixed[name] = values if is_text else values.astype(float, copy=False)
    columns = {name: array(key).read(NUMBER_KINDS + "U", (n,)) for name, key in additional.items()}
    return fixed, columns


def _write_npz(
    stream: BinaryIO, header: dict[str, Any], fixed: SetColumns, columns: SetColumns
) -> None:
    additional = {COLUMN_PREFIX + name: values for name, values in columns.items()}
    arrays: dict[str, Any] = {"header": np.array(json.dumps(header)), **fixed, **additional}
    np.savez_compressed(stream, **arrays)


def _read_npz(path: Path) -> tuple[dict[str, Any], SetColumns, SetColumns]:
    with open_npz(path) as file:
        if "header" not in file.names:
            raise InvalidInputError(
                f"{path} is not a grasp set: it has no array 'header', only"
                f" {list_names(file.names)}; write it with GraspSet.create(X_OG, object=NAME)"
                ".save(FILE), where X_OG has shape (N, 4, 4); a plain .npy of that shape is read"
                " as poses of BURG-Toolkit"
            )
        stored = file.array("header")
        if stored.itemsize > 4 * FileLimits.document.size:
            raise ValueError("its header is too long")
        header = parse_json(str(stored.read("U", ())), f"{path}: header")
        _check_header(path, header)
        names = [name for name in file.names if name.startswith(COLUMN_PREFIX)]
        additional = {name.removeprefix(COLUMN_PREFIX): name for name in names}
        return header, *_read_columns(file.array, additional)


def _hdf5_bytes(header: dict[str, Any], fixed: SetColumns, columns: SetColumns) -> bytes:
    import h5py

    buffer = io.BytesIO()
    with h5py.File(buffer, "w") as file:
        file.attrs.update(format=GraspSetFormat.name, version=GraspSetFormat.version)
        file.attrs["provenance"] = json.dumps(header["provenance"])
        for name, values in fixed.items():
            _write_dataset(file, name, values)
        additional = file.create_group("columns", track_order=True)
        for name, values in columns.items():
            if "/" in name or name in (".", ""):
                raise InvalidInputError(
                    f"HDF5 cannot have a column called {name!r}; rename it, or write .npz"
                )
            _write_dataset(additional, name, values)
    return buffer.getvalue()


def _write_dataset(group: Any, name: str, values: NDArray[Any]) -> None:
    """Writes a column, compressed without loss; text as UTF-8 of fixed length, so that readers know
    the size in advance."""
    import h5py

    packed = {"compression": "gzip", "shuffle": True} if values.size else {}
    if values.dtype.kind == "U":
        encoded = np.char.encode(values, "utf-8")
        type = h5py.string_dtype("utf-8", max(1, encoded.dtype.itemsize))
        data = group.create_dataset(name, data=encoded.astype(type), dtype=type, **packed)
    else:
        data = group.create_dataset(name, data=values, **packed)
    if (column := describe_column(name)) is not None:
        data.attrs.update(unit=column.unit, description=column.description)


def _read_hdf5(path: Path) -> tuple[dict[str, Any], SetColumns, SetColumns]:
    with open_hdf5(path) as file:
        version = int(file.attribute("version"))
        header: dict[str, Any] = {"format": str(file.attribute("format")), "version": version}
        _check_header(path, header)
        provenance = str(file.attribute("provenance"))
        header["provenance"] = parse_json(provenance, f"{path}: provenance")
        additional = {name: f"columns/{name}" for name in file.names("columns")}
        return header, *_read_columns(file.array, additional)


@dataclass(frozen=True, eq=False)
class GraspSet:
    """N grasps, possibly of several objects.

    Example::

        grasps = burg.GraspSet.create(X_OG, object="mug", score=scores)  # (N, 4, 4) and (N,)
        grasps = grasps.select(grasps.score > 0.5)
        grasps.save("grasps.h5")

    The arrays are not to be changed in place, as identifiers depend on them; a value that was given
    for all grasps is stored once, read-only.

    Attributes:
        X_OG: (N, 4, 4) grasp poses in the object frame.
        width: (N,) distance between the contacts along the closing direction [m]; NaN if unknown.
        id: (N,) identifiers, computed from object, pose and width.
        object: (N,) names of the library objects.
        score: (N,) quality, higher is better; NaN if unknown.
        provenance: how the set was made (sampler, parameters, seeds, hashes); JSON values.
        columns: additional values by name, each (N,) numbers, booleans or text. `instance` is the
            placed object of a scene that each grasp belongs to.
    """

    X_OG: Array
    width: Array
    id: NDArray[np.str_]
    object: NDArray[np.str_]
    score: Array
    provenance: Mapping[str, Any] = field(default_factory=dict)
    columns: Mapping[str, NDArray[Any]] = field(default_factory=dict)

    def __post_init__(self) -> None:
        if self.X_OG.ndim != 3 or self.X_OG.shape[1:] != (4, 4):
            raise InvalidInputError(
                f"GraspSet.X_OG has shape {self.X_OG.shape}; expected (N, 4, 4)"
            )
        n = len(self.X_OG)
        for name in self.column_names:
            if (shape := self.column(name).shape) != (n,):
                raise InvalidInputError(f"GraspSet.{name} has shape {shape}; expected ({n},)")

    @classmethod
    def create(
        cls,
        X_OG: ArrayLike,
        *,
        object: str | ArrayLike,
        width: ArrayLike | None = None,
        score: ArrayLike | None = None,
        provenance: Mapping[str, Any] | None = None,
        columns: Mapping[str, ArrayLike] | None = None,
    ) -> GraspSet:
        """Checks the poses, fills missing values and computes the identifiers.

        Args:
            X_OG: (N, 4, 4) or (4, 4) grasp poses in the object frame.
            object: one name for all, or (N,) names.
            width: (N,) or scalar [m]; NaN if None.
            score: (N,) or scalar; NaN if None.
            provenance: JSON-compatible mapping.
            columns: additional values by name, each (N,) or scalar.

        Raises:
            InvalidInputError: a pose is not a finite rigid transform, shapes or types do not fit,
                or the provenance is not JSON-compatible.
        """
        poses = check_pose(X_OG, "X_OG") + 0.0  # a copy without negative zeros: equal, equal id
        poses = poses.reshape(-1, 4, 4)
        n = len(poses)
        names = _copy_column("object", np.asarray(object, dtype=str), n)
        widths = np.asarray(np.nan if width is None else width, float) + 0.0  # no negative zeros
        widths = _copy_column("width", np.asarray(widths), n)
        _require_widths(widths)
        scores = _copy_column("score", np.asarray(np.nan if score is None else score, float), n)
        ids = grasp_identifiers(names, poses, widths)
        try:
            plain = json.loads(json.dumps(dict(provenance or {})))
        except (TypeError, ValueError) as error:
            raise InvalidInputError(
                f"provenance must consist of values that JSON can hold: {error}"
            ) from error
        grasps = cls(poses, widths, ids, names, scores, plain)
        return grasps.with_columns(**columns) if columns else grasps

    def __len__(self) -> int:
        return len(self.X_OG)

    def __repr__(self) -> str:
        objects = list_names(sorted(distinct_texts(self.object)))
        columns = f"; columns {', '.join(self.columns)}" if self.columns else ""
        return f"GraspSet({len(self)} grasps of {objects}{columns})"

    @property
    def column_names(self) -> tuple[str, ...]:
        """Names that `column` knows."""
        return (*FIXED_COLUMNS, *self.columns)

    def column(self, name: str) -> NDArray[Any]:
        """Values (N,) of a column: width, id, object, score, or one of `columns`.

        Raises:
            UnknownNameError: there is no such column.
        """
        if name in self.columns:
            return self.columns[name]
        if name not in FIXED_COLUMNS:
            raise UnknownNameError(
                f"the grasps have no column {name!r}; {suggest_names(name, self.column_names)}"
            )
        values: NDArray[Any] = getattr(self, name)
        return values

    def with_columns(self, **values: ArrayLike) -> GraspSet:
        """The same grasps with columns added or replaced.

        Args:
            values: (N,) or scalars by name; `score` sets the score.

        Raises:
            InvalidInputError: a shape or type does not fit, or the column is part of the
                identity: object, width and id.
        """
        columns, score = dict(self.columns), self.score
        for name, given in values.items():
            column = _copy_column(name, np.asarray(given), len(self))
            if name == "score":
                score = column.astype(float, copy=False)
            elif name in FIXED_COLUMNS:
                raise InvalidInputError(
                    f"column {name!r} is a part of every grasp and cannot be replaced;"
                    " make a new set with GraspSet.create"
                )
            elif column.dtype.kind not in "fiubU":
                raise InvalidInputError(
                    f"column {name!r} has values of type {column.dtype}; give numbers, truth"
                    " values or text"
                )
            else:
                columns[name] = column
        return replace(self, score=score, columns=columns)

    def canonical(self) -> GraspSet:
        """The same physical grasps with a unique order of the fingers, see `canonical_fingers`.

        Identifiers change if the fingers are swapped.
        """
        return GraspSet.create(
            canonical_fingers(self.X_OG),
            object=self.object,
            width=self.width,
            score=self.score,
            provenance=self.provenance,
            columns=self.columns,
        )

    def select(self, index: ArrayLike | slice) -> GraspSet:
        """Subset by boolean mask, integer array or slice; the provenance is kept."""
        i = index if isinstance(index, slice) else np.atleast_1d(np.asarray(index))
        if not isinstance(i, slice) and i.size == 0 and i.dtype != bool:
            i = i.astype(int)  # an empty list is an array of floats
        return GraspSet(
            self.X_OG[i],
            _select(self.width, i),
            _select(self.id, i),
            _select(self.object, i),
            _select(self.score, i),
            self.provenance,
            {name: _select(values, i) for name, values in self.columns.items()},
        )

    @staticmethod
    def concatenate(sets: Iterable[GraspSet]) -> GraspSet:
        """Joins sets of grasps; their provenances are listed under `parts`.

        Values of columns that a set lacks are NaN, or empty text.

        Raises:
            InvalidInputError: there is no set to join, or a column is text in one set and numbers
                in another.
        """
        parts = list(sets)
        if not parts:
            raise InvalidInputError("cannot concatenate zero grasp sets; give at least one")
        names = dict.fromkeys(name for s in parts for name in s.columns)
        one = parts[0]
        if len(parts) == 1:  # its arrays need no copy
            return replace(one, provenance={"parts": [dict(one.provenance)]})
        return GraspSet(
            np.concatenate([s.X_OG for s in parts]),
            _join([s.width for s in parts]),
            _join([s.id for s in parts]),
            _join([s.object for s in parts]),
            _join([s.score for s in parts]),
            {"parts": [dict(s.provenance) for s in parts]},
            {name: _concatenate_column(name, parts) for name in names},
        )

    def save(self, path: str | Path) -> None:
        """Writes a file that `load` restores bit for bit.

        Args:
            path: path that ends in `.npz` or `.h5`.

        Raises:
            InvalidInputError: another suffix, or the path cannot be written to.
        """
        suffix = Path(path).suffix.lower()
        if suffix not in (".npz", ".h5", ".hdf5"):
            raise InvalidInputError(
                f"{path} ends in {suffix!r}; give a name that ends in .npz or .h5"
            )
        provenance = with_shareable_references(self.provenance, Path(path).absolute().parent)
        header = {
            "format": GraspSetFormat.name,
            "version": GraspSetFormat.version,
            "provenance": provenance,
        }
        fixed = {name: getattr(self, name) for name in ("X_OG", *FIXED_COLUMNS)}
        columns = dict(self.columns)
        if suffix == ".npz":
            atomic_write(path, lambda stream: _write_npz(stream, header, fixed, columns))
        else:
            atomic_write(path, _hdf5_bytes(header, fixed, columns))

    @classmethod
    def load(cls, path: str | Path) -> GraspSet:
        """Reads a file written by `save`.

        Raises:
            InvalidInputError: not such a file, or of a newer version.
        """
        path = Path(path)
        with report_read_errors(path, "a grasp set written by burg_drake"):
            header, fixed, columns = (_read_hdf5 if is_hdf5(path) else _read_npz)(path)
            if not isinstance(header["provenance"], dict):
                raise ValueError("its provenance is not a mapping")
            provenance = with_resolved_references(header["provenance"], path.absolute().parent)
            grasps = cls(**fixed, provenance=provenance, columns=columns)
            require_valid_grasps(grasps)
            return grasps


def require_valid_grasps(grasps: GraspSet) -> None:
    """Rejects a set, for example from a file, that `create` would not have made.

    Duplicates with the same identifier, object, pose and width are allowed.

    Raises:
        InvalidInputError: a pose is not a finite rigid transform, a width is too large, or
            different grasps have the same identifier; the message names the first ones.
    """
    check_pose(grasps.X_OG, "X_OG")
    _require_widths(grasps.width)
    _, first, same = np.unique(grasps.id, return_index=True, return_inverse=True)
    repeated = np.flatnonzero(first[same] != np.arange(len(grasps)))
    twin = first[same[repeated]]
    one, other = grasps.select(repeated), grasps.select(twin)
    differs = (one.object != other.object) | (one.X_OG != other.X_OG).any((1, 2))
    differs |= ~((one.width == other.width) | (np.isnan(one.width) & np.isnan(other.width)))
    if differs.any():
        k = int(np.argmax(differs))
        raise InvalidInputError(
            f"id[{twin[k]}] and id[{repeated[k]}] are both {str(one.id[k])!r}, but the grasps"
            " differ; give each an id of its own"
        )


def _require_widths(width: Array) -> None:
    if (bad := np.abs(width) > MAX_POSE_COORDINATE).any():
        i = int(np.argmax(bad))
        raise InvalidInputError(f"width[{i}] is {width[i]:g}; give metres, or NaN if unknown")


def _copy_column(name: str, values: NDArray[Any], n: int) -> NDArray[Any]:
    """A copy of values (n,), or one value for all."""
    if values.shape not in ((), (n,)):
        raise InvalidInputError(f"{name} has shape {values.shape}; expected ({n},) or one value")
    if values.ndim == 0 or _is_repeated(values):
        return np.broadcast_to(np.atleast_1d(values)[:1].copy(), n)
    return values.copy()


def _is_repeated(values: NDArray[Any]) -> bool:
    """Whether a column (N,) holds one value that all grasps share, in the memory of one."""
    return values.strides == (0,) and len(values) > 0


def _select(values: NDArray[Any], index: NDArray[Any] | slice) -> NDArray[Any]:
    """Values of a column at an index."""
    chosen: NDArray[Any] = values[index]
    return np.broadcast_to(values[:1], len(chosen)) if _is_repeated(values) else chosen


def _join(columns: Sequence[NDArray[Any]]) -> NDArray[Any]:
    """Joins the values of a column in several sets."""
    if all(map(_is_repeated, columns)):
        values = {(column.dtype, column[:1].tobytes()) for column in columns}
        if len(values) == 1:
            return np.broadcast_to(columns[0][:1], sum(map(len, columns)))
    return np.concatenate(columns)


def _concatenate_column(name: str, sets: list[GraspSet]) -> NDArray[Any]:
    """Joins a column of sets, some of which may lack it."""
    kinds = {s.columns[name].dtype.kind == "U" for s in sets if name in s.columns and len(s)}
    if len(kinds) > 1:
        raise InvalidInputError(
            f"column {name!r} is text in one set of grasps and numbers in another; rename one"
        )
    missing = "" if kinds == {True} else np.nan
    filled = [s.columns.get(name, np.full(len(s), missing)) for s in sets]
    return _join([values for values in filled if len(values)] or filled[:1])
