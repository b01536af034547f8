"""Samples many scenes in worker processes into a folder, and resumes where an earlier call stopped.

The folder has one file per scene, the recipe, and a table of all scenes.
"""

from __future__ import annotations

import csv
import io
from collections.abc import Callable, Mapping
from dataclasses import dataclass, fields
from functools import partial
from pathlib import Path

from burg_drake.core import (
    DocumentError,
    FolderLock,
    InvalidInputError,
    atomic_write,
    ensure_writable_folder,
    load_document,
    map_unordered,
    one_line,
    open_regular,
    remove_unfinished,
    save_document,
)
from burg_drake.generation.scene_sampling import (
    SampledScene,
    convert_drake_errors,
    kept_sampler,
    require_possible_recipe,
    sampling_provenance,
)
from burg_drake.objects import ObjectLibrary
from burg_drake.scene import SamplingProvenance, SceneDocument, SceneRecipe, save_scene
from burg_drake.station import StationLike, as_station


@dataclass(frozen=True)
class SceneRow:
    """Row of a scene in the table.

    Attributes:
        scene: number of the scene.
        accepted: whether the scene was accepted and has a file.
        objects: number of objects, of the best attempt if none was accepted.
        missing: names of objects without a free place.
        attempts: number of scenes drawn.
        tries: number of object poses tried.
        refused: number of refused attempts, by reason.
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
        """The row of a sampled scene."""
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
        """The row as a line of the table."""
        line = io.StringIO()
        accepted, missing = "yes" if self.accepted else "no", " ".join(self.missing)
        reasons = "; ".join(f"{count} x {reason}" for reason, count in sorted(self.refused.items()))
        csv.writer(line, lineterminator="\n").writerow(
            [self.scene, accepted, self.objects, missing, self.attempts, self.tries, reasons]
        )
        return line.getvalue()

    @classmethod
    def read(cls, cells: Mapping[str, str]) -> SceneRow:
        """Reads a line of the table.

        Raises:
            ValueError, KeyError, TypeError: the line was not written by `text`.
        """
        refused = {}
        for part in filter(None, cells["refused"].split("; ")):
            count, _, reason = part.partition(" x ")
            refused[reason] = int(count)
        return cls(
            int(cells["scene"]),
            {"yes": True, "no": False}[cells["accepted"]],
            int(cells["objects"]),
            tuple(cells["missing"].split()),
            int(cells["attempts"]),
            int(cells["tries"]),
            refused,
        )


class SceneFolder:
    """A folder opened for sampling, locked against other processes."""

    def __init__(self, path: str | Path, provenance: SamplingProvenance) -> None:
        """Opens or creates the folder.

        Raises:
            InvalidInputError: the folder cannot be written to, another process is writing it, its
                scenes were made with another recipe, library, station or versions, or it holds
                other files.
            DocumentError: its recipe or a scene is damaged.
        """
        self.path = ensure_writable_folder(path)
        self._lock = FolderLock(self.path)
        try:
            self._open(provenance)
        except BaseException:
            self._lock.release()
            raise

    def _open(self, provenance: SamplingProvenance) -> None:
        remove_unfinished(self.path)
        recipe = self.path / "recipe.yaml"
        if recipe.exists():
            differences = load_document(recipe, SamplingProvenance).differences(provenance)
            if differences:
                raise InvalidInputError(
                    f"{self.path} already holds other scenes ({'; '.join(differences)}); choose"
                    " another folder, or delete it"
                ).about("folder")
        elif any(self.path.iterdir()):
            raise InvalidInputError(
                f"{self.path} is not empty, but has no sampled scenes (recipe.yaml is missing);"
                " choose another folder"
            ).about("folder")
        else:
            save_document(provenance, recipe, "What the scenes of this folder were made with.")
        self._table = self.path / "scenes.csv"
        rows = read_scene_table(self._table)
        self.rows = {
            row.scene: row for row in rows if not row.accepted or self.file(row.scene).is_file()
        }
        for number, row in self.rows.items():
            if row.accepted:
                _require_readable(self.file(number))
        self.sort()

    def file(self, number: int) -> Path:
        """Path of a scene's file."""
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
        text = ",".join(field.name for field in fields(SceneRow)) + "\n" + "".join(rows)
        if not self._table.is_file() or self._table.read_bytes() != text.encode():
            atomic_write(self._table, text)

    def __enter__(self) -> SceneFolder:
        return self

    def __exit__(self, *_: object) -> None:
        self._lock.release()


def _require_readable(path: Path) -> None:
    try:
        load_document(path, SceneDocument)
    except DocumentError as error:
        raise DocumentError(f"{error}; fix the file, or delete it to have it made again") from error


def read_scene_table(path: Path) -> list[SceneRow]:
    """Reads the rows of a table; skips unreadable lines, such as an incomplete last one.

    Raises:
        InvalidInputError: the path is no file, or cannot be read.
    """
    if not path.exists():
        return []
    with open_regular(path) as stream:
        text = stream.read(1 << 28).decode(errors="replace")
    whole = text[: text.rfind("\n") + 1]
    rows = []
    for cells in csv.DictReader(io.StringIO(whole)):
        try:
            rows.append(SceneRow.read(cells))
        except (ValueError, KeyError, TypeError, AttributeError):
            continue
    return rows


@dataclass(frozen=True)
class SampledFolder:
    """Contents of a folder after sampling.

    Attributes:
        rows: rows of the requested scenes that were sampled, accepted or not, by number.
        new: numbers of the scenes that were sampled now.
        failed: error message of each scene that could not be sampled, by number. The next call
            tries these scenes again.
    """

    rows: dict[int, SceneRow]
    new: tuple[int, ...]
    failed: dict[int, str]


def sample_scenes(
    recipe: SceneRecipe,
    library: ObjectLibrary,
    station: StationLike,
    folder: str | Path,
    count: int,
    *,
    workers: int = 1,
    progress: Callable[[SampledScene], None] | None = None,
    known: Callable[[int], None] | None = None,
) -> SampledFolder:
    """Samples scenes 0 to `count` - 1 of a recipe; skips scenes that the folder has.

    Example::

        library, station = burg.load_library("household"), burg.load_station("panda_tabletop")
        recipe = burg.SceneRecipe(library="household", count=5, layout="packed")
        burg.sample_scenes(recipe, library, station, "scenes", 100, workers=4)

    Args:
        recipe: recipe of the scenes; its paths are relative to the folder.
        library, station: library and station of the recipe.
        folder: folder to write to.
        count: number of scenes.
        workers: number of processes; with one, this process samples the scenes.
        progress: called after each scene.
        known: called at the start with the number of scenes that the folder has.

    Raises:
        InvalidInputError, UnknownNameError: see `SceneFolder` and `require_possible_recipe`.
    """
    station = as_station(station)
    require_possible_recipe(recipe, library, station)
    provenance = sampling_provenance(recipe, library, station)
    with SceneFolder(folder, provenance) as opened:
        sample = partial(run_scene_task, provenance, library.root, station.path, opened.path)
        todo = [number for number in range(count) if number not in opened.rows]
        if known is not None:
            known(count - len(todo))
        new: list[int] = []
        failed: dict[int, str] = {}
        try:
            for number, outcome in map_unordered(sample, todo, workers):
                if isinstance(outcome, BaseException):
                    failed[number] = one_line(outcome)
                    continue
                opened.add(outcome)
                new.append(number)
                if progress is not None:
                    progress(outcome)
        finally:
            opened.sort()
        rows = {number: row for number, row in sorted(opened.rows.items()) if number < count}
    return SampledFolder(rows, tuple(sorted(new)), failed)


def run_scene_task(
    provenance: SamplingProvenance, library: Path, station: Path, folder: Path, number: int
) -> SampledScene:
    """Samples a scene in a worker.

    Args:
        provenance: recipe, library, station and versions of all scenes.
        library, station: paths of library and station.
        folder: folder of the scene's file.
        number: number of the scene.

    Raises:
        InvalidInputError: the library or the station has changed.
        SimulationError: an assertion of Drake failed.
        Exception: the scene cannot be simulated.
    """
    with convert_drake_errors():
        sampler = kept_sampler(provenance.recipe, library, station)
        here = sampler.provenance
        for what, path, same in (
            ("library", library, here.library_content == provenance.library_content),
            ("station", station, here.station_content == provenance.station_content),
        ):
            if not same:
                raise InvalidInputError(
                    f"the {what} {path} was changed while scenes were sampled; run the command"
                    " again"
                )
        return sampler.sample(number, folder)
