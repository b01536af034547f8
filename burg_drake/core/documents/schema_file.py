"""JSON Schemas of documents, made from their dataclasses: editors complete and check files by them.

Types, defaults, ranges (`RANGES` of a class) and docstrings of the dataclass are all there is to
say; docstrings are what editors show.
"""

from __future__ import annotations

import dataclasses
import enum
import inspect
import json
import math
import re
import types
import typing
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from burg_drake.core.documents.kinds import DOCUMENT_KINDS, SCHEMA_FOLDER, document_class
from burg_drake.core.documents.schema import plain_data
from burg_drake.core.files import atomic_write_all

SCHEMA_DIALECT = "http://json-schema.org/draft-07/schema#"
"""The newest draft that the YAML servers of all common editors complete and check by."""

_PLAIN: dict[Any, Any] = {
    bool: "boolean",
    int: "integer",
    float: "number",
    str: ["string", "number", "boolean"],  # `operator: 7` is a text for the reader as well
    Any: None,
}
_WORD = re.compile(r"^[a-z]{3,}\b")
_SECTION = re.compile(r"^[A-Z]\w+:$", re.MULTILINE)
_ENTRY = re.compile(r"^(\w[\w, ]*): (.*(?:\n .*)*)", re.MULTILINE)


def json_schema(kind: str) -> dict[str, Any]:
    """The JSON Schema (draft 7) of a kind of document.

    It has the type, default, range and meaning of every key. What involves several keys, such as
    "one of two", is left to the reader of the document.

    Args:
        kind: such as `scene`; `DOCUMENT_KINDS` has all.

    Raises:
        UnknownNameError: there is no such kind.
    """
    document = document_class(kind)
    parts: dict[str, Any] = {}
    body = _mapping(document, parts)
    if "version" in body["properties"]:
        body["required"] = ["version", *body.get("required", [])]
    head = {"$schema": SCHEMA_DIALECT, "$id": f"{SCHEMA_FOLDER}/{kind}.json", "title": kind}
    return head | body | ({"definitions": parts} if parts else {})


def schema_text(kind: str) -> str:
    """The text of the file of a schema; see `json_schema`."""
    return json.dumps(json_schema(kind), indent=2, ensure_ascii=False) + "\n"


def write_schemas(folder: str | Path) -> list[Path]:
    """Writes the schemas of all kinds of documents.

    Args:
        folder: for the files `scene.json`, `station.json`, ...; it is made if need be.

    Returns:
        The files.

    Raises:
        InvalidInputError: the folder cannot be written to.
    """
    texts = {Path(folder, f"{kind}.json"): schema_text(kind) for kind in DOCUMENT_KINDS}
    atomic_write_all(texts)
    return list(texts)


def _mapping(kind: type, parts: dict[str, Any]) -> dict[str, Any]:
    """The schema of a dataclass."""
    hints, meanings = typing.get_type_hints(kind), _meanings(kind)
    properties, required = {}, []
    for field in dataclasses.fields(kind):
        if not field.init:
            continue
        schema = _value(hints[field.name], parts)
        if field.name in (ranges := getattr(kind, "RANGES", {})):
            _bound(schema, *ranges[field.name])
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
    found = {"description": _summary(kind), "type": "object", "properties": properties}
    return found | ({"required": required} if required else {}) | {"additionalProperties": False}


def _value(kind: Any, parts: dict[str, Any]) -> dict[str, Any]:
    """The schema of a type; mappings of dataclasses are added to `parts` and referred to."""
    origin, arguments = typing.get_origin(kind), typing.get_args(kind)
    if origin in (typing.Union, types.UnionType):
        return _optional(_value(next(a for a in arguments if a is not type(None)), parts))
    if origin is typing.Literal:
        return {"enum": list(arguments)}
    if origin in (list, tuple):
        if len({*arguments} - {...}) != 1:
            raise TypeError(f"type {kind} has no schema yet")
        schema: dict[str, Any] = {"type": "array", "items": _value(arguments[0], parts)}
        if origin is tuple and ... not in arguments:
            schema["minItems"] = schema["maxItems"] = len(arguments)
        return schema
    if origin in (dict, Mapping):
        return {"type": "object", "additionalProperties": _value(arguments[1], parts)}
    if dataclasses.is_dataclass(kind):
        name = typing.cast(type, kind).__name__
        if name not in parts:
            parts[name] = {}
            parts[name] |= _mapping(typing.cast(type, kind), parts)
        return {"$ref": f"#/definitions/{name}"}
    if isinstance(kind, type) and issubclass(kind, enum.Enum):
        return {"enum": [member.value for member in kind]}
    return {"type": _PLAIN[kind]} if _PLAIN[kind] else {}


def _optional(schema: dict[str, Any]) -> dict[str, Any]:
    """The same, or null."""
    if "enum" in schema:
        return {"enum": [*schema["enum"], None]}
    if "$ref" in schema:
        return {"anyOf": [schema, {"type": "null"}]}
    named = schema["type"]
    return schema | {"type": [*([named] if isinstance(named, str) else named), "null"]}


def _bound(schema: dict[str, Any], low: float, high: float) -> None:
    """Adds a range to the schema of a number, or to that of the numbers of a list."""
    schema = schema.get("items", schema)
    schema |= {name: x for name, x in (("minimum", low), ("maximum", high)) if math.isfinite(x)}


def _summary(kind: type) -> str:
    """What a dataclass is: the first paragraph of its docstring."""
    return " ".join((inspect.getdoc(kind) or "").partition("\n\n")[0].split())


def _meanings(kind: type) -> dict[str, str]:
    """What fields of a dataclass mean, by its docstring and those of its bases."""
    found = {"version": "Version of the file format."}
    for base in reversed(kind.__mro__):
        text = inspect.cleandoc(base.__doc__ or "").partition("Attributes:\n")[2]
        for names, meaning in _ENTRY.findall(inspect.cleandoc(_SECTION.split(text)[0])):
            sentence = _WORD.sub(lambda word: word[0].capitalize(), " ".join(meaning.split()))
            found |= dict.fromkeys(re.split(r",\s*", names), sentence)
    return found
