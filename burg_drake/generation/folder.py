"""A folder of sampled scenes: one file a scene, what they were made with, and a table.

`recipe.yaml` says what the scenes are made with; scenes of anything else are refused. `scenes.csv`
has a row a scene that was sampled, accepted or not; rows are appended as scenes come, and sorted in
the end. A row is written when its scene is, so that a run that is killed loses no more than the
scenes that were being sampled.
"""

from __future__ import annotations

import csv
import io
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType

from burg_drake.core import DocumentError, InvalidInputError
from burg_drake.core.documents import load_document, save_document
from burg_drake.core.files import (
    FolderLock,
    atomic_write,
    open_regular,
    remove_unfinished,
    writable_folder,
)
from burg_drake.generation.sample import SampledScene
from burg_drake.scene.document import SamplingProvenance, SceneDocument, save_scene

RECIPE_FILE = "recipe.yaml"
TABLE_FILE = "scenes.csv"
COLUMNS = ("scene", "accepted", "objects", "missing", "attempts", "tries", "refused")
LONGEST_TABLE = 1 << 28
"""Bytes; a row has some hundred."""


@dataclass(frozen=True)
class SceneRow:
    """What the table tells of a number.

    Attributes:
        scene: its number.
        accepted: there is a file of it.
        objects: in it; of the best attempt if none was accepted.
        missing: objects that found no place there.
        attempts: scenes that were drawn.
        tries: places that were looked at.
        refused: how many attempts were refused, by reason.
    """

    scene: int
    accepted: bool
    objects: int
    missing: tuple[str, ...]
    attempts: int
    tries: int
    refused: Mapping[str, int]

    @classmethod
    def of(cls, sampled: SampledScene) -> SceneRow:
        """The row of a scene."""
        return cls(
            sampled.number,
            sampled.accepted,
            sampled.placed,
            sampled.missing,
            sampled.attempts,
            sampled.tries,
            sampled.refused,
        )

    def text(self) -> str:
        """A line of the table."""
        line = io.StringIO()
        reasons = "; ".join(f"{count} x {reason}" for reason, count in sorted(self.refused.items()))
        csv.writer(line, lineterminator="\n").writerow(
            [
                self.scene,
                "yes" if self.accepted else "no",
                self.objects,
                " ".join(self.missing),
                self.attempts,
                self.tries,
                reasons,
            ]
        )
        return line.getvalue()

    @classmethod
    def read(cls, fields: Mapping[str, str]) -> SceneRow:
        """Reads a line.

        Raises:
            ValueError, KeyError, TypeError: it was not written by `text`.
        """
        refused = {}
        for part in filter(None, fields["refused"].split("; ")):
            count, _, reason = part.partition(" x ")
            refused[reason] = int(count)
        return cls(
            int(fields["scene"]),
            {"yes": True, "no": False}[fields["accepted"]],
            int(fields["objects"]),
            tuple(fields["missing"].split()),
            int(fields["attempts"]),
            int(fields["tries"]),
            refused,
        )


class SceneFolder:
    """A folder opened for sampling; one process at a time can hold it."""

    def __init__(self, path: str | Path, provenance: SamplingProvenance) -> None:
        """Opens or makes the folder.

        Raises:
            InvalidInputError: it cannot be written to, another process is writing it, it holds
                scenes that are made with other things, or something that is none of this.
            DocumentError: its recipe or a scene is damaged.
        """
        self.path = writable_folder(path)
        self._lock = FolderLock(self.path)
        try:
            self._open(provenance)
        except BaseException:
            self._lock.release()
            raise

    def _open(self, provenance: SamplingProvenance) -> None:
        remove_unfinished(self.path)
        recipe = self.path / RECIPE_FILE
        if recipe.exists():
            there = load_document(recipe, SamplingProvenance)
            found = there.differences(provenance)
            if found:
                raise InvalidInputError(
                    f"{self.path} already holds other scenes ({'; '.join(found)}); choose"
                    " another folder, or delete it"
                ).about("folder")
        elif any(self.path.iterdir()):
            raise InvalidInputError(
                f"{self.path} is not empty, but has no sampled scenes ({RECIPE_FILE} is missing);"
                " choose another folder"
            ).about("folder")
        else:
            save_document(provenance, recipe, "What the scenes of this folder were made with.")
        self._table = self.path / TABLE_FILE
        self.rows = {row.scene: row for row in read_table(self._table)}
        self.rows = {
            n: row for n, row in self.rows.items() if not row.accepted or self.file(n).is_file()
        }
        for number, row in self.rows.items():
            if row.accepted:
                _require_readable(self.file(number))
        self.sort()

    def file(self, number: int) -> Path:
        """The file of a scene."""
        return self.path / f"scene_{number:04d}.yaml"

    def add(self, sampled: SampledScene) -> None:
        """Writes a scene and its row.

        Raises:
            InvalidInputError: the disk is full, for example.
        """
        if sampled.accepted:
            save_scene(sampled.scene.document, self.file(sampled.number))
        row = SceneRow.of(sampled)
        try:
            with self._table.open("a", encoding="utf-8") as stream:
                stream.write(row.text())
        except OSError as error:
            raise InvalidInputError(
                f"cannot write {self._table}: {error.strerror}; the scenes so far are"
                " kept. Run the same command to continue"
            ) from error
        self.rows[row.scene] = row

    def sort(self) -> None:
        """Writes the table in the order of the scenes."""
        rows = [self.rows[number].text() for number in sorted(self.rows)]
        text = ",".join(COLUMNS) + "\n" + "".join(rows)
        if not self._table.is_file() or self._table.read_bytes() != text.encode():
            atomic_write(self._table, text)

    def __enter__(self) -> SceneFolder:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self._lock.release()


def _require_readable(path: Path) -> None:
    try:
        load_document(path, SceneDocument)
    except DocumentError as error:
        raise DocumentError(f"{error}; fix the file, or delete it to have it made again") from error


def read_table(path: Path) -> list[SceneRow]:
    """The rows of a table; lines that cannot be read, such as a torn last one, count as not there.

    Raises:
        InvalidInputError: it is not a file, or cannot be read.
    """
    if not path.exists():
        return []
    with open_regular(path) as stream:
        text = stream.read(LONGEST_TABLE).decode(errors="replace")
    whole = text[: text.rfind("\n") + 1]
    rows = []
    for fields in csv.DictReader(io.StringIO(whole)):
        try:
            rows.append(SceneRow.read(fields))
        except (ValueError, KeyError, TypeError, AttributeError):
            continue
    return rows
