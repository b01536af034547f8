"""The document of a data set: what it holds, and what it was made with."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import yaml

from burg_drake.core import quoted
from burg_drake.core.documents import Reader, load_nodes, plain_data, save_document
from burg_drake.core.paths import require_name

FILE = "dataset.yaml"
RECIPE = "recipe"
HEADER = "What the samples of this data set are of, and what they were made with."
DECIDING_VERSIONS = ("burg_drake", "drake", "numpy", "scipy", "embreex", "opencv", "blender")
"""Software whose versions decide about samples."""
SHOWN_DIFFERENCES = 6


@dataclass(frozen=True, kw_only=True)
class DatasetDocument:
    """What a data set holds and how it was made (`dataset.yaml`).

    Attributes:
        name: name of the data set.
        objects: names of the objects in the order of their ids, which count from 1.
        library: object library: its folder, relative to the data set, or the name of a built-in
            one.
        station: station: its file, relative to the data set, or the name of a built-in one; empty
            without one.
        library_content: hash of the library.
        station_content: hash of the station.
        distractors_content: hash of the library of distractors; empty without one.
        versions: versions of the software.
        recipe: how the samples were generated, as in a data set recipe; left out if they were not.
    """

    version: int = 1
    name: str
    objects: tuple[str, ...]
    library: str
    station: str = ""
    library_content: str = ""
    station_content: str = ""
    distractors_content: str = ""
    versions: dict[str, str] = field(default_factory=dict)
    recipe: Mapping[str, Any] | None = None

    def __post_init__(self) -> None:
        require_name(self.name, "name")

    def differences(self, other: DatasetDocument) -> list[str]:
        """What two differ in, in words; `other` is here, this is there. Of a library or a station
        its content counts, not where it is, and of the versions those in `DECIDING_VERSIONS`; the
        name does not count."""
        mine, theirs = _compared(self), _compared(other)
        found = [
            f"{name} is {_shown(mine.get(name))} there, {_shown(theirs.get(name))} here"
            for name in dict.fromkeys([*mine, *theirs])
            if mine.get(name) != theirs.get(name)
        ]
        if len(found) > SHOWN_DIFFERENCES:
            found[SHOWN_DIFFERENCES:] = [f"{len(found) - SHOWN_DIFFERENCES} others"]
        return found


def load_dataset_document(path: str | Path) -> DatasetDocument:
    """Reads `dataset.yaml`.

    Raises:
        DocumentError: it is missing, of another version, or a key or value does not fit; the
            message names file, line and key.
    """
    root = load_nodes(path)
    reader = Reader(str(path))
    if not isinstance(root, yaml.MappingNode):
        raise reader.fail(root, "", "expected the keys of a data set ('key: value' lines)")
    reader.check_version(root, DatasetDocument)
    recipe = [node for key, node in root.value if key.value == RECIPE]
    root.value = [(key, node) for key, node in root.value if key.value != RECIPE]
    if len(recipe) > 1:
        raise reader.fail(recipe[1], "", f"key {quoted(RECIPE)} is given twice")
    document: DatasetDocument = reader.read(root, DatasetDocument, "")
    if not recipe:
        return document
    plain = _plain(recipe[0], reader, RECIPE)
    if not isinstance(plain, dict | None):
        raise reader.fail(recipe[0], RECIPE, "expected keys with values ('key: value' lines)")
    return dataclasses.replace(document, recipe=plain)


def save_dataset_document(document: DatasetDocument, path: str | Path) -> None:
    """Writes `dataset.yaml`, whole or not at all."""
    recipe = None if document.recipe is None else plain_data(dict(document.recipe))
    save_document(dataclasses.replace(document, recipe=recipe), path, HEADER)


def _compared(document: DatasetDocument) -> dict[str, Any]:
    """Values that decide about samples, by their name for messages."""
    values: dict[str, Any] = {
        "objects": list(document.objects),
        "the content of the library": document.library_content,
        "the content of the station": document.station_content,
        "the content of the library of distractors": document.distractors_content,
    }
    values |= {name: document.versions.get(name, "unknown") for name in DECIDING_VERSIONS}
    return values | _flat(plain_data(document.recipe), RECIPE)


def _flat(value: Any, name: str) -> dict[str, Any]:
    """The values of nested mappings by their names with dots."""
    if not isinstance(value, Mapping):
        return {name: value}
    return {
        long: item
        for key, inner in value.items()
        for long, item in _flat(inner, f"{name}.{key}").items()
    }


def _shown(value: Any) -> str:
    return "none" if value is None or value == "" else quoted(value).strip("'")


def _plain(node: yaml.Node, reader: Reader, where: str) -> Any:
    """A node of any structure as dicts, lists and scalars."""
    if isinstance(node, yaml.MappingNode):
        return {
            name: _plain(value, reader, f"{where}.{name}")
            for name, (_, value) in reader.entries(node, where).items()
        }
    if isinstance(node, yaml.SequenceNode):
        return [_plain(item, reader, f"{where}[{i}]") for i, item in enumerate(node.value)]
    kind = node.tag.rpartition(":")[2]
    if kind == "null":
        return None
    kinds: dict[str, type] = {"bool": bool, "int": int, "float": float}
    return reader.read(node, kinds.get(kind, str), where)
