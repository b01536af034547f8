"""Reads a data set: any sample by its index, and only the requested parts."""

from __future__ import annotations

import bisect
import itertools
import os
from collections.abc import Iterable, Iterator, Sequence
from functools import cached_property
from pathlib import Path
from typing import overload

from burg_drake.core import (
    DocumentError,
    InvalidInputError,
    UnknownNameError,
    list_names,
    resolve_reference,
    suggest_names,
)
from burg_drake.dataset.document import (
    DATASET_FILE as DOCUMENT_FILE,
    DatasetDocument,
    load_dataset_document,
    read_index,
    scene_of,
)
from burg_drake.dataset.sample import Sample
from burg_drake.dataset.sample_files import READABLE_PARTS, check_part_names
from burg_drake.dataset.shards import SampleShard, ShardEntry, open_shard
from burg_drake.dataset.writer import scene_name
from burg_drake.objects import ObjectLibrary, load_library
from burg_drake.scene import Scene, load_scene
from burg_drake.station import Station, load_station

REMAKE_SHARD_ADVICE = (
    "repeat the command that made the data set, which makes the shard again; if it does not, delete"
    " the shard first"
)
"""Ending of the messages about a damaged shard."""


class Dataset(Sequence[Sample]):
    """The samples of a data set, in the order of their scenes.

    Keeps no open files and no pixels, so that it can be pickled, and read by several processes and
    threads at once. Keys identify samples: `"000012_003" in dataset` and
    `dataset.index("000012_003")` read no images, and only the shard of that scene.

    Attributes:
        folder: folder of the data set.
        document: contents of the data set, and how it was made.
    """

    def __init__(
        self, folder: Path, document: DatasetDocument, entries: Sequence[ShardEntry]
    ) -> None:
        self.folder = folder
        self.document = document
        self._entries = tuple(entries)
        self._ends = tuple(itertools.accumulate(entry.nsamples for entry in entries))

    def __repr__(self) -> str:
        return f"Dataset({self.document.name!r}, {len(self)} samples, {str(self.folder)!r})"

    def __len__(self) -> int:
        return self._ends[-1] if self._ends else 0

    @overload
    def __getitem__(self, index: int) -> Sample: ...
    @overload
    def __getitem__(self, index: slice) -> list[Sample]: ...
    def __getitem__(self, index: int | slice) -> Sample | list[Sample]:
        if isinstance(index, slice):
            return [self.read(i) for i in range(*index.indices(len(self)))]
        return self.read(index)

    def read(self, index: int | str, images: Iterable[str] = READABLE_PARTS) -> Sample:
        """Reads the requested parts of a sample.

        Args:
            index: index of the sample, from 0, or negative from the end; or its key.
            images: parts to decode: `color`, `depth`, `labels`, `normals`, `sensor_depth` and
                `grasps`. Parts that the sample lacks are None.

        Raises:
            IndexError: there is no such sample.
            UnknownNameError: there is no sample of that key, or no such part.
            InvalidInputError: the shard or a file of the sample is missing or damaged; the message
                names both.
        """
        requested_parts = check_part_names(images)
        shard, key = self._place(self.index(index) if isinstance(index, str) else index)
        try:
            return shard.sample(shard.record(key), requested_parts)
        except DocumentError:  # another version, or no sample: making it again does not help
            raise
        except InvalidInputError as error:
            raise InvalidInputError(f"{error}; {REMAKE_SHARD_ADVICE}") from error

    def parts(self, index: int) -> tuple[str, ...]:
        """Names of the parts that a sample has; see `read`. Decodes nothing.

        Raises:
            IndexError, InvalidInputError: as `read`.
        """
        shard, key = self._place(index)
        return shard.record(key).files

    @cached_property
    def keys(self) -> tuple[str, ...]:
        """Keys of all samples, such as `000012_003`. Reads the headers of all shards, once.

        Raises:
            InvalidInputError: a shard is missing or damaged.
        """
        return tuple(
            key for number in range(len(self._entries)) for key in self._shard(number).keys
        )

    @property
    def scenes(self) -> tuple[int, ...]:
        """Numbers of the scenes."""
        return tuple(map(scene_of, self._entries))

    def indices(self, scene: int) -> range:
        """Indices of the samples of a scene.

        Raises:
            UnknownNameError: no such scene.
        """
        place = self._scene_place(scene)
        return range(self._ends[place] - self._entries[place].nsamples, self._ends[place])

    @property
    def name(self) -> str:
        """Name of the data set."""
        return self.document.name

    @property
    def objects(self) -> tuple[str, ...]:
        """Names of the library's objects, in the order of their ids from 1."""
        return self.document.objects

    @cached_property
    def library(self) -> ObjectLibrary:
        """Library of the objects.

        Raises:
            UnknownNameError: the library does not exist any more.
        """
        return load_library(resolve_reference(self.document.library, "models", self.folder))

    @cached_property
    def station(self) -> Station:
        """Station of the scenes.

        Raises:
            InvalidInputError: the data set names no station.
            UnknownNameError: the station does not exist any more.
        """
        if not self.document.station:
            raise InvalidInputError(f"{self.folder} has no station: its document does not name one")
        return load_station(resolve_reference(self.document.station, "stations", self.folder))

    def index(self, value: Sample | str, start: int = 0, stop: int | None = None) -> int:
        """Index of a sample, or of the sample with a key.

        Raises:
            UnknownNameError: no such sample between `start` (included) and `stop` (excluded).
            InvalidInputError: the shard of its scene is missing or damaged.
        """
        key = value if isinstance(value, str) else value.key
        scene, known = key.partition("_")[0], {f"{one:06d}": one for one in self.scenes}
        if scene not in known:
            raise UnknownNameError(
                f"{self.folder} has no sample {key!r} and no scene {scene!r}; its scenes are"
                f" {list_names(list(known))}"
            )
        number = known[scene]
        indices, keys = self.indices(number), self._shard(self._scene_place(number)).keys
        if key not in keys or indices[keys.index(key)] not in range(len(self))[start:stop]:
            raise UnknownNameError(
                f"{self.folder} has no sample {key!r}; {suggest_names(key, keys)}"
            )
        return indices[keys.index(key)]

    def __contains__(self, value: object) -> bool:
        """Whether the data set has this key, or the key of this sample.

        Raises:
            InvalidInputError: the shard of its scene is missing or damaged.
        """
        if not isinstance(value, Sample | str):
            return False
        try:
            self.index(value)
        except UnknownNameError:
            return False
        return True

    def count(self, value: Sample | str) -> int:
        """1 if the data set has the sample, else 0, as keys are unique."""
        return int(value in self)

    def scene(self, number: int) -> Scene:
        """A scene, with its library.

        Raises:
            UnknownNameError: no such scene, or no such library.
            DocumentError: its document is damaged.
        """
        self._scene_place(number)
        return load_scene(self.folder / scene_name(number))

    def _scene_place(self, number: int) -> int:
        if number not in self.scenes:
            raise UnknownNameError(f"{self.folder} has no scene {number}")
        return self.scenes.index(number)

    def _place(self, index: int) -> tuple[SampleShard, str]:
        """Shard and key of a sample."""
        if not -len(self) <= index < len(self):
            raise IndexError(f"{self.folder} has no sample {index}; it has {len(self)} samples")
        index %= len(self)
        number = bisect.bisect_right(self._ends, index)
        shard = self._shard(number)
        return shard, shard.keys[index - self._ends[number] + self._entries[number].nsamples]

    def _shard(self, number: int) -> SampleShard:
        """The shard of an entry of the index.

        Raises:
            InvalidInputError: the shard is missing, or does not match the entry.
        """
        entry = self._entries[number]
        path = self.folder / entry.url
        try:
            shard = open_shard(path)
        except InvalidInputError as error:
            raise InvalidInputError(f"{error}; {REMAKE_SHARD_ADVICE}") from error
        size = os.stat(path).st_size
        if size != entry.filesize:
            raise InvalidInputError(
                f"shard {path} was changed: it has {size} bytes, but the index says"
                f" {entry.filesize}; {REMAKE_SHARD_ADVICE}"
            )
        if len(shard.keys) != entry.nsamples:
            raise DocumentError(
                f"{path} has {len(shard.keys)} samples, but the index says {entry.nsamples};"
                f" {REMAKE_SHARD_ADVICE}"
            )
        return shard


def load_dataset(folder: str | Path) -> Dataset:
    """Opens a data set for reading.

    Opens no shard yet: a damaged shard raises an error when one of its samples is read; samples of
    other shards stay readable.

    Example::

        samples = burg.load_dataset("my_dataset")
        images = samples.read(0, images=("color", "depth", "labels")).images
        print(len(samples), images.color.shape)

    Args:
        folder: folder of the data set.

    Raises:
        InvalidInputError: the data set is not finished.
        DocumentError: its document or index is of another version, or damaged.
    """
    folder = Path(folder)
    if not (folder / DOCUMENT_FILE).is_file():
        raise InvalidInputError(f"{folder} is not a data set: {DOCUMENT_FILE} is missing")
    document = load_dataset_document(folder / DOCUMENT_FILE)
    return Dataset(folder, document, read_index(folder))


class ReadableSamples:
    """The readable samples of a data set; skips damaged ones and records why.

    Attributes:
        dataset: the data set.
        name, objects: name and objects of the data set.
        damaged: number of samples skipped so far, by error message (shard, file, remedy). All
            samples of a shard that cannot be opened share one message.
    """

    def __init__(self, dataset: Dataset) -> None:
        self.dataset = dataset
        self.damaged: dict[str, int] = {}
        self.name, self.objects = dataset.name, dataset.objects

    @property
    def library(self) -> ObjectLibrary:
        """Library of the objects."""
        return self.dataset.library

    def __len__(self) -> int:
        """Number of samples in the index, including damaged ones."""
        return len(self.dataset)

    def __getitem__(self, index: int, /) -> Sample:
        """A sample by its index; damaged samples count.

        Raises:
            InvalidInputError: the sample is damaged.
        """
        return self.dataset[index]

    def __iter__(self) -> Iterator[Sample]:
        return self.read(range(len(self)))

    def read(self, indices: Iterable[int]) -> Iterator[Sample]:
        """Reads samples one after the other.

        Args:
            indices: indices of the samples.

        Raises:
            InvalidInputError: at the end, if there were indices and no sample was readable.
        """
        found, first = False, None
        for index in indices:
            try:
                sample = self.dataset[index]
            except InvalidInputError as error:
                first = first or error
                self.damaged[str(error)] = self.damaged.get(str(error), 0) + 1
            else:
                found = True
                yield sample
        if first is not None and not found:
            raise InvalidInputError(
                f"no sample of {self.dataset.folder} can be read; the first error is: {first}"
            ) from first
