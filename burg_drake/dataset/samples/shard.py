"""Shards: the samples of a scene as one tar archive, whole or not there at all."""

from __future__ import annotations

import functools
import hashlib
import os
import secrets
from collections.abc import Iterable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO

from burg_drake.core import DocumentError, InvalidInputError, shown
from burg_drake.core.files import keep_mode, open_regular
from burg_drake.dataset.samples.record import SampleRecord
from burg_drake.dataset.samples.sample import Sample
from burg_drake.dataset.samples.sample_files import (
    SUFFIXES,
    encoded,
    member_kind,
    read_parts,
    read_record,
)
from burg_drake.dataset.samples.tar import (
    TAR_END,
    MemberPlace,
    read_member,
    tar_member,
    tar_members,
)

FOLDER = "shards"
CHECKSUM_CHUNK_BYTES = 1 << 20
"""Bytes that are read for a check sum."""
KEPT = 256
"""Shards whose headers a process keeps; those of 20 samples take 40 kB."""


@dataclass(frozen=True)
class ShardEntry:
    """A line of the index.

    Attributes:
        url: of the shard, relative to the data set.
        nsamples: in it.
        filesize: bytes.
        md5sum: of the file, as 32 hexadecimal digits.
    """

    url: str
    nsamples: int
    filesize: int
    md5sum: str


def shard_name(scene: int) -> str:
    """Path of the shard of a scene, relative to the data set."""
    return f"{FOLDER}/{scene:06d}.tar"


def write_shard(path: str | Path, samples: Iterable[Sample]) -> ShardEntry:
    """Writes the samples of a scene beside `path`, one by one, and renames the file into place.

    Several processes can write at once, each another shard. The same samples give the same bytes.

    Args:
        path: the file, named after the scene's number, as in `shards/000012.tar`.
        samples: of that scene; they may be made as they are asked for.

    Returns:
        Its line of the index.

    Raises:
        InvalidInputError: the disk is full or cannot be written to; a sample is of another scene,
            is there twice, or does not fit itself. Nothing stays of the shard then.
    """
    path = Path(path)
    digest = hashlib.md5(usedforsecurity=False)
    seen: set[str] = set()
    size = 0
    with _renamed_when_whole(path) as stream:

        def write(data: bytes) -> None:
            nonlocal size
            with _reporting(path):
                stream.write(data)
            digest.update(data)
            size += len(data)

        for sample in samples:
            if f"{sample.scene:06d}" != path.stem or sample.key in seen:
                where = "there already" if sample.key in seen else "of another scene"
                raise InvalidInputError(
                    f"cannot write sample {sample.key} to {path}: it is {where}"
                )
            seen.add(sample.key)
            for name, data in encoded(sample):
                write(tar_member(name, data))
        write(TAR_END)
    return ShardEntry(f"{FOLDER}/{path.name}", len(seen), size, digest.hexdigest())


def write_made_shard(path: Path, data: bytes) -> None:
    """Writes the bytes of a shard that was made elsewhere, as `write_shard` does.

    Raises:
        InvalidInputError: the disk is full or cannot be written to; nothing stays of it then.
    """
    with _renamed_when_whole(path) as stream, _reporting(path):
        stream.write(data)


def shard_entry(path: Path) -> ShardEntry:
    """The line of the index of a shard that is there.

    Raises:
        InvalidInputError: it is damaged.
    """
    return ShardEntry(f"{FOLDER}/{path.name}", len(open_shard(path).keys), *file_sum(path))


def file_sum(path: Path) -> tuple[int, str]:
    """Size [bytes] and MD5 of a file.

    Raises:
        InvalidInputError: it cannot be read.
    """
    digest, size = hashlib.md5(usedforsecurity=False), 0
    with open_regular(path) as stream:
        try:
            while data := stream.read(CHECKSUM_CHUNK_BYTES):
                digest.update(data)
                size += len(data)
        except OSError as error:
            raise InvalidInputError(f"cannot read {path}: {error.strerror or error}") from error
    return size, digest.hexdigest()


class SampleShard:
    """A shard that is read; it holds no open file.

    Attributes:
        path: of the file.
        samples: by key, in the order of the archive: for each kind of its files where it is.
        strangers: names of members that belong to no sample of the scene.
    """

    def __init__(self, path: Path) -> None:
        """Reads the headers; see `open_shard`."""
        self.path = path
        self.samples: dict[str, dict[str, MemberPlace]] = {}
        self.strangers: list[str] = []
        for name, place in tar_members(path).items():
            key_kind = member_kind(name)
            if key_kind is None or key_kind[0].partition("_")[0] != path.stem:
                self.strangers.append(name)
                continue
            key, kind = key_kind
            self.samples.setdefault(key, {})[kind] = place

    @property
    def keys(self) -> list[str]:
        """Of its samples, in their order."""
        return list(self.samples)

    def record(self, key: str) -> SampleRecord:
        """The record of a sample.

        Raises:
            InvalidInputError: see `read_record`.
        """
        return read_record(key, self._reader(key), str(self.path))

    def sample(self, record: SampleRecord, parts: Iterable[str]) -> Sample:
        """The sample of a record, with the parts that are asked for.

        Raises:
            InvalidInputError: see `read_parts`.
        """
        return read_parts(record, parts, self._reader(record.sample.key), str(self.path))

    def _reader(self, key: str) -> _Reader:
        return _Reader(self.path, key, self.samples[key])


def open_shard(path: Path) -> SampleShard:
    """A shard for reading; its headers are read once while the file is the same.

    Raises:
        InvalidInputError: it is missing, cut off, damaged, has a member twice, or one that is no
            plain file; the message names shard and member.
    """
    try:
        state = os.stat(path)
    except OSError as error:
        raise InvalidInputError(f"cannot read shard {path}: {error.strerror or error}") from error
    return _open_shard(path, state.st_size, state.st_mtime_ns)


@functools.lru_cache(maxsize=KEPT)
def _open_shard(path: Path, size: int, changed: int) -> SampleShard:
    """The shard as it was with this size and time of change."""
    del size, changed
    return SampleShard(path)


@dataclass(frozen=True)
class _Reader:
    """Reads files of a sample by their kind."""

    path: Path
    key: str
    places: dict[str, MemberPlace]

    def __call__(self, kind: str, most: int) -> bytes:
        name = f"{self.key}.{SUFFIXES[kind]}"
        if kind not in self.places:
            raise DocumentError(f"{self.path}: {name} is missing")
        if self.places[kind].size > most:
            raise DocumentError(f"{self.path}: {name} has more than the {most} bytes allowed")
        return read_member(self.path, self.places[kind])


@contextmanager
def _renamed_when_whole(path: Path) -> Iterator[BinaryIO]:
    """A new file beside `path`, which takes its place when the block ends well."""
    beside = path.with_name(f".{path.name}.{secrets.token_hex(8)}")  # as `UNFINISHED` has it
    try:
        with _reporting(path):
            path.parent.mkdir(parents=True, exist_ok=True)
            stream = beside.open("xb")
        try:
            keep_mode(path, stream.fileno())
            yield stream
            with _reporting(path):
                stream.flush()
                os.fsync(stream.fileno())
        finally:
            with suppress(OSError):  # what a full disk has not taken has been reported
                stream.close()
        with _reporting(path):
            os.replace(beside, path)
    finally:
        beside.unlink(missing_ok=True)


@contextmanager
def _reporting(path: Path) -> Iterator[None]:
    try:
        yield
    except OSError as error:
        raise InvalidInputError(
            f"cannot write {shown(str(path), 500)}: {error.strerror or error}; all shards except"
            " this one are kept: make room, and run the same command to continue"
        ).about("folder") from error
