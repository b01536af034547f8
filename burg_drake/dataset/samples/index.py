"""The index of a data set: its shards, with how many samples each of them has.

Its format is that of the library `wids` for random access to WebDataset's shards
(https://webdataset.github.io/webdataset/wids). It follows from the shards, and can be made anew
from them at any time.
"""

from __future__ import annotations

import json
import re
from collections.abc import Mapping
from dataclasses import asdict
from pathlib import Path

from burg_drake.core import DocumentError, InvalidInputError
from burg_drake.core.documents import load_json
from burg_drake.core.files import Limits, atomic_write
from burg_drake.dataset.samples.document import FILE as DOCUMENT_FILE, load_dataset_document
from burg_drake.dataset.samples.plain_fields import PlainFields
from burg_drake.dataset.samples.shard import FOLDER, ShardEntry, shard_entry

FILE = "index.json"
WIDS_VERSION = 1
LIMITS = Limits(size=256 << 20, values=10_000_000)
"""Of an index; a shard takes 150 bytes of it, and 6 values."""
SHARD = re.compile(r"(\d{6,12})\.tar", re.ASCII)
"""Names of shards."""
KEYS = ("url", "nsamples", "filesize", "md5sum")


def shard_numbers(folder: Path) -> list[int]:
    """Scenes whose shards lie in a data set, in their order."""
    shards = folder / FOLDER
    names = [path.name for path in shards.iterdir()] if shards.is_dir() else []
    matches = filter(None, map(SHARD.fullmatch, names))
    return sorted(int(match[1]) for match in matches)


def write_index(folder: str | Path, known: Mapping[str, ShardEntry] | None = None) -> None:
    """Writes the index of the shards that are there.

    Args:
        folder: of the data set.
        known: lines of shards by url that need not be made anew, as `write_shard` has just
            returned them; all others are read whole for their check sums.

    Raises:
        InvalidInputError: it is no data set, a shard is damaged, or the index cannot be written.
    """
    folder, known = Path(folder), known or {}
    document = load_dataset_document(folder / DOCUMENT_FILE)
    urls = {f"{FOLDER}/{number:06d}.tar" for number in shard_numbers(folder)}
    entries = [
        known[url] if url in known else shard_entry(folder / url)
        for url in sorted(urls, key=_scene)
    ]
    values = {
        "wids_version": WIDS_VERSION,
        "name": document.name,
        "shardlist": [asdict(entry) for entry in entries],
    }
    atomic_write(folder / FILE, json.dumps(values, indent=1) + "\n")


def read_index(folder: Path) -> list[ShardEntry]:
    """The lines of an index.

    Raises:
        DocumentError: it is damaged, or of another version.
        InvalidInputError: it is missing.
    """
    path = folder / FILE
    if not path.exists():
        raise InvalidInputError(
            f"{folder} has no {FILE}, so the data set is not finished; run the command that makes"
            " it again, or call burg_drake.dataset.samples.write_index on the folder to use the"
            " samples that are there"
        )
    fields = PlainFields(load_json(path, LIMITS), ("wids_version", "name", "shardlist"), str(path))
    fields.whole("wids_version", WIDS_VERSION, WIDS_VERSION)
    entries = [
        ShardEntry(
            line.text("url"),
            line.whole("nsamples"),
            line.whole("filesize"),
            line.text("md5sum"),
        )
        for line in fields.each("shardlist", KEYS)
    ]
    urls = [entry.url for entry in entries]
    for url in urls:
        place, _, name = url.rpartition("/")
        if place != FOLDER or not SHARD.fullmatch(name):
            raise DocumentError(
                f"{path}: shardlist: url is {url!r}; expected a value such as {FOLDER}/000012.tar"
            )
    if urls != sorted(set(urls), key=_scene):
        raise DocumentError(f"{path}: shardlist: shards are repeated or not in ascending order")
    return entries


def scene_of(entry: ShardEntry) -> int:
    """Number of the scene that a line of the index is of."""
    return _scene(entry.url)


def _scene(url: str) -> int:
    return int(Path(url).stem)
