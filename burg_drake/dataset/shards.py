"""Shards: the samples of a scene in one tar archive with reproducible bytes."""

from __future__ import annotations

import functools
import hashlib
import os
import re
import secrets
import tarfile
from collections.abc import Iterable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass, replace
from pathlib import Path
from typing import BinaryIO

from burg_drake.core import (
    DocumentError,
    FileLimits,
    InvalidInputError,
    copy_permissions,
    open_regular,
    quote_value,
    shorten_text,
)
from burg_drake.dataset.sample import Sample
from burg_drake.dataset.sample_encoding import decode_grasps, decode_image_of, require_fitting
from burg_drake.dataset.sample_files import (
    FILE_SUFFIXES,
    GRASPS_KIND,
    RECORD_KIND,
    SampleRecord,
    encode_sample,
    member_kind,
    parse_record,
)

TAR_BLOCK = 512  # Block size in bytes.
TAR_END = bytes(2 * TAR_BLOCK)  # Zero blocks that end an archive.


@dataclass(frozen=True)
class MemberPlace:
    """Offset and size of a member's content in an archive [bytes]."""

    start: int
    size: int


def tar_member(name: str, data: bytes) -> bytes:
    """Bytes of a member with its header. Time, owner and mode are always the same."""
    info = tarfile.TarInfo(name)  # by default of 1970, of nobody, readable for all
    info.size = len(data)
    return info.tobuf(tarfile.USTAR_FORMAT) + data + bytes(-len(data) % TAR_BLOCK)


def tar_members(path: Path) -> dict[str, MemberPlace]:
    """Members of an archive by name, in archive order.

    Raises:
        InvalidInputError: the archive is missing, truncated or damaged, or a member is duplicated
            or no plain file; the message names archive and member.
    """
    max_members = 1_000_000
    found: dict[str, MemberPlace] = {}
    with open_regular(path) as stream:
        size = os.fstat(stream.fileno()).st_size
        offset, last_name = 0, "its beginning"
        while True:
            header = os.pread(stream.fileno(), TAR_BLOCK, offset)
            if len(header) < TAR_BLOCK:
                raise InvalidInputError(f"{path} is truncated after {last_name}")
            if not any(header):
                return found
            name, place = _parse_header(header, offset, f"{path}, after {last_name}")
            if place.start + place.size > size:
                raise InvalidInputError(f"{path} is truncated within {name}")
            if name in found:
                raise InvalidInputError(f"{path} contains {name} twice")
            if len(found) == max_members:
                raise InvalidInputError(f"{path} has more than {max_members:,} members")
            found[name], last_name = place, name
            offset = place.start + place.size + -place.size % TAR_BLOCK


def read_member(path: Path, place: MemberPlace) -> bytes:
    """Content of a member. Opens the file each time, so that processes share no open file.

    Raises:
        InvalidInputError: the archive cannot be read or is truncated.
    """
    with open_regular(path) as stream:
        try:
            data = os.pread(stream.fileno(), place.size, place.start)
        except OSError as error:
            raise InvalidInputError(f"cannot read {path}: {error.strerror or error}") from error
    if len(data) != place.size:
        raise InvalidInputError(f"{path} is truncated")
    return data


def _parse_header(header: bytes, at: int, where: str) -> tuple[str, MemberPlace]:
    """Name of a member, and the place of its content, from the header at offset `at`."""
    try:
        info = tarfile.TarInfo.frombuf(header, "ascii", "strict")
    except (tarfile.HeaderError, ValueError) as error:
        if str(error) == "bad checksum":
            raise InvalidInputError(f"{where}: the checksum of a header is wrong") from error
        raise InvalidInputError(f"{where}: the header is not that of a tar archive") from error
    is_file = info.type in (tarfile.REGTYPE, tarfile.AREGTYPE) and info.size >= 0
    has_prefix = any(header[345:500])  # of a name of more than 100 characters
    if not is_file or has_prefix or not info.name:
        raise InvalidInputError(
            f"{where}: {shorten_text(info.name)!r} is not a regular file with a name of at most 100"
            " characters; only such files may be in a shard"
        )
    return info.name, MemberPlace(at + TAR_BLOCK, info.size)


SHARD_FOLDER = "shards"  # Name of the folder of shards in a data set.
SHARD_URL = re.compile(SHARD_FOLDER + r"/(\d{6,12})\.tar", re.ASCII)
"""Pattern of the paths of shards in a data set."""


@dataclass(frozen=True)
class ShardEntry:
    """A shard's entry in the index.

    Attributes:
        url: path of the shard, relative to the data set.
        nsamples: number of samples in the shard.
        filesize: size of the file [bytes].
        md5sum: MD5 checksum of the file, 32 hexadecimal digits.

    Raises:
        InvalidInputError: a value is invalid.
    """

    url: str
    nsamples: int
    filesize: int
    md5sum: str

    def __post_init__(self) -> None:
        if not isinstance(self.url, str) or not SHARD_URL.fullmatch(self.url):
            raise InvalidInputError(
                f"url is {quote_value(self.url)}; expected a value such as shards/000012.tar"
            )
        for name in ("nsamples", "filesize"):
            value = getattr(self, name)
            if type(value) is not int or value < 0:
                raise InvalidInputError(
                    f"{name} is {quote_value(value)}; expected a whole number from 0"
                )


def shard_name(scene: int) -> str:
    """Path of the shard of a scene, relative to the data set."""
    return f"{SHARD_FOLDER}/{scene:06d}.tar"


def write_shard(path: str | Path, samples: Iterable[Sample]) -> ShardEntry:
    """Writes the samples of a scene, one by one, to a temporary file and renames it to `path`.

    Several processes can write different shards at once. The same samples give the same bytes.

    Args:
        path: the file, named after the scene's number, as in `shards/000012.tar`.
        samples: samples of that scene; may be a generator.

    Returns:
        The shard's entry in the index.

    Raises:
        InvalidInputError: the disk is full or cannot be written to; or a sample is of another
            scene, duplicated, or inconsistent. The unfinished shard is removed.
    """
    path = Path(path)
    digest = hashlib.md5(usedforsecurity=False)
    seen: set[str] = set()
    with _write_atomically(path) as stream:

        def write(data: bytes) -> None:
            with _report_write_errors(path):
                stream.write(data)
            digest.update(data)

        for sample in samples:
            if f"{sample.scene:06d}" != path.stem or sample.key in seen:
                where = "there already" if sample.key in seen else "of another scene"
                raise InvalidInputError(
                    f"cannot write sample {sample.key} to {path}: it is {where}"
                )
            seen.add(sample.key)
            for name, data in encode_sample(sample):
                write(tar_member(name, data))
        write(TAR_END)
        size = stream.tell()
    return ShardEntry(f"{SHARD_FOLDER}/{path.name}", len(seen), size, digest.hexdigest())


def write_made_shard(path: Path, data: bytes) -> None:
    """Writes the bytes of a shard from another machine, atomically as `write_shard` does.

    Raises:
        InvalidInputError: the disk is full or cannot be written to; the unfinished shard is
            removed.
    """
    with _write_atomically(path) as stream, _report_write_errors(path):
        stream.write(data)


def shard_entry(path: Path) -> ShardEntry:
    """Index entry of an existing shard.

    Raises:
        InvalidInputError: the shard is damaged.
    """
    return ShardEntry(
        f"{SHARD_FOLDER}/{path.name}", len(open_shard(path).keys), *size_and_md5(path)
    )


def size_and_md5(path: Path) -> tuple[int, str]:
    """Size [bytes] and MD5 of a file.

    Raises:
        InvalidInputError: the file cannot be read.
    """
    with open_regular(path) as stream:
        try:
            digest = hashlib.file_digest(stream, lambda: hashlib.md5(usedforsecurity=False))
        except OSError as error:
            raise InvalidInputError(f"cannot read {path}: {error.strerror or error}") from error
        return stream.tell(), digest.hexdigest()


class SampleShard:
    """A shard for reading, without an open file.

    Attributes:
        path: path of the shard.
        samples: places of each sample's files by kind, by sample key in archive order.
        foreign_members: names of members that belong to no sample of the scene.
    """

    def __init__(self, path: Path) -> None:
        """Reads the headers; see `open_shard`."""
        self.path = path
        self.samples: dict[str, dict[str, MemberPlace]] = {}
        self.foreign_members: list[str] = []
        for name, place in tar_members(path).items():
            key_kind = member_kind(name)
            if key_kind is None or key_kind[0].partition("_")[0] != path.stem:
                self.foreign_members.append(name)
                continue
            key, kind = key_kind
            self.samples.setdefault(key, {})[kind] = place

    @property
    def keys(self) -> list[str]:
        """Keys of the samples, in archive order."""
        return list(self.samples)

    def record(self, key: str) -> SampleRecord:
        """The record of a sample.

        Raises:
            InvalidInputError: the record is missing, damaged, too large or of another version.
        """
        where = f"{self.path}: {key}.{FILE_SUFFIXES[RECORD_KIND]}"
        try:
            text = self._read_file(key, RECORD_KIND, FileLimits.document.size).decode()
        except UnicodeDecodeError as error:
            raise DocumentError(f"{where} is not text") from error
        record = parse_record(text, where)
        if record.sample.key != key:
            raise DocumentError(f"{where} belongs to sample {record.sample.key}")
        return record

    def sample(self, record: SampleRecord, parts: Iterable[str]) -> Sample:
        """The sample of a record, with the requested parts that it has.

        Raises:
            InvalidInputError: a file is missing, damaged, or does not fit the record.
        """
        max_size = 256 << 20  # Bytes, of any file other than the record.
        sample = record.sample
        for name in parts:
            if name not in record.files:
                continue
            place = f"{self.path}: {sample.key}.{FILE_SUFFIXES[name]}"
            data = self._read_file(sample.key, name, max_size)
            if name == GRASPS_KIND:
                grasps = decode_grasps(data, place)
                require_fitting(grasps, len(sample.instances), place)
                sample = replace(sample, grasps=grasps)
                continue
            image = decode_image_of(name, data, record.size, record.depth_unit, place)
            if name == "sensor_depth":
                sample = replace(sample, sensor_depth=image)
            else:
                sample = replace(sample, images=replace(sample.images, **{name: image}))
        return sample

    def _read_file(self, key: str, kind: str, max_size: int) -> bytes:
        places, name = self.samples[key], f"{key}.{FILE_SUFFIXES[kind]}"
        if kind not in places:
            raise DocumentError(f"{self.path}: {name} is missing")
        if places[kind].size > max_size:
            raise DocumentError(f"{self.path}: {name} has more than the {max_size} bytes allowed")
        return read_member(self.path, places[kind])


def open_shard(path: Path) -> SampleShard:
    """Opens a shard for reading. Its headers are cached until the file changes.

    Raises:
        InvalidInputError: the shard is missing, truncated or damaged, or a member is duplicated or
            no plain file; the message names shard and member.
    """
    try:
        state = os.stat(path)
    except OSError as error:
        raise InvalidInputError(f"cannot read shard {path}: {error.strerror or error}") from error
    return _open_unchanged_shard(path, state.st_size, state.st_mtime_ns)


@functools.lru_cache(maxsize=256)
def _open_unchanged_shard(path: Path, size: int, changed: int) -> SampleShard:
    """The shard; file size and modification time are keys of the cache."""
    del size, changed
    return SampleShard(path)


@contextmanager
def _write_atomically(path: Path) -> Iterator[BinaryIO]:
    """Opens a temporary file beside `path` and renames it to `path` if the block succeeds."""
    # `UNFINISHED_FILE` matches this name.
    temporary = path.with_name(f".{path.name}.{secrets.token_hex(8)}")
    try:
        with _report_write_errors(path):
            path.parent.mkdir(parents=True, exist_ok=True)
            stream = temporary.open("xb")
        try:
            copy_permissions(path, stream.fileno())
            yield stream
            with _report_write_errors(path):
                stream.flush()
                os.fsync(stream.fileno())
        finally:
            with suppress(OSError):  # a failed write, as to a full disk, has been reported
                stream.close()
        with _report_write_errors(path):
            os.replace(temporary, path)
    finally:
        temporary.unlink(missing_ok=True)


@contextmanager
def _report_write_errors(path: Path) -> Iterator[None]:
    try:
        yield
    except OSError as error:
        raise InvalidInputError(
            f"cannot write {shorten_text(str(path), 500)}: {error.strerror or error}; all shards"
            " except this one are kept: make room, and run the same command to continue"
        ).about("folder") from error
