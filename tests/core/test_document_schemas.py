"""JSON Schemas of documents: an independent validator and our reader say the same of a file.

The validator gets YAML as editors read it, by the rules of YAML 1.2.
"""

from __future__ import annotations

import ast
import copy
import dataclasses
import importlib
import json
import re
from functools import cache
from pathlib import Path
from random import Random
from typing import Any

import pytest
import yaml
from hypothesis import HealthCheck, given, settings, strategies as st
from jsonschema import Draft7Validator

import burg_drake
from burg_drake.core import (
    DOCUMENT_KINDS,
    BurgError,
    Reader,
    UnknownNameError,
    data_root,
    document_class,
    document_text,
    json_schema,
    load_document,
    load_yaml_node,
    parse_document,
    write_schemas,
)
from burg_drake.dataset import load_dataset_document
from burg_drake.pipeline import load_recipe

ADDRESS = "https://burg-drake.github.io/burg_drake/schema/"
EXAMPLES = {path.stem: path for path in (Path(__file__).parent / "documents").iterdir()}
"""A sound document of each kind, with almost every key that there is."""
for kind in ("objects", "intrinsics", "pose", "run", "placement"):
    EXAMPLES[kind] = Path(__file__).parents[1] / "fuzzing" / "examples" / f"{kind}.yaml"
EXAMPLES["hand"] = data_root() / "models" / "hands" / "wsg_50.yaml"
BUILT_IN = [
    path
    for pattern in ("scenes/*.yaml", "stations/*.yaml", "models/hands/*.yaml", "models/*/*.yaml")
    for path in sorted(data_root().glob(pattern))
]
NOT_YAML = {"Appearance", "BuildRecord", "Comparison", "Nearest", "PrecisionRecall", "Matches"} | {
    *("TopPrecision", "SetComparison", "SetSummary", "RecordFields"),
}
"""Classes with a version that are written as JSON, or within another document."""
MUTATIONS = 12
"""Of the example of a kind."""
ONLY_THE_READER_REFUSES = {
    "one key decides about another": r"give (either|unit|mass|rpy)|with a jobqueue|with tls files"
    r"|needs the baseline|give only one|margin names|is less than|more than lift_height"
    r"|minimum is at most"
    r"|entries; expected|coefficients|depth images|both fingers|closed and open|simulated$",
    "a range that has to rise": r"must rise|at least grazing",
    "more than 0, or of many numbers": r"above 0|> 0|positive|below 0|or more|at least|each must be"
    r"|must be 0, or|one a joint",
    "directions and rotations": r"has length|has no length",
    "letters of names and dates": r"cannot be used in paths|is not a name|write it as in",
    "names of what is elsewhere": r"does not exist|neither the table|there is no|is of object"
    r"|not a part of the image",
    "something has to be there": r"is empty|are missing",
    "numbers that no document needs": r"too large a number",
    "1.0 is a whole number to JSON": r"\d\.?\d*(e\+?\d+)?' is not a whole number",
}
"""What a schema cannot say, or not in words that people understand: by reason, words of messages of
the reader."""
ONLY_THE_SCHEMA_REFUSES = {
    "a number in quotes": lambda put, marked: put == "7",
    "the version of a document within another": lambda put, marked: "version" in marked[0],
}
"""What the reader lets pass and an editor marks: by reason, whether it is that."""


class Yaml12(yaml.SafeLoader):
    """Reads plain scalars as YAML 1.2 does: `yes` is a text, and so is a date."""

    yaml_implicit_resolvers: dict[str, Any] = {}  # noqa: RUF012


for kind, pattern in {
    "null": r"~|null|Null|NULL|",
    "bool": r"true|True|TRUE|false|False|FALSE",
    "int": r"[-+]?[0-9]+",
    "float": r"[-+]?(\.[0-9]+|[0-9]+(\.[0-9]*)?)([eE][-+]?[0-9]+)?|[-+]?\.inf|\.nan",
}.items():
    Yaml12.add_implicit_resolver(f"tag:yaml.org,2002:{kind}", re.compile(f"^({pattern})$"), None)

Yaml12.add_constructor("tag:yaml.org,2002:int", lambda _, node: int(node.value))  # 010 is ten


def as_editors_read(text: str) -> Any:
    return json.loads(json.dumps(yaml.load(text, Loader=Yaml12)))  # keys are texts


@cache
def validator(kind: str) -> Draft7Validator:
    Draft7Validator.check_schema(schema := json_schema(kind))
    return Draft7Validator(schema)


def complaints(kind: str, data: Any) -> list[str]:
    return [f"{error.json_path}: {error.message}" for error in validator(kind).iter_errors(data)]


def refusal(kind: str, path: Path) -> str | None:
    """What the reader says against a file."""
    try:
        if kind == "pose":
            Reader(path.name).read(load_yaml_node(path), document_class(kind), "")
        elif kind == "dataset":
            load_dataset_document(path)
        elif kind == "objects":
            load_recipe(path)
        else:
            load_document(path, document_class(kind))
    except BurgError as error:
        return str(error)
    return None


def test_every_kind_has_an_example_here() -> None:
    assert set(EXAMPLES) == set(DOCUMENT_KINDS)


@pytest.mark.parametrize("kind", DOCUMENT_KINDS)
def test_sound_documents_fit(kind: str) -> None:
    data = as_editors_read(EXAMPLES[kind].read_text("utf-8"))
    assert complaints(kind, data) == []
    assert refusal(kind, EXAMPLES[kind]) is None


@pytest.mark.parametrize("path", BUILT_IN, ids=lambda path: path.stem)
def test_built_in_documents_name_the_schema_that_they_fit(path: Path) -> None:
    text = path.read_text("utf-8")
    found = re.fullmatch(r"# yaml-language-server: \$schema=(.*/)(\w+)\.json", text.split("\n")[0])
    assert found and found[1] == ADDRESS
    assert complaints(found[2], as_editors_read(text)) == []


@pytest.mark.parametrize("kind", DOCUMENT_KINDS)
def test_written_documents_name_their_schema(kind: str) -> None:
    if kind in ("pose", "dataset", "objects"):  # have readers of their own
        return
    known = parse_document(EXAMPLES[kind].read_text("utf-8"), document_class(kind), "example")
    text = document_text(known, "A header.\nOf two lines.")
    first, *rest = text.split("\n")
    assert first == f"# yaml-language-server: $schema={ADDRESS}{kind}.json"
    assert rest[:2] == ["# A header.", "# Of two lines."]
    assert complaints(kind, as_editors_read(text)) == []
    assert parse_document(text, document_class(kind), "again") == known


@pytest.mark.parametrize("kind", DOCUMENT_KINDS)
def test_every_key_is_explained(kind: str) -> None:
    schema = json_schema(kind)
    mappings = {kind: schema} | schema.get("definitions", {})
    assert [name for name, mapping in mappings.items() if not mapping["description"]] == []
    keys = {
        f"{name}.{k}": v for name, one in mappings.items() for k, v in one["properties"].items()
    }
    assert [key for key, value in keys.items() if not value.get("description")] == []


def test_all_documents_with_a_version_have_a_schema() -> None:
    known = {place.partition(":")[2] for place in DOCUMENT_KINDS.values()}
    found = set()
    for path in Path(burg_drake.__file__).parent.rglob("*.py"):
        if "    version: int = " not in (text := path.read_text("utf-8")):
            continue
        for node in ast.walk(ast.parse(text)):
            if isinstance(node, ast.ClassDef):
                fields = [f.target.id for f in node.body if isinstance(f, ast.AnnAssign)]
                found |= {node.name} if "version" in fields else set()
    assert found - NOT_YAML == known - {"Pose"}


def test_a_kind_that_does_not_exist() -> None:
    with pytest.raises(UnknownNameError, match=r"'scen'; .*'scene'"):
        json_schema("scen")


def test_all_schemas_are_written(tmp_path: Path) -> None:
    files = write_schemas(tmp_path / "schema")
    assert [file.stem for file in files] == list(DOCUMENT_KINDS)
    for file in files:
        schema = json.loads(file.read_text("utf-8"))
        assert schema["$id"] == f"{ADDRESS}{file.name}"


def test_the_page_has_all_keys_and_its_links_lead_somewhere(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.syspath_prepend(Path(__file__).parents[2] / "docs")
    text = importlib.import_module("_schemas").document_tables()
    for kind in DOCUMENT_KINDS:
        _, _, section = text.partition(f"(document-{kind})=\n## {kind}\n")
        rows = re.findall(r"^\| `(\w+)` \| .+ \|$", section.partition("\n(")[0], re.MULTILINE)
        assert rows == [f.name for f in dataclasses.fields(document_class(kind))]
    assert set(re.findall(r"\(#([\w-]+)\)", text)) <= set(re.findall(r"^\((.*)\)=$", text, re.M))


def mutated(data: Any, random: Random) -> Any:
    """A copy with one thing changed, and what was put in."""
    data = copy.deepcopy(data)
    places = [(data, key) for key in data]
    for node, key in places:  # grows meanwhile
        inner = node[key]
        if isinstance(inner, dict | list):
            places += [
                (inner, k) for k in (inner if isinstance(inner, dict) else range(len(inner)))
            ]
    node, key = random.choice(places)
    change = random.choice(("remove", "add", "type", "type", "range", "range"))
    put = None
    if change == "remove":
        del node[key]
    elif change == "add" and isinstance(node, dict):
        node["no_such_key"] = put = 1
    elif change == "range" and isinstance(node[key], int | float):
        node[key] = put = random.choice((-1, -1e6, 0, 1e7, 0.5, 1e40))
    else:
        node[key] = put = random.choice(
            (None, True, 7, 0.5, "a text", "7", [], [1, 2], {}, {"a": 1})
        )
    return data, put


@pytest.mark.parametrize("kind", DOCUMENT_KINDS)
def test_schema_and_reader_agree_about_changed_documents(kind: str, tmp_path: Path) -> None:
    sound = as_editors_read(EXAMPLES[kind].read_text("utf-8"))
    path = tmp_path / "a.yaml"

    @settings(
        max_examples=MUTATIONS,
        derandomize=True,
        database=None,
        deadline=None,
        suppress_health_check=list(HealthCheck),
    )
    @given(random=st.randoms(use_true_random=False))
    def check(random: Random) -> None:
        data, put = mutated(sound, random)
        path.write_text(json.dumps(data), encoding="utf-8")
        told, marked = refusal(kind, path), complaints(kind, data)
        if told and not marked:
            assert any(re.search(x, told) for x in ONLY_THE_READER_REFUSES.values()), told
        if marked and not told:
            assert any(may(put, marked) for may in ONLY_THE_SCHEMA_REFUSES.values()), marked

    check()
