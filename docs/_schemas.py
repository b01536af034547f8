"""The reference of documents: tables of all keys for the page, and the schemas for editors.

As an extension of Sphinx it adds the tables to `reference/documents.md`, and files such as
`schema/scene.json` to the site.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from burg_drake.core import DOCUMENT_KINDS, json_schema, write_schemas

PAGE = "reference/documents"


def document_tables() -> str:
    """Markdown (MyST) with a table of keys for each kind of document, and for each nested part."""
    schemas = {kind: json_schema(kind) for kind in DOCUMENT_KINDS}
    parts: dict[str, Any] = {}
    for schema in schemas.values():
        parts |= schema.get("definitions", {})
    sections = [_section(kind, f"document-{kind}", schema) for kind, schema in schemas.items()]
    parts_title = "## Parts\n\nMappings within documents, by name.\n"
    sections += [parts_title, *(_section(n, _target(n), parts[n], "###") for n in sorted(parts))]
    return "\n".join(sections)


def _section(title: str, target: str, schema: dict[str, Any], level: str = "##") -> str:
    required = schema.get("required", ())
    rows = [
        f"| `{key}` | {_type(value)} | {_default(value, key in required)} | {_meaning(value)} |"
        for key, value in schema["properties"].items()
    ]
    head = "| key | type | default | meaning |\n|---|---|---|---|\n"
    return (
        f"({target})=\n{level} {title}\n\n{schema['description']}\n\n{head}"
        + "\n".join(rows)
        + "\n"
    )


def _target(part: str) -> str:
    return f"part-{part.lower()}"


def _type(value: dict[str, Any]) -> str:
    """What a value is, in words; parts are links."""
    if "$ref" in value:
        part = value["$ref"].rpartition("/")[2]
        return f"[{part}](#{_target(part)})"
    if "anyOf" in value:
        return " or ".join(map(_type, value["anyOf"]))
    if "const" in value:
        return f"`{value['const']}`"
    if "enum" in value:
        return ", ".join("null" if name is None else f"`{name}`" for name in value["enum"])
    kinds = value.get("type", "anything")
    kinds = [kinds] if isinstance(kinds, str) else kinds
    if kinds == ["null"]:
        return "null"
    null = " or null" if "null" in kinds else ""
    if kinds[0] == "array":
        count = f"{value['minItems']} " if "minItems" in value else ""
        return f"list of {count}{_plural(_type(value['items']))}{null}"
    if kinds[0] == "object":
        inner = value.get("additionalProperties")
        return (f"{_type(inner)} by name" if inner else "mapping") + null
    names = {"string": "text", "integer": "whole number", "boolean": "true or false"}
    return names.get(kinds[0], kinds[0]) + _range(value) + null


def _range(value: dict[str, Any]) -> str:
    low, high = value.get("minimum"), value.get("maximum")
    if low is None:
        return ""
    return f", {low:g} to {high:g}" if high is not None else f", {low:g} or more"


def _plural(type: str) -> str:
    for one in ("number", "text"):
        if type == one or type.startswith((f"{one},", f"whole {one}")):
            return type.replace(one, f"{one}s", 1)
    return type


def _default(value: dict[str, Any], required: bool) -> str:
    if required:
        return "required"
    return f"`{json.dumps(value['default'])}`" if "default" in value else ""


def _meaning(value: dict[str, Any]) -> str:
    return str(value["description"]).replace("|", "\\|")


def _add_tables(app: Any, page: str, source: list[str]) -> None:
    if page == PAGE:
        source[0] += "\n" + document_tables()


def _write_schemas(app: Any, error: Exception | None) -> None:
    if error is None and app.builder.format == "html":
        write_schemas(Path(app.outdir, "schema"))


def setup(app: Any) -> dict[str, Any]:
    """Called by Sphinx."""
    app.connect("source-read", _add_tables)
    app.connect("build-finished", _write_schemas)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
