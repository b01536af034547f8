"""The document of a data set (`dataset.yaml`) and the index of its shards (`index.json`)."""

from __future__ import annotations

import dataclasses
import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

from burg_drake.core import (
    DocumentError,
    InvalidInputError,
    Limits,
    atomic_write,
    load_document,
    load_json,
    plain_data,
    quote_value,
    require_name,
    save_document,
)
from burg_drake.dataset.shards import (
    SHARD_FOLDER,
    SHARD_URL,
    ShardEntry,
    shard_entry,
    shard_name,
)

DATASET_FILE = "dataset.yaml"  # File name of the document.
RECIPE_KEY = "recipe"  # Key of the recipe in the document.


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
        """Differences from `other`, in words that call `other` "here" and this document "there".
        Compares contents of libraries and stations, not their paths; and only versions of software
        that affects samples. Ignores names."""
        max_shown = 6  # Differences in a message.
        there, here = _deciding_values(self), _deciding_values(other)
        found = [
            f"{name} is {_format_value(there.get(name))} there,"
            f" {_format_value(here.get(name))} here"
            for name in dict.fromkeys([*there, *here])
            if there.get(name) != here.get(name)
        ]
        if len(found) > max_shown:
            found[max_shown:] = [f"{len(found) - max_shown} others"]
        return found


def load_dataset_document(path: str | Path) -> DatasetDocument:
    """Reads `dataset.yaml`.

    Raises:
        DocumentError: the file is missing, of another version, or a key or value is invalid; the
            message names file, line and key.
    """
    return load_document(path, DatasetDocument)


def save_dataset_document(document: DatasetDocument, path: str | Path) -> None:
    """Writes `dataset.yaml` atomically."""
    header = "What the samples of this data set are of, and what they were made with."
    recipe = None if document.recipe is None else plain_data(dict(document.recipe))
    save_document(dataclasses.replace(document, recipe=recipe), path, header)


def _deciding_values(document: DatasetDocument) -> dict[str, Any]:
    """Values that affect samples, by their names in messages."""
    # Software whose versions affect samples.
    deciding_packages = ("burg_drake", "drake", "numpy", "scipy", "embreex", "opencv", "blender")
    values: dict[str, Any] = {
        "objects": list(document.objects),
        "the content of the library": document.library_content,
        "the content of the station": document.station_content,
        "the content of the library of distractors": document.distractors_content,
    }
    values |= {name: document.versions.get(name, "unknown") for name in deciding_packages}
    return values | _flatten(plain_data(document.recipe), RECIPE_KEY)


def _flatten(value: Any, name: str) -> dict[str, Any]:
    """Values of nested mappings, by dotted names."""
    if not isinstance(value, Mapping):
        return {name: value}
    return {
        long: item
        for key, inner in value.items()
        for long, item in _flatten(inner, f"{name}.{key}").items()
    }


def _format_value(value: Any) -> str:
    return "none" if value is None or value == "" else quote_value(value).strip("'")


SHARD_INDEX_FILE = "index.json"  # File name of the index.
WIDS_VERSION = 1  # Version of the index format of WebDataset.


def shard_numbers(folder: Path) -> list[int]:
    """Numbers of the scenes that have a shard in a data set, sorted."""
    shards = folder / SHARD_FOLDER
    urls = [f"{SHARD_FOLDER}/{path.name}" for path in shards.iterdir()] if shards.is_dir() else []
    return sorted({_scene_number(url) for url in urls if SHARD_URL.fullmatch(url)})


def write_index(folder: str | Path, known: Mapping[str, ShardEntry] | None = None) -> None:
    """Writes the index of all shards in a folder.

    Args:
        folder: folder of the data set.
        known: entries of shards by url, as `write_shard` returns them. All other shards are read
            completely for their checksums.

    Raises:
        InvalidInputError: the folder is no data set, a shard is damaged, or the index cannot be
            written.
    """
    folder, known = Path(folder), known or {}
    document = load_dataset_document(folder / DATASET_FILE)
    entries = []
    for url in map(shard_name, shard_numbers(folder)):
        entries.append(known[url] if url in known else shard_entry(folder / url))
    values = {
        "wids_version": WIDS_VERSION,
        "name": document.name,
        "shardlist": [asdict(entry) for entry in entries],
    }
    atomic_write(folder / SHARD_INDEX_FILE, json.dumps(values, indent=1) + "\n")


def read_index(folder: Path) -> list[ShardEntry]:
    """Reads the entries of an index.

    Raises:
        DocumentError: the index is damaged, or of another version.
        InvalidInputError: the index is missing.
    """
    limits = Limits(size=256 << 20, values=10_000_000)  # a shard needs 150 bytes and 6 values
    path = folder / SHARD_INDEX_FILE
    if not path.exists():
        raise InvalidInputError(
            f"{folder} has no {SHARD_INDEX_FILE}, so the data set is not finished; run the command"
            " that makes it again, or call burg_drake.dataset.write_index on the folder to use the"
            " samples that are there"
        )
    values = load_json(path, limits)
    version = values.get("wids_version") if isinstance(values, dict) else None
    if version != WIDS_VERSION:
        raise DocumentError(
            f"{path}: wids_version is {quote_value(version)}; this release reads version"
            f" {WIDS_VERSION}"
        )
    try:
        entries = [ShardEntry(**line) for line in values["shardlist"]]
    except (InvalidInputError, KeyError, TypeError) as error:
        raise DocumentError(f"{path}: shardlist: {error}") from error
    urls = [entry.url for entry in entries]
    if urls != sorted(set(urls), key=_scene_number):
        raise DocumentError(f"{path}: shardlist: shards are repeated or not in ascending order")
    return entries


def scene_of(entry: ShardEntry) -> int:
    """Number of the scene of an index entry."""
    return _scene_number(entry.url)


def _scene_number(url: str) -> int:
    return int(Path(url).stem)
