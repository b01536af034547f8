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
import types
import typing
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
import yaml
from numpy.typing import ArrayLike

from burg_drake.core.errors import DocumentError, InvalidInputError, nearest
from burg_drake.core.files import atomic_write
from burg_drake.core.frames import (
    Array,
    check_pose,
    make_pose,
    quaternion_from_rotation,
    rotation_from_quaternion,
    rotation_from_rpy,
    rpy_from_rotation,
)

T = TypeVar("T")
Vector3 = tuple[float, float, float]
Quaternion = tuple[float, float, float, float]


@dataclass(frozen=True)
class Pose:
    """A rigid transform as people write it.

    Attributes:
        translation: position [m].
        rpy_deg: roll, pitch, yaw about the fixed x, y, z axes [degrees].
        quaternion_wxyz: the rotation as quaternion, in place of `rpy_deg`.
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


def load_document(path: str | Path, schema: type[T]) -> T:
    """Reads a YAML file into a document dataclass.

    Args:
        path: file to read.
        schema: dataclass with a `version` field.

    Raises:
        DocumentError: file missing, not YAML, another version, or a key or value that does not
            fit; the message names file, line and key.
    """
    path = Path(path)
    try:
        text = path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        reason = error.strerror if isinstance(error, OSError) else "it is not a text file"
        raise DocumentError(f"cannot read {path}: {reason}") from error
    return parse_document(text, schema, str(path))


def parse_document(text: str, schema: type[T], name: str) -> T:
    """As `load_document`, from text; `name` stands for the file in messages."""
    try:
        node = yaml.compose(text, Loader=yaml.CSafeLoader if _C_LOADER else yaml.SafeLoader)
    except yaml.YAMLError as error:
        mark = getattr(error, "problem_mark", None)
        line = f":{mark.line + 1}" if mark else ""
        problem = getattr(error, "problem", None) or str(error).splitlines()[0]
        raise DocumentError(f"{name}{line}: not valid YAML: {problem}") from error
    if node is None:
        raise DocumentError(f"{name}: the document is empty; expected keys {_keys(schema)}")
    reader = _Reader(name)
    if isinstance(node, yaml.MappingNode):
        reader.check_version(node, schema)
    return typing.cast(T, reader.read(node, schema, ""))


def save_document(document: Any, path: str | Path, header: str = "") -> None:
    """Writes a document dataclass as YAML, whole or not at all.

    Fields that have their default are left out, except for `version`.

    Args:
        document: instance of a document dataclass.
        path: file to write.
        header: comment for the first lines.
    """
    comment = "".join(f"# {line}\n" for line in header.splitlines())
    atomic_write(path, comment + dump_document(document))


def dump_document(document: Any) -> str:
    """The YAML text that `save_document` writes."""
    return yaml.dump(_plain(document), Dumper=_Dumper, sort_keys=False, width=100)


class _Dumper(yaml.SafeDumper):
    """Block style for structure, flow style for short lists of numbers, indented lists."""

    def increase_indent(self, flow: bool = False, indentless: bool = False) -> None:
        super().increase_indent(flow, False)

    def represent_sequence(self, tag: str, sequence: Any, flow_style: Any = None) -> Any:
        scalar = all(isinstance(item, (int, float, str)) for item in sequence)
        return super().represent_sequence(tag, sequence, flow_style=scalar)


def _plain(value: Any) -> Any:
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        return {
            f.name: _plain(getattr(value, f.name))
            for f in dataclasses.fields(value)
            if f.name == "version" or not _is_default(f, getattr(value, f.name))
        }
    if isinstance(value, dict):
        return {str(k): _plain(v) for k, v in value.items()}
    if isinstance(value, (list, tuple)):
        return [_plain(v) for v in value]
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


_C_LOADER = hasattr(yaml, "CSafeLoader")


class _Reader:
    """Turns YAML nodes into typed values; every error names file, line and key."""

    def __init__(self, name: str) -> None:
        self.name = name

    def fail(self, node: yaml.Node, where: str, what: str) -> DocumentError:
        key = f" {where}:" if where else ""
        return DocumentError(f"{self.name}:{node.start_mark.line + 1}:{key} {what}")

    def check_version(self, node: yaml.MappingNode, schema: type) -> None:
        current = next(f.default for f in dataclasses.fields(schema) if f.name == "version")
        for key, value in node.value:
            if key.value == "version":
                given = value.value if isinstance(value, yaml.ScalarNode) else "a structure"
                if given != str(current):
                    what = f"{given} cannot be read; this release reads version {current}"
                    raise self.fail(value, "version", what)
                return
        raise self.fail(node, "version", f"missing; add 'version: {current}'")

    def read(self, node: yaml.Node, kind: Any, where: str) -> Any:
        origin = typing.get_origin(kind)
        if origin in (typing.Union, types.UnionType):
            return self.read_optional(node, kind, where)
        if origin is typing.Literal:
            allowed = [str(a) for a in typing.get_args(kind)]
            return self.choice(node, where, dict(zip(allowed, typing.get_args(kind), strict=True)))
        if origin in (list, tuple):
            return self.read_sequence(node, kind, origin, where)
        if origin is dict:
            return self.read_dict(node, typing.get_args(kind)[1], where)
        if dataclasses.is_dataclass(kind):
            return self.read_dataclass(node, typing.cast(type, kind), where)
        if isinstance(kind, type) and issubclass(kind, enum.Enum):
            return self.choice(node, where, {str(m.value): m for m in kind})
        return self.read_scalar(node, kind, where)

    def read_optional(self, node: yaml.Node, kind: Any, where: str) -> Any:
        options = [a for a in typing.get_args(kind) if a is not type(None)]
        if node.tag == "tag:yaml.org,2002:null":
            return None
        if len(options) != 1:
            raise TypeError(f"schema type {kind} is not supported")
        return self.read(node, options[0], where)

    def choice(self, node: yaml.Node, where: str, options: dict[str, Any]) -> Any:
        if not isinstance(node, yaml.ScalarNode) or node.value not in options:
            given = node.value if isinstance(node, yaml.ScalarNode) else "a structure"
            raise self.fail(node, where, f"{given!r} is not valid; {nearest(str(given), options)}")
        return options[node.value]

    def read_sequence(self, node: yaml.Node, kind: Any, origin: Any, where: str) -> Any:
        if not isinstance(node, yaml.SequenceNode):
            raise self.fail(node, where, "expected a list such as [a, b, c]")
        arguments = typing.get_args(kind)
        if origin is tuple and Ellipsis not in arguments:
            if len(node.value) != len(arguments):
                raise self.fail(
                    node, where, f"has {len(node.value)} entries; expected {len(arguments)}"
                )
            kinds = list(arguments)
        else:
            kinds = [arguments[0]] * len(node.value)
        pairs = enumerate(zip(node.value, kinds, strict=True))
        return origin(self.read(item, k, f"{where}[{i}]") for i, (item, k) in pairs)

    def entries(self, node: yaml.Node, where: str) -> dict[str, tuple[yaml.Node, yaml.Node]]:
        if not isinstance(node, yaml.MappingNode):
            raise self.fail(node, where, "expected keys with values ('key: value' lines)")
        found: dict[str, tuple[yaml.Node, yaml.Node]] = {}
        for key, value in node.value:
            if not isinstance(key, yaml.ScalarNode):
                raise self.fail(key, where, "a key has to be a text, not a structure")
            if key.value in found:
                raise self.fail(key, where, f"key {key.value!r} is given twice")
            found[key.value] = (key, value)
        return found

    def read_dict(self, node: yaml.Node, kind: Any, where: str) -> dict[str, Any]:
        prefix = f"{where}." if where else ""
        return {
            name: self.read(value, kind, f"{prefix}{name}")
            for name, (_, value) in self.entries(node, where).items()
        }

    def read_dataclass(self, node: yaml.Node, kind: type, where: str) -> Any:
        entries = self.entries(node, where)
        hints = typing.get_type_hints(kind)
        fields = {f.name: f for f in dataclasses.fields(kind) if f.init}
        prefix = f"{where}." if where else ""
        for name, (key, _) in entries.items():
            if name not in fields:
                raise self.fail(key, where, f"unknown key {name!r}; {nearest(name, fields)}")
        for name, field in fields.items():
            if name not in entries and field.default is field.default_factory:
                raise self.fail(node, where, f"key {name!r} is missing")
        values = {
            name: self.read(value, hints[name], f"{prefix}{name}")
            for name, (_, value) in entries.items()
        }
        try:
            return kind(**values)
        except DocumentError:
            raise
        except InvalidInputError as error:
            raise self.fail(node, where, str(error)) from error

    def read_scalar(self, node: yaml.Node, kind: type, where: str) -> Any:
        expected = {
            bool: "true or false",
            int: "a whole number",
            float: "a finite number",
            str: "a text",
        }
        if kind not in expected:
            raise TypeError(f"schema type {kind} is not supported")
        if not isinstance(node, yaml.ScalarNode) or node.tag == "tag:yaml.org,2002:null":
            raise self.fail(node, where, f"expected {expected[kind]}")
        if kind is str:
            return node.value
        if kind is bool and node.value.lower() in ("true", "false"):
            return node.value.lower() == "true"
        try:
            if kind is not bool:
                value = kind(node.value)
                if math.isfinite(value):
                    return value
        except (ValueError, OverflowError):
            pass
        raise self.fail(node, where, f"{node.value!r} is not {expected[kind]}")
