"""Folder of a run: its files, and the run read from it."""

from __future__ import annotations

import contextlib
import dataclasses
from collections.abc import Collection, Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from burg_drake.core import (
    InvalidInputError,
    UnknownNameError,
    Verdict,
    ensure_writable_folder,
    load_document,
    portable_reference,
    resolve_reference,
    save_document,
)
from burg_drake.evaluation.candidates import Candidate, Candidates, share_rows
from burg_drake.evaluation.journal import (
    JOURNAL_FILE as JOURNAL_FILE,
    JournalIndex,
    index_journal,
    journal_lines,
    read_journal,
    read_verdicts,
)
from burg_drake.evaluation.result_rows import ResultRows
from burg_drake.evaluation.results_table import (
    Columns,
    RecordedTrial,
    best_rows,
    contested_rows,
    table_row,
    unknown_grasp_error,
)
from burg_drake.evaluation.run_document import RunDocument, origin_of
from burg_drake.evaluation.settings import select_share
from burg_drake.objects import ObjectLibrary, load_library
from burg_drake.scene import Scene, SceneDocument, save_scene
from burg_drake.station import Station, StationDocument, load_station

if TYPE_CHECKING:
    import pandas

RUN_FILE = "run.yaml"
SCENE_FILE = "scene.yaml"
STATION_FILE = "station.yaml"
GRASPS_FILE = "grasps.npz"
REPORT_FILE = "report.html"


@dataclass(frozen=True)
class StoredRun:
    """Folder of a run whose rows are stored in parts.

    Attributes:
        scene: name of the scene in the parts; empty for a run of one scene.
        folder: folder of the run.
    """

    scene: str
    folder: Path

    @property
    def journal(self) -> Path:
        """Path of the journal."""
        return self.folder / JOURNAL_FILE


@dataclass(frozen=True, eq=False, repr=False)
class Run:
    """A run on disk, complete or not.

    Example::

        run = burg.load_run("runs/first")
        for id in run.best(3):
            print(id, run.verdicts[id].outcome, run.verdicts[id].margins)

    Attributes:
        path: folder of the run.
        document: contents of run.yaml.
    """

    path: Path
    document: RunDocument

    def __repr__(self) -> str:
        scene, count = self.document.scene.name, self.document.grasps.count
        judged = len({id for _, id, _ in journal_lines(self.path / JOURNAL_FILE)})
        return f"Run({str(self.path)!r}, scene {scene!r}, {judged} of {count} grasps judged)"

    @property
    def is_sampled(self) -> bool:
        """Whether all grasps are known; not so while a run samples some and judges others."""
        return bool(self.document.grasps.content)

    @cached_property
    def candidates(self) -> Candidates:
        """All grasps of the run.

        Raises:
            InvalidInputError: not all grasps are sampled yet.
        """
        if not self.is_sampled:
            raise InvalidInputError(
                f"the grasps of {self.path} are not all sampled yet; wait for the process that"
                " evaluates it, or run the same command again to continue"
            )
        return Candidates.load(self.path / GRASPS_FILE)

    @cached_property
    def verdicts(self) -> dict[str, Verdict]:
        """Verdicts in the journal by grasp id; each takes a kilobyte of memory."""
        return read_journal(self.path / JOURNAL_FILE)

    @cached_property
    def index(self) -> JournalIndex:
        """Index of the journal, with the outcome of each candidate."""
        candidates = self.candidates
        return index_journal(self.path / JOURNAL_FILE, len(candidates), candidates.rows)

    @property
    def assigned_ids(self) -> Sequence[str]:
        """Ids of the grasps assigned to this run: all, or the grasps of its shard."""
        return select_share(self.candidates.id, self.document.shard)

    @property
    def is_assigned(self) -> NDArray[np.bool_]:
        """(N,) whether each candidate is assigned to this run."""
        mine = np.zeros(len(self.candidates), dtype=bool)
        mine[share_rows(len(mine), self.document.shard)] = True
        return mine

    @property
    def left(self) -> NDArray[np.int64]:
        """Rows of the assigned candidates that have no verdict yet."""
        return np.flatnonzero(self.is_assigned & ~self.index.judged)

    @property
    def complete(self) -> bool:
        """Whether all assigned grasps are judged."""
        return not len(self.left)

    @property
    def stored_runs(self) -> list[StoredRun]:
        """The run itself, under an empty scene name; see `Campaign.stored_runs`."""
        return [StoredRun("", self.path)]

    @property
    def table_path(self) -> Path:
        """Path of the results table."""
        return self.path / f"results.{self.document.table}"

    @property
    def report_path(self) -> Path:
        """Path of the report."""
        return self.path / REPORT_FILE

    def rows(self, names: Sequence[str] | None = None) -> ResultRows:
        """Rows of the judged grasps in the order of the candidates, in little memory.

        They have all columns, whatever the names; see `Campaign.rows`.
        """
        return self._rows

    @cached_property
    def _rows(self) -> ResultRows:
        journal, index = self.path / JOURNAL_FILE, self.index
        return ResultRows.of(
            self.candidates,
            np.flatnonzero(index.judged),
            lambda rows: read_verdicts(journal, index.line_begin[rows].tolist()),
            **self.table_settings,
        )

    @cached_property
    def results(self) -> Columns:
        """All columns of the judged grasps, see `evaluation.results_table`."""
        return dict(self.rows())

    def columns(self, names: Sequence[str] | None = None) -> Columns:
        """Columns of the judged grasps.

        Args:
            names: names of the columns; all if None. Missing columns are NaN or empty texts.
        """
        return {
            name: self.rows().column(name) for name in (self.rows() if names is None else names)
        }

    @property
    def table_settings(self) -> dict[str, Any]:
        """Arguments of `make_columns` that do not depend on the grasps."""
        origin = origin_of(self.document)
        return {"origin": origin, "instances": self.instances, "joints": self._joints}

    def frame(self, names: Sequence[str] | None = None) -> pandas.DataFrame:
        """Judged grasps as a data frame; see `evaluation.table_parts`.

        Args:
            names: names of the columns; all if None.

        Raises:
            MissingDependencyError: pandas is not installed.
            KeyError: the run has no such column.
        """
        from burg_drake.evaluation.table_parts import results_frame

        rows = self.rows()
        texts = [name for name in rows if rows.is_text(name)]
        return results_frame(rows, list(names or rows), texts)

    def with_candidates(self, candidates: Candidates) -> Run:
        """Copy that already has its candidates in memory."""
        run = Run(self.path, self.document)
        run.__dict__["candidates"] = candidates
        return run

    def with_document(self, document: RunDocument) -> Run:
        """Copy with another document on the same grasps; keeps the data read so far."""
        run = Run(self.path, document)
        run.__dict__.update(self.__dict__ | {"document": document})
        return run

    @property
    def failures(self) -> list[str]:
        """Ids of the grasps that could not be simulated."""
        return self._ids_where(self.index.failed)

    @property
    def interrupted(self) -> list[str]:
        """Ids of failures whose worker process was killed from outside; `evaluate` retries them."""
        return self._ids_where(self.index.failed & self.index.interrupted)

    @property
    def contested(self) -> list[str]:
        """Ids of the executed grasps whose verdict is contested, see `Verdict.contested`."""
        rows = self.rows()
        settled = self.index.judged_again[rows.candidate_rows]
        contested = np.zeros(len(self.candidates), dtype=bool)
        contested[rows.candidate_rows] = contested_rows(rows["confidence"], settled)
        return self._ids_where(contested & self.is_assigned)

    def _ids_where(self, chosen: NDArray[np.bool_]) -> list[str]:
        ids = self.candidates.id
        return [ids[row] for row in np.flatnonzero(chosen).tolist()]

    def row(self, id: str) -> dict[str, Any]:
        """One row of the results.

        Raises:
            UnknownNameError: there is no judged grasp with this id; the message names similar ids.
        """
        (candidate_row,) = self.candidates.rows([id]).tolist()
        rows = self.rows()
        found = np.flatnonzero(rows.candidate_rows == candidate_row)
        if candidate_row < 0 or not len(found):
            raise self._unknown_grasp_error(id)
        return table_row(rows.columns(list(rows), found), 0)

    def candidate(self, id: str) -> Candidate:
        """One grasp, judged or not, with exactly the pose that is judged.

        Raises:
            UnknownNameError: the run has no such grasp; the message names similar ids.
        """
        (row,) = self.candidates.rows([id]).tolist()
        if row < 0:
            raise self._unknown_grasp_error(id)
        return self.candidates[row]

    def trial(self, id: str) -> RecordedTrial:
        """One grasp with its verdict, if it is judged.

        Raises:
            UnknownNameError: the run has no such grasp; the message names similar ids.
        """
        candidate = self.candidate(id)
        line_begin = int(self.index.line_begin[self.candidates.rows([id])[0]])
        found = read_verdicts(self.path / JOURNAL_FILE, [line_begin] if line_begin >= 0 else [])
        return RecordedTrial(
            id=id,
            instance=candidate.instance,
            X_OG=candidate.X_OG,
            width=candidate.width,
            friction=candidate.friction,
            verdict=found[0] if found else None,
        )

    def best(
        self, count: int = 1, *, each: bool = False, only: Iterable[str] | None = None
    ) -> list[str]:
        """Ids of the most robust lifted grasps, best first; see `best_rows`.

        Args:
            count: number of grasps.
            each: return `count` grasps of each object.
            only: names of objects or instances; others are left out.

        Raises:
            UnknownNameError: there are no grasps of such an object or instance.
        """
        rows = self.rows()
        best = best_rows(rows, count, each=each, only=only)
        return [self.candidates.id[row] for row in rows.candidate_rows[best].tolist()]

    def scene(self) -> Scene:
        """The scene of the run.

        Raises:
            InvalidInputError: the object library is missing, or has changed since the run.
        """
        path = self.path / SCENE_FILE
        document = load_document(path, SceneDocument)
        scene = Scene(document, self._load_library(document.library), path)
        built = self.document.library.objects
        changed = [name for name in built if scene.library.content.get(name) != built[name]]
        if changed or scene.content != self.document.scene.content:
            what = f"{', '.join(changed)} in library {scene.library.root}" if changed else path
            raise InvalidInputError(
                f"{what} has changed since {self.path} was judged; restore it, or evaluate again"
            )
        return scene

    def station(self) -> Station:
        """The station of the run.

        Raises:
            BurgError: a file that it needs is missing, or has changed since the run.
        """
        station = load_station(self.path / STATION_FILE)
        if station.content != self.document.station.content:
            raise InvalidInputError(
                f"{self.path / STATION_FILE}, its hand or a robot model has changed since"
                " the run; restore it, or evaluate again"
            )
        return station

    @cached_property
    def instances(self) -> tuple[str, ...]:
        """Names of the free objects of the scene."""
        document = load_document(self.path / SCENE_FILE, SceneDocument)
        return tuple(instance.name or instance.object for instance in document.instances)

    @cached_property
    def _joints(self) -> int:
        """Number of the arm's joints; 0 if no arm is used."""
        arm = load_document(self.path / STATION_FILE, StationDocument).arm
        return len(arm.home) if self.document.mode != "hand" and arm is not None else 0

    def _load_library(self, reference: str) -> ObjectLibrary:
        """Loads the library relative to the run's folder, or from its recorded path."""
        recorded = self.document.library.path
        for place, base in ((reference, self.path), (recorded, None)):
            with contextlib.suppress(UnknownNameError):
                return load_library(place, base)
        raise InvalidInputError(
            f"{self.path / SCENE_FILE}: the object library {reference} is missing, and is"
            f" not at {recorded} either; write its place into this file"
        )

    def _unknown_grasp_error(self, id: str) -> UnknownNameError:
        hint = f"all ids are in {self.table_path.name}"
        return unknown_grasp_error(id, self.candidates.id, str(self.path), hint)


def load_run(path: str | Path) -> Run:
    """Reads a run, complete or not.

    Example::

        run = burg.load_run("runs/first")
        print(len(run.verdicts), run.results["outcome"])

    Args:
        path: folder of the run.

    Raises:
        InvalidInputError: there is no run.
        DocumentError: run.yaml does not fit the schema.
    """
    path = Path(path)
    if path.is_file():
        raise InvalidInputError(f"{path} is a file; give the folder of a run")
    if not (path / RUN_FILE).exists():
        raise InvalidInputError(
            f"{path} is not the folder of a run ({RUN_FILE} is missing); burg-drake"
            " evaluate makes one"
        )
    return Run(path, load_document(path / RUN_FILE, RunDocument))


def create_run(
    folder: Path,
    document: RunDocument,
    scene: Scene,
    station: Station,
    candidates: Candidates | None = None,
) -> Run:
    """Writes a new run without results.

    Writes the candidates first, if they are known, then run.yaml, which makes the folder a run,
    then the copies of scene and station; see `require_run_folder`.

    Raises:
        InvalidInputError: the folder cannot be written.
    """
    ensure_writable_folder(folder)
    if candidates is not None:
        candidates.save(folder / GRASPS_FILE)
    run = save_run(Run(folder, document))
    write_copies(folder, scene, station)
    return run


def write_copies(folder: Path, scene: Scene, station: Station) -> None:
    """Writes the copies of scene and station that a run lacks, for example as it was killed."""
    if not (folder / SCENE_FILE).exists():
        library = portable_reference(scene.library.root, folder)
        save_scene(dataclasses.replace(scene.document, library=library), folder / SCENE_FILE)
    if not (folder / STATION_FILE).exists():
        save_document(portable_station(station, folder), folder / STATION_FILE)


def save_run(run: Run) -> Run:
    """Writes run.yaml."""
    header = "Record of a burg-drake evaluation; written by the program."
    save_document(run.document, run.path / RUN_FILE, header)
    return run


def require_run_folder(folder: Path) -> None:
    """Refuses a folder that holds anything but a run. Does not create it.

    A folder without run.yaml may only hold the files of a run that was killed at its start: an
    empty journal, possibly with candidates. Other file names prove nothing: scene.yaml,
    station.yaml or grasps.npz may be the user's own.

    Raises:
        InvalidInputError: the folder cannot be written, or holds other files.
    """
    if not folder.exists():
        return
    ensure_writable_folder(folder)
    if (folder / RUN_FILE).exists():
        return
    journal = folder / JOURNAL_FILE
    begun = journal.is_file() and journal.stat().st_size == 0
    refuse_other_files(folder, {JOURNAL_FILE, GRASPS_FILE} if begun else ())


def refuse_other_files(folder: Path, own: Collection[str] = ()) -> None:
    """Refuses a folder with files that are neither hidden nor named in `own`."""
    names = {path.name for path in folder.iterdir() if not path.name.startswith(".")}
    if foreign := sorted(names.difference(own)):
        raise InvalidInputError(
            f"{folder} is not empty and not a run: it has {foreign[0]} in it; choose another folder"
        ).about("out")


def portable_station(station: Station, folder: Path) -> StationDocument:
    """Document of a station for a copy in `folder`, with references that are valid there."""
    document = station.document
    hand = resolve_reference(document.hand, "models/hands", station.path.parent, station.packages)
    arm = document.arm
    if arm is not None and station.arm_model is not None:
        arm = dataclasses.replace(arm, model=portable_reference(station.arm_model, folder))
    stated = {n: portable_reference(path, folder) for n, path in station.packages.stated.items()}
    hand_reference = portable_reference(hand, folder)
    return dataclasses.replace(document, hand=hand_reference, arm=arm, packages=stated)
