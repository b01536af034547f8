"""Typed, versioned YAML documents: the dataclass is the schema.

A document is a frozen dataclass with a `version: int` field whose default is the version that this
release writes. Loading checks every key and value; errors name file, line and key. Field types:
`bool, int, float, str`, `Literal`, `Enum`, `X | None`, `list[X]`, `tuple[X, ...]`,
`tuple[X, Y, Z]`, `dict[str, X]`, nested dataclasses, and `Any` for dicts, lists and scalars of any
structure. Numbers must be finite.

The JSON Schemas for editors are made from the same dataclasses: types, defaults, ranges (`RANGES`
of a class) and docstrings.
"""

from __future__ import annotations

import dataclasses
import enum
import functools
import inspect
import json
import math
import numbers
import re
import types
import typing
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar, TypeVar

import numpy as np
import yaml
from numpy.typing import ArrayLike

from burg_drake.core.arrays import Array
from burg_drake.core.document_kinds import DOCUMENT_KINDS, SCHEMA_URL, document_class, schema_line
from burg_drake.core.errors import (
    DocumentError,
    FieldError,
    InvalidInputError,
    quote_value,
    shorten_text,
    suggest_names,
)
from burg_drake.core.files import atomic_write, atomic_write_all, read_text
from burg_drake.core.frames import (
    check_pose,
    make_pose,
    quaternion_from_rotation,
    rotation_from_quaternion,
    rotation_from_rpy,
    rpy_from_rotation,
)
from burg_drake.core.settings import Quaternion, Vector3
from burg_drake.core.structured_text import parse_yaml_node

_SCALARS = {
    bool: "true or false",
    int: "a whole number",
    float: "a finite number",
    str: "a text",
}
"""Description of valid values, by type."""


class Reader:
    """Turns YAML nodes into typed values; every error names file, line and key.

    `where` is the path of keys to a node, such as `board.size[0]`; empty for the whole document.
    `LINES` is False in classes that read data without line numbers.
    """

    LINES: ClassVar[bool] = True

    def __init__(self, name: str) -> None:
        self.name = name

    def error_at(self, node: yaml.Node, where: str, what: str) -> DocumentError:
        line = f":{node.start_mark.line + 1}" if self.LINES else ""
        key = f" {where}:" if where else ""
        return DocumentError(f"{self.name}{line}:{key} {what}")

    def check_version(self, node: yaml.MappingNode, schema: type) -> None:
        current = next(f.default for f in dataclasses.fields(schema) if f.name == "version")
        names = {f.name for f in dataclasses.fields(schema)}
        required = [f.name for f in dataclasses.fields(schema) if f.default is f.default_factory]
        keys_given = {key.value for key, _ in node.value if isinstance(key, yaml.ScalarNode)}
        if required and not keys_given.intersection(required) and keys_given - names:
            kind = re.sub(r"(?<=[a-z])(?=[A-Z])", " ", schema.__name__).lower()
            keys = ", ".join(["version", *required])
            raise self.error_at(node, "", f"not a {kind}; one has the keys {keys}")
        for key, value in node.value:
            if key.value == "version":
                given = value.value if isinstance(value, yaml.ScalarNode) else "a structure"
                if given != str(current):
                    what = f"{shorten_text(given)} cannot be read"
                    raise self.error_at(
                        value, "version", f"{what}; this release reads version {current}"
                    )
                return
        raise self.error_at(node, "version", f"missing; add 'version: {current}'")

    def read(self, node: yaml.Node, kind: Any, where: str) -> Any:
        if kind in _SCALARS:
            return self.read_scalar(node, kind, where)
        if kind is Any:
            return self.read_plain(node, where)
        origin = typing.get_origin(kind)
        if origin in (typing.Union, types.UnionType):
            if node.tag == "tag:yaml.org,2002:null":
                return None
            (kind,) = (a for a in typing.get_args(kind) if a is not type(None))
            return self.read(node, kind, where)
        if origin is typing.Literal:
            allowed = [str(a) for a in typing.get_args(kind)]
            return self.read_choice(
                node, where, dict(zip(allowed, typing.get_args(kind), strict=True))
            )
        if origin in (list, tuple):
            return self.read_sequence(node, kind, origin, where)
        if origin in (dict, Mapping):
            return self.read_dict(node, typing.get_args(kind)[1], where)
        if dataclasses.is_dataclass(kind):
            return self.read_dataclass(node, typing.cast(type, kind), where)
        if isinstance(kind, type) and issubclass(kind, enum.Enum):
            members = {str(m.value): m for m in kind}
            return self.read_choice(node, where, members, ordered=True)
        raise TypeError(f"schema type {kind} is not supported")

    def read_choice(
        self, node: yaml.Node, where: str, options: dict[str, Any], *, ordered: bool = False
    ) -> Any:
        if not isinstance(node, yaml.ScalarNode) or node.value not in options:
            given = node.value if isinstance(node, yaml.ScalarNode) else "a structure"
            known = suggest_names(str(given), options, ordered=ordered)
            raise self.error_at(node, where, f"{quote_value(given)} is not valid; {known}")
        return options[node.value]

    def read_sequence(self, node: yaml.Node, kind: Any, origin: Any, where: str) -> Any:
        if not isinstance(node, yaml.SequenceNode):
            raise self.error_at(node, where, "expected a list such as [a, b, c]")
        arguments = typing.get_args(kind)
        if origin is tuple and Ellipsis not in arguments:
            if len(node.value) != len(arguments):
                raise self.error_at(
                    node, where, f"has {len(node.value)} entries; expected {len(arguments)}"
                )
            kinds = list(arguments)
        else:
            kinds = [arguments[0]] * len(node.value)
        pairs = enumerate(zip(node.value, kinds, strict=True))
        return origin(self.read(item, k, f"{where}[{i}]") for i, (item, k) in pairs)

    def read_entries(self, node: yaml.Node, where: str) -> dict[str, tuple[yaml.Node, yaml.Node]]:
        if not isinstance(node, yaml.MappingNode):
            raise self.error_at(node, where, "expected keys with values ('key: value' lines)")
        found: dict[str, tuple[yaml.Node, yaml.Node]] = {}
        for key, value in node.value:
            if not isinstance(key, yaml.ScalarNode):
                raise self.error_at(key, where, "a key must be a text, not a list or a mapping")
            if key.value in found:
                raise self.error_at(key, where, f"key {quote_value(key.value)} is given twice")
            found[key.value] = (key, value)
        return found

    def read_dict(self, node: yaml.Node, kind: Any, where: str) -> dict[str, Any]:
        prefix = f"{where}." if where else ""
        return {
            name: self.read(value, kind, f"{prefix}{name}")
            for name, (_, value) in self.read_entries(node, where).items()
        }

    def read_dataclass(self, node: yaml.Node, kind: type, where: str) -> Any:
        entries = self.read_entries(node, where)
        hints = _field_types(kind)
        fields = {f.name: f for f in dataclasses.fields(kind) if f.init}
        prefix = f"{where}." if where else ""
        for name, (key, _) in entries.items():
            if name not in fields:
                raise self.error_at(
                    key, where, f"unknown key {quote_value(name)}; {suggest_names(name, fields)}"
                )
        for name, field in fields.items():
            if name not in entries and field.default is field.default_factory:
                raise self.error_at(node, where, f"key {name!r} is missing")
        values = {
            name: self.read(value, hints[name], f"{prefix}{name}")
            for name, (_, value) in entries.items()
        }
        try:
            return kind(**values)
        except DocumentError:
            raise
        except FieldError as error:
            raise self.error_at(_node_at(node, error.place), where, str(error)) from error
        except InvalidInputError as error:
            if not where:  # key unknown
                raise DocumentError(f"{self.name}: {error}") from error
            raise self.error_at(node, where, str(error)) from error

    def read_scalar(self, node: yaml.Node, kind: type, where: str) -> Any:
        if not isinstance(node, yaml.ScalarNode) or node.tag == "tag:yaml.org,2002:null":
            raise self.error_at(node, where, f"expected {_SCALARS[kind]}")
        if kind is str:
            if "\0" in node.value:  # invalid in paths and names
                raise self.error_at(node, where, f"{quote_value(node.value)} has a NUL character")
            return node.value
        if kind is bool and node.value.lower() in ("true", "false"):
            return node.value.lower() == "true"
        try:
            value = math.nan if kind is bool else kind(node.value)
        except ValueError:  # also for whole numbers with 4,300 digits
            value = math.nan
        # Seeds may have 64 bits; 1e30 is above any useful number, in any unit.
        if abs(value) < (1 << 64 if kind is int else 1e30):
            return value
        if abs(value) < math.inf:
            raise self.error_at(node, where, f"{quote_value(node.value)} is too large a number")
        raise self.error_at(node, where, f"{quote_value(node.value)} is not {_SCALARS[kind]}")

    def read_plain(self, node: yaml.Node, where: str) -> Any:
        """A node of any structure as dicts, lists and scalars."""
        if isinstance(node, yaml.MappingNode):
            return self.read_dict(node, Any, where)
        if isinstance(node, yaml.SequenceNode):
            return self.read_sequence(node, list[Any], list, where)
        kind = node.tag.rpartition(":")[2]
        if kind == "null":
            return None
        kinds: dict[str, type] = {"bool": bool, "int": int, "float": float}
        return self.read_scalar(node, kinds.get(kind, str), where)


@functools.cache
def _field_types(kind: type) -> dict[str, Any]:
    """Types of a dataclass's fields; cached, as resolving them is slow."""
    return typing.get_type_hints(kind)


def _node_at(node: yaml.Node, place: Sequence[str | int]) -> yaml.Node:
    """The node of a value in a document; the innermost written node around it if it is missing."""
    for step in place:
        if isinstance(node, yaml.MappingNode):
            found = {key.value: value for key, value in node.value}.get(step)
        else:
            found = node.value[step] if isinstance(step, int) else None
        if not isinstance(found, yaml.Node):
            break
        node = found
    return node


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
    return read_document(parse_yaml_node(text, name, empty_document_message(schema)), schema, name)


def empty_document_message(schema: type) -> str:
    """The message for a text without content."""
    keys = ", ".join(f.name for f in dataclasses.fields(schema))
    return f"the document is empty; expected keys {keys}"


def read_document(node: yaml.Node, schema: type[T], name: str) -> T:
    """As `parse_document`, from the root node of the text."""
    reader = Reader(name)
    if isinstance(node, yaml.MappingNode):
        reader.check_version(node, schema)
    return typing.cast(T, reader.read(node, schema, ""))


def read_plain_data(data: Mapping[str, Any], schema: type[T], name: str) -> T:
    """As `load_document`, from dicts, lists and scalars, for example from `plain_data` or a JSON
    file. `name` stands for the file in messages, which have no line numbers.
    """
    reader, node = _PlainReader(name), _plain_node(data)
    if isinstance(node, yaml.MappingNode):
        reader.check_version(node, schema)
    return typing.cast(T, reader.read(node, schema, ""))


class _PlainReader(Reader):
    """Reads dicts, lists and scalars, and converts them to nodes once their type is known."""

    LINES = False

    def read(self, node: Any, kind: Any, where: str) -> Any:
        if not isinstance(node, yaml.Node):
            if kind is Any:
                return node
            node = _plain_node(node)
        return super().read(node, kind, where)

    def read_scalar(self, node: yaml.Node, kind: type, where: str) -> Any:
        is_text = node.tag == _TAGS[str]
        if isinstance(node, yaml.ScalarNode) and is_text != (kind is str):
            raise self.error_at(node, where, f"{quote_value(node.value)} is not {_SCALARS[kind]}")
        return super().read_scalar(node, kind, where)


def _plain_node(value: Any) -> yaml.Node:
    """Converts plain data to a YAML node; nested dicts and lists are kept."""
    if isinstance(value, Mapping):
        entries = [(_plain_node(str(key)), _node_of_scalar(item)) for key, item in value.items()]
        return yaml.MappingNode(_TAGS[dict], entries)
    if isinstance(value, (list, tuple)):
        return yaml.SequenceNode(_TAGS[list], [_node_of_scalar(item) for item in value])
    other = float if isinstance(value, numbers.Real) else str  # such as numbers of numpy
    return yaml.ScalarNode(_TAGS.get(type(value), _TAGS[other]), str(value))


def _node_of_scalar(value: Any) -> Any:
    return value if isinstance(value, (Mapping, list, tuple)) else _plain_node(value)


_TAGS: dict[type, str] = {
    kind: f"tag:yaml.org,2002:{tag}"
    for kind, tag in (
        *((dict, "map"), (list, "seq"), (type(None), "null")),
        *((str, "str"), (bool, "bool"), (int, "int"), (float, "float")),
    )
}
"""Tags of YAML by the types of plain data."""


def save_document(document: Any, path: str | Path, header: str = "") -> None:
    """Writes a document dataclass as YAML, atomically.

    Args:
        document, header: see `document_text`.
        path: file to write.
    """
    atomic_write(path, document_text(document, header))


def document_text(document: Any, header: str = "") -> str:
    """The text of a file: the line that tells editors the schema, a header, the document.

    Fields at their default are left out; see `plain_data`.

    Args:
        document: instance of a document dataclass.
        header: comment below the first line.
    """
    comment = "".join(f"# {line}\n" for line in header.splitlines())
    return schema_line(document) + comment + dump_document(document)


def dump_document(document: Any) -> str:
    """A document as YAML without comments, as used for hashes."""
    return yaml.dump(
        plain_data(document), Dumper=_Dumper, sort_keys=False, width=100, allow_unicode=True
    )


class _Dumper(yaml.SafeDumper):
    """Block style for structure, flow style for short lists of numbers, indented lists."""

    def increase_indent(self, flow: bool = False, indentless: bool = False) -> None:
        super().increase_indent(flow, False)

    def represent_sequence(self, tag: str, sequence: Any, flow_style: Any = None) -> Any:
        scalar = all(isinstance(item, (int, float, str)) for item in sequence)
        return super().represent_sequence(tag, sequence, flow_style=scalar)

    def represent_scalar(self, tag: str, value: Any, style: str | None = None) -> Any:
        # YAML reads these line breaks as spaces, or drops them, unless escaped.
        breaks = isinstance(value, str) and not set("\x85\u2028\u2029").isdisjoint(value)
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


_JSON_TYPES: dict[Any, Any] = {
    bool: "boolean",
    int: "integer",
    float: "number",
    str: ["string", "number", "boolean"],  # the reader also takes `operator: 7` as a text
    Any: None,
}
"""JSON Schema types of scalar Python types."""
_ATTRIBUTE_ENTRY = re.compile(r"^(\w[\w, ]*): (.*(?:\n .*)*)", re.MULTILINE)
"""Entry of an "Attributes" section: names and description."""


def json_schema(kind: str) -> dict[str, Any]:
    """The JSON Schema (draft 7) of a kind of document.

    It has the type, default, range and meaning of every key. Rules for several keys, such as "one
    of two", are checked only by the reader of the document.

    Args:
        kind: such as `scene`; `DOCUMENT_KINDS` has all.

    Raises:
        UnknownNameError: there is no such kind.
    """
    dialect = "http://json-schema.org/draft-07/schema#"  # the newest version that editors support
    document = document_class(kind)
    parts: dict[str, Any] = {}
    body = _dataclass_schema(document, parts)
    if "version" in body["properties"]:
        body["required"] = ["version", *body.get("required", [])]
    head = {"$schema": dialect, "$id": f"{SCHEMA_URL}/{kind}.json", "title": kind}
    return head | body | ({"definitions": parts} if parts else {})


def schema_text(kind: str) -> str:
    """The text of a schema file; see `json_schema`."""
    return json.dumps(json_schema(kind), indent=2, ensure_ascii=False) + "\n"


def write_schemas(folder: str | Path) -> list[Path]:
    """Writes the schemas of all kinds of documents.

    Args:
        folder: folder for the files `scene.json`, `station.json`, ...; created if missing.

    Returns:
        Paths of the files.

    Raises:
        InvalidInputError: the folder cannot be written to.
    """
    texts = {Path(folder, f"{kind}.json"): schema_text(kind) for kind in DOCUMENT_KINDS}
    atomic_write_all(texts)
    return list(texts)


def _dataclass_schema(kind: type, parts: dict[str, Any]) -> dict[str, Any]:
    """The schema of a dataclass."""
    hints, meanings = typing.get_type_hints(kind), _field_descriptions(kind)
    properties, required = {}, []
    for field in dataclasses.fields(kind):
        if not field.init:
            continue
        schema = _type_schema(hints[field.name], parts)
        if field.name in (ranges := getattr(kind, "RANGES", {})):
            _add_range(schema, *ranges[field.name])
        default = field.default
        if field.default_factory is not dataclasses.MISSING:
            default = field.default_factory()
        if field.name == "version":
            schema["const"] = default
        elif default is dataclasses.MISSING:
            required.append(field.name)
        elif (plain := plain_data(default)) not in (None, "", [], {}):
            schema["default"] = plain
        if meaning := meanings.get(field.name):
            schema = {"description": meaning} | schema
        properties[field.name] = schema
    found = {"description": _docstring_summary(kind), "type": "object", "properties": properties}
    return found | ({"required": required} if required else {}) | {"additionalProperties": False}


def _type_schema(kind: Any, parts: dict[str, Any]) -> dict[str, Any]:
    """The schema of a type; schemas of dataclasses in mappings are added to `parts`."""
    origin, arguments = typing.get_origin(kind), typing.get_args(kind)
    if origin in (typing.Union, types.UnionType):
        (inner,) = (a for a in arguments if a is not type(None))
        return _nullable_schema(_type_schema(inner, parts))
    if origin is typing.Literal:
        return {"enum": list(arguments)}
    if origin in (list, tuple):
        if len({*arguments} - {...}) != 1:
            raise TypeError(f"type {kind} has no schema yet")
        schema: dict[str, Any] = {"type": "array", "items": _type_schema(arguments[0], parts)}
        if origin is tuple and ... not in arguments:
            schema["minItems"] = schema["maxItems"] = len(arguments)
        return schema
    if origin in (dict, Mapping):
        return {"type": "object", "additionalProperties": _type_schema(arguments[1], parts)}
    if dataclasses.is_dataclass(kind):
        name = typing.cast(type, kind).__name__
        if name not in parts:
            parts[name] = {}
            parts[name] |= _dataclass_schema(typing.cast(type, kind), parts)
        return {"$ref": f"#/definitions/{name}"}
    if isinstance(kind, type) and issubclass(kind, enum.Enum):
        return {"enum": [member.value for member in kind]}
    return {"type": _JSON_TYPES[kind]} if _JSON_TYPES[kind] else {}


def _nullable_schema(schema: dict[str, Any]) -> dict[str, Any]:
    """A schema that also allows null."""
    if "enum" in schema:
        return {"enum": [*schema["enum"], None]}
    if "$ref" in schema:
        return {"anyOf": [schema, {"type": "null"}]}
    named = schema["type"]
    return schema | {"type": [*([named] if isinstance(named, str) else named), "null"]}


def _add_range(schema: dict[str, Any], low: float, high: float) -> None:
    """Adds a range to the schema of a number or a list of numbers."""
    schema = schema.get("items", schema)
    schema |= {name: x for name, x in (("minimum", low), ("maximum", high)) if math.isfinite(x)}


def _docstring_summary(kind: type) -> str:
    """The first paragraph of a dataclass's docstring."""
    return " ".join((inspect.getdoc(kind) or "").partition("\n\n")[0].split())


def _field_descriptions(kind: type) -> dict[str, str]:
    """Descriptions of a dataclass's fields, from its docstring and those of its bases."""
    found = {"version": "Version of the file format."}
    for base in reversed(kind.__mro__):
        text = inspect.cleandoc(base.__doc__ or "").partition("Attributes:\n")[2]
        text = re.split(r"^[A-Z]\w+:$", text, maxsplit=1, flags=re.MULTILINE)[0]
        for names, meaning in _ATTRIBUTE_ENTRY.findall(inspect.cleandoc(text)):
            sentence = " ".join(meaning.split())
            sentence = re.sub(r"^[a-z]{3,}\b", lambda word: word[0].capitalize(), sentence)
            found |= dict.fromkeys(re.split(r",\s*", names), sentence)
    return found
