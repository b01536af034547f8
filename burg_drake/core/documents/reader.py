"""Turns YAML nodes, which know their line, into typed values; every error names file, line, key."""

from __future__ import annotations

import dataclasses
import enum
import functools
import math
import re
import types
import typing
from collections.abc import Sequence
from typing import Any, ClassVar

import yaml

from burg_drake.core.errors import (
    DocumentError,
    FieldError,
    InvalidInputError,
    nearest,
    quoted,
    shown,
)

LARGEST = 1e30
"""Above all numbers that a document has a use for, in any unit."""
LARGEST_WHOLE = 1 << 64
"""The same of whole numbers; seeds may have 64 bits."""


class Reader:
    """Turns YAML nodes into typed values; every error names file, line and key.

    `LINES` is False in classes whose text is not one that the user has written.
    """

    LINES: ClassVar[bool] = True

    def __init__(self, name: str) -> None:
        self.name = name

    def fail(self, node: yaml.Node, where: str, what: str) -> DocumentError:
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
            raise self.fail(node, "", f"not a {kind}; one has the keys {keys}")
        for key, value in node.value:
            if key.value == "version":
                given = value.value if isinstance(value, yaml.ScalarNode) else "a structure"
                if given != str(current):
                    what = f"{shown(given)} cannot be read; this release reads version {current}"
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
            members = {str(m.value): m for m in kind}
            return self.choice(node, where, members, ordered=True)
        return self.read_scalar(node, kind, where)

    def read_optional(self, node: yaml.Node, kind: Any, where: str) -> Any:
        options = [a for a in typing.get_args(kind) if a is not type(None)]
        if node.tag == "tag:yaml.org,2002:null":
            return None
        if len(options) != 1:
            raise TypeError(f"schema type {kind} is not supported")
        return self.read(node, options[0], where)

    def choice(
        self, node: yaml.Node, where: str, options: dict[str, Any], *, ordered: bool = False
    ) -> Any:
        if not isinstance(node, yaml.ScalarNode) or node.value not in options:
            given = node.value if isinstance(node, yaml.ScalarNode) else "a structure"
            known = nearest(str(given), options, ordered=ordered)
            raise self.fail(node, where, f"{quoted(given)} is not valid; {known}")
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
                raise self.fail(key, where, "a key must be a text, not a list or a mapping")
            if key.value in found:
                raise self.fail(key, where, f"key {quoted(key.value)} is given twice")
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
        hints = _hints(kind)
        fields = {f.name: f for f in dataclasses.fields(kind) if f.init}
        prefix = f"{where}." if where else ""
        for name, (key, _) in entries.items():
            if name not in fields:
                raise self.fail(key, where, f"unknown key {quoted(name)}; {nearest(name, fields)}")
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
        except FieldError as error:
            raise self.fail(_inside(node, error.place), where, str(error)) from error
        except InvalidInputError as error:
            if not where:  # somewhere in the document
                raise DocumentError(f"{self.name}: {error}") from error
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
            if "\0" in node.value:  # which no path and no name has
                raise self.fail(node, where, f"{quoted(node.value)} has a NUL character")
            return node.value
        if kind is bool and node.value.lower() in ("true", "false"):
            return node.value.lower() == "true"
        try:
            value = math.nan if kind is bool else kind(node.value)
        except ValueError:  # also of whole numbers of 4,300 digits
            value = math.nan
        if abs(value) < (LARGEST_WHOLE if kind is int else LARGEST):
            return value
        if abs(value) < math.inf:
            raise self.fail(node, where, f"{quoted(node.value)} is too large a number")
        raise self.fail(node, where, f"{quoted(node.value)} is not {expected[kind]}")


@functools.cache
def _hints(kind: type) -> dict[str, Any]:
    """Types of a dataclass's fields: to find them takes longer than to read one."""
    return typing.get_type_hints(kind)


def _inside(node: yaml.Node, place: Sequence[str | int]) -> yaml.Node:
    """The node of a value within that of its document; one around it if it is not written."""
    for step in place:
        if isinstance(node, yaml.MappingNode):
            found = {key.value: value for key, value in node.value}.get(step)
        else:
            found = node.value[step] if isinstance(step, int) else None
        if not isinstance(found, yaml.Node):
            break
        node = found
    return node
