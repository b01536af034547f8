"""Writes a data set scene by scene, and resumes an interrupted one."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import replace
from pathlib import Path
from types import TracebackType

from burg_drake.core import (
    FolderLock,
    InvalidInputError,
    ensure_writable_folder,
    portable_reference,
    remove_unfinished,
)
from burg_drake.dataset.document import (
    DATASET_FILE as DOCUMENT_FILE,
    DatasetDocument,
    load_dataset_document,
    read_index,
    save_dataset_document,
    shard_numbers,
    write_index,
)
from burg_drake.dataset.sample import Sample
from burg_drake.dataset.shards import (
    SHARD_FOLDER,
    ShardEntry,
    shard_entry,
    shard_name,
    write_made_shard,
    write_shard,
)
from burg_drake.scene import Scene, SceneLike, as_scene, save_scene

SCENE_FOLDER = "scenes"  # Folder of the scene documents in a data set.


def scene_name(number: int) -> str:
    """Path of the document of a scene, relative to the data set."""
    return f"{SCENE_FOLDER}/{number:06d}.yaml"


def write_scene(
    folder: str | Path, number: int, scene: Scene, samples: Iterable[Sample]
) -> ShardEntry:
    """Writes the document of a scene, then its shard. For worker processes of a `DatasetWriter`.

    Args:
        folder: folder of the data set, which the writer has opened.
        number: number of the scene in the data set.
        scene: the scene; the path of its library is written relative to the document.
        samples: samples of the scene; may be a generator.

    Returns:
        The shard's entry in the index, for `DatasetWriter.add_entry`.

    Raises:
        InvalidInputError: the scene exists already; or the disk is full or cannot be written to,
            which is `about` the folder; and see `write_shard`. All files of the scene are removed.
    """
    with _add_scene_document(Path(folder), number, scene) as shard:
        return write_shard(shard, samples)


def write_made_scene(
    folder: str | Path, number: int, scene: Scene, shard: bytes, entry: ShardEntry
) -> ShardEntry:
    """Writes a scene and its shard from another machine; see `write_scene`.

    Args:
        folder, number, scene: as in `write_scene`.
        shard: bytes of the shard.
        entry: the shard's entry in the index.

    Returns:
        The entry.

    Raises:
        InvalidInputError: as `write_scene`.
    """
    with _add_scene_document(Path(folder), number, scene) as path:
        write_made_shard(path, shard)
        return entry


@contextmanager
def _add_scene_document(folder: Path, number: int, scene: Scene) -> Iterator[Path]:
    """Writes the document of a scene, and removes it if the block raises an error.

    Yields:
        The path of the shard.
    """
    shard, document = folder / shard_name(number), folder / scene_name(number)
    if shard.exists():
        raise InvalidInputError(f"{shard} exists already; a scene can be added only once")
    library = portable_reference(scene.library.root, document.parent)
    try:
        save_scene(replace(scene.document, library=library), document)
    except InvalidInputError as error:
        error.about("folder")
        raise
    try:
        yield shard
    except BaseException:
        document.unlink(missing_ok=True)
        raise


class DatasetWriter:
    """A data set opened for writing, locked against other processes.

    Writes the index when its block ends without an error.

    Attributes:
        folder: folder of the data set.
    """

    def __init__(self, folder: str | Path, document: DatasetDocument) -> None:
        """Opens or creates the folder, and removes unfinished files of a killed process.

        Args:
            folder: folder of the data set: new, empty, or with a data set of the same document.
            document: document of the data set.

        Raises:
            InvalidInputError: the folder cannot be written to, another process is writing it, its
                data set was made with other settings or versions, or it holds other files.
            DocumentError: the folder's document is damaged, or of another version.
        """
        self.folder = ensure_writable_folder(folder)
        self._known: dict[str, ShardEntry] = {}
        self._lock = FolderLock(self.folder)
        try:
            self._open(document)
        except BaseException:
            self.close()
            raise

    def _open(self, document: DatasetDocument) -> None:
        remove_unfinished(self.folder)
        path = self.folder / DOCUMENT_FILE
        if path.exists():
            found = load_dataset_document(path).differences(document)
            if found:
                raise InvalidInputError(
                    f"{self.folder} holds another data set ({'; '.join(found)}); choose another"
                    " folder, or delete it"
                ).about("folder")
        elif any(self.folder.iterdir()):
            raise InvalidInputError(
                f"{self.folder} is not empty and is not a data set ({DOCUMENT_FILE} is missing);"
                " choose another folder"
            ).about("folder")
        else:
            save_dataset_document(document, path)
        for name in (SCENE_FOLDER, SHARD_FOLDER):
            remove_unfinished(ensure_writable_folder(self.folder / name))
        complete = {self.folder / scene_name(number) for number in shard_numbers(self.folder)}
        for path in (self.folder / SCENE_FOLDER).glob("*.yaml"):
            if path not in complete:  # its shard was being written
                path.unlink()

    def discard_damaged(self) -> list[int]:
        """Removes shards that are truncated, have damaged headers, or differ from the index, so
        that they can be made again. Reads all shards; `finish` need not read them again.

        Returns:
            Numbers of the removed scenes.
        """
        listed: dict[str, ShardEntry] = {}
        with suppress(InvalidInputError):  # a missing or damaged index is ignored
            listed = {entry.url: entry for entry in read_index(self.folder)}
        found = []
        for number in shard_numbers(self.folder):
            shard = self.folder / shard_name(number)
            try:
                entry = shard_entry(shard)
            except InvalidInputError:
                entry = None
            if entry is not None and listed.get(entry.url, entry) == entry:
                self._known[entry.url] = entry
                continue
            shard.unlink()
            (self.folder / scene_name(number)).unlink(missing_ok=True)
            found.append(number)
        return found

    def missing(self, scenes: Iterable[int]) -> list[int]:
        """The scenes that are not complete, in the order given."""
        there = set(shard_numbers(self.folder))
        return [number for number in scenes if number not in there]

    def add(self, number: int, scene: SceneLike, samples: Iterable[Sample]) -> None:
        """Writes a scene and its samples; see `write_scene`."""
        self.add_entry(write_scene(self.folder, number, as_scene(scene), samples))

    def add_entry(self, entry: ShardEntry) -> None:
        """Adds the entry of a scene that another process wrote with `write_scene`, so that its
        checksum need not be computed again."""
        self._known[entry.url] = entry

    def finish(self) -> None:
        """Writes the index of all shards.

        Raises:
            InvalidInputError: a shard of an earlier run is damaged, or the disk is full.
        """
        write_index(self.folder, self._known)

    def close(self) -> None:
        """Releases the lock of the folder."""
        self._lock.release()

    def __enter__(self) -> DatasetWriter:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        try:
            if kind is None:
                self.finish()
        finally:
            self.close()
