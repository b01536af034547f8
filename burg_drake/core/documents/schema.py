"""Typed, versioned YAML documents: the dataclass is the schema.

A document is a frozen dataclass with a `version: int` field whose default is the version that this
release writes. Loading checks every key and value and names file, line and key of what does not
fit. Field types: `bool, int, float, str`, `Literal`, `Enum`, `X | None`, `list[X]`,
`tuple[X, ...]`, `tuple[X, Y, Z]`, `dict[str, X]` and nested dataclasses. Numbers must be finite.
"""

from __future__ import annotations

import dataclasses
import enum
import math
import typing
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
import yaml
from numpy.typing import ArrayLike

from burg_drake.core.arrays import Array
from burg_drake.core.documents.kinds import schema_line
from burg_drake.core.documents.reader import Reader
from burg_drake.core.documents.vectors import Quaternion, Vector3
from burg_drake.core.documents.yaml_nodes import parse_nodes
from burg_drake.core.errors import InvalidInputError
from burg_drake.core.files import atomic_write, read_text
from burg_drake.core.frames import (
    check_pose,
    make_pose,
    quaternion_from_rotation,
    rotation_from_quaternion,
    rotation_from_rpy,
    rpy_from_rotation,
)

T = TypeVar("T")


@dataclass(frozen=True)
class Pose:
    """A position and an orientation. Without keys it is the identity.

    Attributes:
        translation: position x, y, z [m].
        rpy_deg: roll, pitch and yaw about the fixed x, y and z axes [degrees].
        quaternion_wxyz: rotation as a unit quaternion w, x, y, z, in place of `rpy_deg`.
    """

    translation: Vector3 = (0.0, 0.0, 0.0)
    rpy_deg: Vector3 | None = None
    quaternion_wxyz: Quaternion | None = None

    def __post_init__(self) -> None:
        if self.rpy_deg is not None and self.quaternion_wxyz is not None:
            raise InvalidInputError("give rpy_deg or quaternion_wxyz, not both")
        if self.quaternion_wxyz is not None:
            length = math.hypot(*self.quaternion_wxyz)
            if abs(length - 1.0) > 1e-3:
                raise InvalidInputError(
                    f"quaternion_wxyz has length {length:.6g}; a rotation has length 1"
                )

    def matrix(self) -> Array:
        """The (4, 4) homogeneous matrix."""
        if self.quaternion_wxyz is not None:
            return make_pose(rotation_from_quaternion(self.quaternion_wxyz), self.translation)
        rpy = np.deg2rad(self.rpy_deg or (0.0, 0.0, 0.0))
        return make_pose(rotation_from_rpy(rpy), self.translation)

    @classmethod
    def from_matrix(cls, X_AB: ArrayLike, *, quaternion: bool = False) -> Pose:
        """From a (4, 4) matrix; angles in degrees for people, a quaternion for exactness."""
        X = check_pose(X_AB, "X_AB")
        translation = typing.cast(Vector3, tuple(X[:3, 3].tolist()))
        if quaternion:
            wxyz = tuple(quaternion_from_rotation(X[:3, :3]).tolist())
            return cls(translation, quaternion_wxyz=typing.cast(Quaternion, wxyz))
        rpy = np.rad2deg(rpy_from_rotation(X[:3, :3])) + 0.0
        return cls(translation, rpy_deg=typing.cast(Vector3, tuple(rpy.tolist())))

    @classmethod
    def readable(cls, X_AB: ArrayLike) -> Pose:
        """From a (4, 4) matrix, rounded to a micrometre and a ten thousandth of a degree."""
        exact = cls.from_matrix(X_AB)
        x, y, z = (round(value, 6) + 0.0 for value in exact.translation)
        roll, pitch, yaw = (round(value, 4) + 0.0 for value in exact.rpy_deg or (0.0, 0.0, 0.0))
        return cls((x, y, z), rpy_deg=(roll, pitch, yaw))


def load_document(path: str | Path, schema: type[T]) -> T:
    """Reads a YAML file into a document dataclass.

    Args:
        path: file to read.
        schema: dataclass with a `version` field.

    Raises:
        DocumentError: file missing, not YAML, another version, or a key or value that does not
            fit; the message names file, line and key.
    """
    return parse_document(read_text(path), schema, str(path))


def parse_document(text: str, schema: type[T], name: str) -> T:
    """As `load_document`, from text; `name` stands for the file in messages."""
    return read_document(parse_nodes(text, name, empty_document(schema)), schema, name)


def empty_document(schema: type) -> str:
    """What to say of a text without content."""
    return f"the document is empty; expected keys {_keys(schema)}"


def read_document(node: yaml.Node, schema: type[T], name: str) -> T:
    """As `parse_document`, from the root node of the text."""
    reader = Reader(name)
    if isinstance(node, yaml.MappingNode):
        reader.check_version(node, schema)
    return typing.cast(T, reader.read(node, schema, ""))


def save_document(document: Any, path: str | Path, header: str = "") -> None:
    """Writes a document dataclass as YAML, whole or not at all.

    Args:
        document, header: see `document_text`.
        path: file to write.
    """
    atomic_write(path, document_text(document, header))


def document_text(document: Any, header: str = "") -> str:
    """The text of a file: the line by which editors find the schema, a header, the document.

    Fields that have their default are left out; see `plain_data`.

    Args:
        document: instance of a document dataclass.
        header: comment below the first line.
    """
    comment = "".join(f"# {line}\n" for line in header.splitlines())
    return schema_line(document) + comment + dump_document(document)


def dump_document(document: Any) -> str:
    """A document as YAML without comments, of which hashes are made."""
    return yaml.dump(
        plain_data(document), Dumper=_Dumper, sort_keys=False, width=100, allow_unicode=True
    )


BREAKS = frozenset("\x85\u2028\u2029")
"""Line breaks of YAML that are read as spaces, or not at all, unless they are escaped."""


class _Dumper(yaml.SafeDumper):
    """Block style for structure, flow style for short lists of numbers, indented lists."""

    def increase_indent(self, flow: bool = False, indentless: bool = False) -> None:
        super().increase_indent(flow, False)

    def represent_sequence(self, tag: str, sequence: Any, flow_style: Any = None) -> Any:
        scalar = all(isinstance(item, (int, float, str)) for item in sequence)
        return super().represent_sequence(tag, sequence, flow_style=scalar)

    def represent_scalar(self, tag: str, value: Any, style: str | None = None) -> Any:
        breaks = isinstance(value, str) and not BREAKS.isdisjoint(value)
        return super().represent_scalar(tag, value, '"' if breaks else style)


def plain_data(value: Any) -> Any:
    """A document dataclass as dicts, lists and scalars.

    Fields at their default are left out, except for `version` and in classes with a class attribute
    `WRITTEN_WHOLE = True`, for parameters whose defaults may change one day.
    """
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        whole = getattr(value, "WRITTEN_WHOLE", False)
        return {
            f.name: plain_data(getattr(value, f.name))
            for f in dataclasses.fields(value)
            if whole or f.name == "version" or not _is_default(f, getattr(value, f.name))
        }
    if isinstance(value, dict):
        return {str(k): plain_data(v) for k, v in value.items()}
    if isinstance(value, (list, tuple)):
        return [plain_data(v) for v in value]
    if isinstance(value, enum.Enum):
        return value.value
    if isinstance(value, np.generic):
        return value.item()
    return value


def _is_default(field: dataclasses.Field[Any], value: Any) -> bool:
    if field.default is not dataclasses.MISSING:
        return bool(value == field.default)
    if field.default_factory is not dataclasses.MISSING:
        return bool(value == field.default_factory())
    return False


def _keys(schema: type) -> str:
    return ", ".join(f.name for f in dataclasses.fields(schema))
