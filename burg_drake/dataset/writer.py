"""Writes a data set scene by scene, and continues one that was interrupted."""

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
    """Writes the document of a scene, then its shard; for processes that a writer has started.

    Args:
        folder: of the data set, which the writer has opened.
        number: of the scene in it.
        scene: the scene; its library is referred to from where the document will lie.
        samples: of the scene; they may be made as they are asked for.

    Returns:
        The shard's line of the index, for `DatasetWriter.add_entry`.

    Raises:
        InvalidInputError: the scene is there already; or the disk is full or cannot be written to,
            which is `about` the folder; and see `write_shard`. Nothing of the scene stays then.
    """
    with _add_scene_document(Path(folder), number, scene) as shard:
        return write_shard(shard, samples)


def write_made_scene(
    folder: str | Path, number: int, scene: Scene, shard: bytes, entry: ShardEntry
) -> ShardEntry:
    """Writes a scene whose shard another machine has made; as `write_scene`.

    Args:
        folder, number, scene: as in `write_scene`.
        shard: the bytes of its shard.
        entry: its line of the index.

    Returns:
        The line.

    Raises:
        InvalidInputError: as `write_scene`.
    """
    with _add_scene_document(Path(folder), number, scene) as path:
        write_made_shard(path, shard)
        return entry


@contextmanager
def _add_scene_document(folder: Path, number: int, scene: Scene) -> Iterator[Path]:
    """Writes the document of a scene, and removes it if the block fails to write the shard.

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
    """A data set that is opened for writing; one process at a time can hold it.

    When its block ends without an error, the index is written.

    Attributes:
        folder: of the data set.
    """

    def __init__(self, folder: str | Path, document: DatasetDocument) -> None:
        """Opens or makes the folder, and removes what a process that was killed has begun.

        Args:
            folder: of the data set; new, empty, or one of the same content.
            document: what its samples are made with.

        Raises:
            InvalidInputError: the folder cannot be written to, another process is writing it, it
                holds samples that are made with other things, or something that is none of this.
            DocumentError: its document is damaged, or of another version.
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
        """Removes shards that are cut off, have damaged headers, or are not those of the index, so
        that they can be made anew. All shards are read for it, and need not be in the end.

        Returns:
            Numbers of their scenes.
        """
        listed: dict[str, ShardEntry] = {}
        with suppress(InvalidInputError):  # an index that is missing or damaged tells nothing
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
        """Those of some scenes that are not complete, in the order given."""
        there = set(shard_numbers(self.folder))
        return [number for number in scenes if number not in there]

    def add(self, number: int, scene: SceneLike, samples: Iterable[Sample]) -> None:
        """Writes a scene and its samples; see `write_scene`."""
        self.add_entry(write_scene(self.folder, number, as_scene(scene), samples))

    def add_entry(self, entry: ShardEntry) -> None:
        """Takes note of what another process has written with `write_scene`, so that its check sum
        need not be made again."""
        self._known[entry.url] = entry

    def finish(self) -> None:
        """Writes the index of all that is there.

        Raises:
            InvalidInputError: a shard of an earlier run is damaged, or the disk is full.
        """
        write_index(self.folder, self._known)

    def close(self) -> None:
        """Lets others write; what is there stays as it is."""
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
