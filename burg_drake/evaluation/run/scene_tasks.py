"""What is done about a scene of many before and after it is judged, in a process of its own."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from burg_drake.core import SimulationError
from burg_drake.core.files import remove_unfinished, writable_folder
from burg_drake.evaluation.records import JOURNAL_FILE, Journal, TableFormat
from burg_drake.evaluation.run.preparation import finish_run, open_run, require_sound
from burg_drake.evaluation.run.request import Request
from burg_drake.evaluation.store import (
    RUN_FILE,
    PartWriter,
    StoredRun,
    load_run,
    require_run_folder,
)
from burg_drake.scene.document import Scene, as_scene


@dataclass(frozen=True, eq=False)
class Prepare:
    """A scene whose run is to be begun, or gone on with.

    Attributes:
        name: of the scene in the run.
        folder: of its run.
        scene: as loaded, or its file.
    """

    name: str
    folder: Path
    scene: Scene | Path


@dataclass(frozen=True)
class Finish:
    """A scene that is judged, or so far that its rows go to a part.

    Attributes:
        name: of the scene in the run.
        judged: whether all that is judged here is; then table and report are written, too.
    """

    name: str
    judged: bool = True


@dataclass(frozen=True)
class CloseParts:
    """The parts are to be written to the end."""


@dataclass(frozen=True, eq=False)
class Preparer:
    """Prepares scenes.

    Attributes:
        request: what is asked.
    """

    request: Request

    def __call__(self, work: Prepare) -> Scene | None:
        """Makes the folder of a scene's run; returns the scene, or None if there are no grasps.

        Raises:
            BurgError: it cannot be judged.
        """
        scene = as_scene(work.scene)
        request = self.request.of_scene(scene)
        if request is None:
            return None
        require_run_folder(work.folder)
        if not (work.folder / RUN_FILE).exists():
            require_sound(scene, request.station, request.mode, request.engine)
        given = request.given(scene)
        remove_unfinished(writable_folder(work.folder))
        with Journal(work.folder / JOURNAL_FILE):
            open_run(work.folder, scene, request, given)
        return scene


@dataclass(frozen=True)
class SceneOutputs:
    """What is kept of the scenes.

    Attributes:
        folder: of the run over many scenes.
        places: the runs of its scenes.
        instances: names of the free objects of all of them.
        table: format of the tables.
        reports: whether each scene gets a report.
    """

    folder: Path
    places: tuple[StoredRun, ...]
    instances: Sequence[str]
    table: TableFormat
    reports: bool


class Finisher:
    """Writes what comes of scenes: tables, reports, parts."""

    def __init__(self, keeping: SceneOutputs) -> None:
        self._keeping = keeping
        self._folders = {place.scene: place.folder for place in keeping.places}
        self._writer: PartWriter | None = None

    def __call__(self, work: Finish | CloseParts) -> None:
        """Does a piece of work.

        Raises:
            BurgError: a file cannot be written.
        """
        if isinstance(work, CloseParts):
            if self.writer.behind():
                self.writer.catch_up()
            self.writer.close()
            return
        run = load_run(self._folders[work.name])
        if work.judged:
            run = finish_run(run, self._keeping.table, report=self._keeping.reports)
        self.writer.take(work.name, run)

    @property
    def writer(self) -> PartWriter:
        """Opened when it is needed, as it looks at all parts."""
        if self._writer is None:
            keeping = self._keeping
            self._writer = PartWriter(keeping.folder, keeping.places, keeping.instances)
        return self._writer


def prepare_scene(preparer: Preparer, work: Prepare) -> Scene | None:
    """Prepares a scene in a worker; see `Preparer`.

    Raises:
        BurgError: it cannot be judged.
    """
    try:
        return preparer(work)
    except SystemExit as error:  # DRAKE_DEMAND ends this way
        raise SimulationError(f"SystemExit: {error}") from error


def finish_scene(finisher: Finisher, work: Finish | CloseParts) -> None:
    """Writes what came of a scene in a worker; see `Finisher`.

    Raises:
        BurgError: a file cannot be written.
    """
    finisher(work)
