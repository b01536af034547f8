"""Folder of a run over many scenes, progress of its scenes, and results of any run."""

from __future__ import annotations

import json
import os
from collections.abc import Iterable, Sequence
from dataclasses import asdict, dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, get_args

from burg_drake.core import (
    InvalidInputError,
    UnknownNameError,
    ensure_writable_folder,
    load_document,
    open_regular,
    save_document,
    suggest_names,
)
from burg_drake.evaluation.part_store import PARTS_FOLDER, read_rows
from burg_drake.evaluation.results_table import TEXT_COLUMNS, Columns
from burg_drake.evaluation.run_document import CampaignDocument
from burg_drake.evaluation.run_folder import (
    REPORT_FILE,
    RUN_FILE,
    Run,
    StoredRun,
    load_run,
    refuse_other_files,
)
from burg_drake.evaluation.settings import select_share
from burg_drake.evaluation.table_parts import StoredRows, results_frame

if TYPE_CHECKING:
    import pandas

CAMPAIGN_FILE = "campaign.yaml"
SCENES_FOLDER = "scenes"
CAMPAIGN_LOCK_FILE = ".lock"
SCENE_STATES_FILE = "scenes.jsonl"


@dataclass(frozen=True, eq=False, repr=False)
class Campaign:
    """A run over many scenes, complete or not.

    Attributes:
        path: folder of the run.
        document: contents of campaign.yaml.
    """

    path: Path
    document: CampaignDocument

    def __repr__(self) -> str:
        count, done = (
            len(self.document.assigned_scenes),
            sum(s.state == "done" for s in self.states.values()),
        )
        return f"Campaign({str(self.path)!r}, {done} of {count} scenes judged)"

    @property
    def names(self) -> list[str]:
        """Names of the scenes assigned to this run (or shard), in order."""
        return [entry.name for entry in self.document.assigned_scenes]

    @cached_property
    def states(self) -> dict[str, SceneState]:
        """Progress by scene name; scenes that have not been begun are left out."""
        return SceneStates(self.path).states

    @cached_property
    def runs(self) -> tuple[Run, ...]:
        """Runs of the scenes that have been begun, in order, each read from its folder."""
        return tuple(
            load_run(stored.folder)
            for stored in self.stored_runs
            if (stored.folder / RUN_FILE).exists()
        )

    def run(self, name: str) -> Run:
        """The run of a scene.

        Raises:
            UnknownNameError: there is no such scene.
            InvalidInputError: the scene has not been begun, or could not be judged.
        """
        if name not in self.names:
            raise UnknownNameError(
                f"{self.path} has no scene {name!r}; {suggest_names(name, self.names)}"
            )
        return load_run(self.folder(name))

    def folder(self, name: str) -> Path:
        """The folder of a scene's run."""
        return self.path / SCENES_FOLDER / name

    @property
    def stored_runs(self) -> list[StoredRun]:
        """Runs of the scenes, begun or not."""
        return [StoredRun(name, self.folder(name)) for name in self.names]

    @property
    def instances(self) -> list[str]:
        """Names of the free objects of all scenes."""
        return self.document.instances

    def rows(self, names: Sequence[str] | None = None) -> StoredRows:
        """Rows of all judged grasps from the columnar store.

        `StoredRows.run` has the index of each row's scene in `self.names`.

        Raises:
            MissingDependencyError: pyarrow is not installed.
        """
        return read_rows(self, names)

    def columns(self, names: Sequence[str] | None = None) -> Columns:
        """Columns of all judged grasps, scene by scene; see `evaluation.results_table`.

        Args:
            names: names of the columns; all if None, which takes much memory with many grasps.
                Cells of columns that a scene lacks are NaN or empty texts.

        Raises:
            MissingDependencyError: pyarrow is not installed.
        """
        rows = self.rows(names)
        return rows.columns(rows.table.column_names)

    @property
    def results(self) -> Columns:
        """All columns."""
        return self.columns()

    def frame(self, names: Sequence[str] | None = None) -> pandas.DataFrame:
        """Judged grasps as a data frame; see `evaluation.table_parts`.

        Raises:
            MissingDependencyError: pandas or pyarrow is not installed.
        """
        rows = self.rows(names)
        return results_frame(rows, rows.table.column_names, TEXT_COLUMNS, self.names)

    @property
    def failed(self) -> dict[str, str]:
        """Scenes that could not be judged, with the reason of each."""
        return {n: s.why for n in self.names if (s := self.states.get(n)) and s.state == "failed"}

    @property
    def open_scenes(self) -> list[str]:
        """Names of scenes that are not finished: not fully judged, empty or failed."""
        ended = {name for name, state in self.states.items() if state.state != "open"}
        return [name for name in self.names if name not in ended]

    @property
    def complete(self) -> bool:
        """Whether all grasps assigned to this run (or shard) are judged."""
        return not self.open_scenes and not self.failed

    @property
    def report_path(self) -> Path:
        """Path of the report."""
        return self.path / REPORT_FILE

    @property
    def expected(self) -> int:
        """Number of grasps assigned to this run (or shard); see `expected_by_scene`."""
        return sum(self.expected_by_scene.values())

    @property
    def expected_by_scene(self) -> dict[str, int]:
        """Number of grasps assigned to this run (or shard), by scene.

        For a scene that has not been begun: the number asked for; 0 if grasps are given.
        """
        document, shard = self.document, self.document.shard_of_grasps
        only = set(document.grasps.only)
        found = {}
        for entry in document.assigned_scenes:
            state = self.states.get(entry.name)
            asked = range((document.grasps.per_object or 0) * len(entry.selected_instances(only)))
            assigned = select_share(asked, shard)
            found[entry.name] = len(assigned) if state is None or state.why else state.mine
        return found


def load_campaign(path: str | Path) -> Campaign:
    """Reads a run over many scenes, complete or not.

    Example::

        campaign = burg.load_campaign("runs/many")
        for run in campaign.runs:
            print(run.path.name, run.best(3))

    Raises:
        InvalidInputError: the folder holds no such run.
        DocumentError: campaign.yaml does not fit the schema.
    """
    path = Path(path)
    if not is_campaign(path):
        raise InvalidInputError(
            f"{path} is not a run over many scenes ({CAMPAIGN_FILE} is missing);"
            " burg-drake evaluate SCENE SCENE ... makes one"
        )
    return Campaign(path, load_document(path / CAMPAIGN_FILE, CampaignDocument))


def is_campaign(path: str | Path) -> bool:
    """Whether a folder holds a run over many scenes."""
    return (Path(path) / CAMPAIGN_FILE).is_file()


def save_campaign(campaign: Campaign) -> Campaign:
    """Writes campaign.yaml."""
    header = "Record of a burg-drake evaluation of many scenes; written by the program."
    save_document(campaign.document, campaign.path / CAMPAIGN_FILE, header)
    return campaign


def require_campaign_folder(folder: Path) -> None:
    """Refuses a folder that holds anything but a run over many scenes. Does not create it.

    Raises:
        InvalidInputError: the folder cannot be written, or holds other files.
    """
    if not folder.exists():
        return
    ensure_writable_folder(folder)
    if is_campaign(folder):
        return
    if (folder / RUN_FILE).exists():
        raise InvalidInputError(
            f"{folder} holds a run of one scene, but several scenes are given; choose"
            " another folder"
        ).about("out")
    refuse_other_files(folder)


def open_results(path: str | Path) -> Run | Campaign:
    """Reads the run in a folder, of one scene or of many.

    Raises:
        InvalidInputError: there is no run.
        DocumentError: run.yaml or campaign.yaml does not fit the schema.
    """
    return load_campaign(path) if is_campaign(path) else load_run(path)


def load_runs(path: str | Path) -> list[Run]:
    """Reads the runs in a folder: one, or one for each scene of a run over many scenes.

    Raises:
        InvalidInputError: there is no run.
        DocumentError: run.yaml or campaign.yaml does not fit the schema.
    """
    found = open_results(path)
    return list(found.runs) if isinstance(found, Campaign) else [found]


def read_results(path: str | Path, names: Sequence[str] | None = None) -> Columns:
    """Reads columns of all judged grasps in a folder.

    `run` and `id` together name a row.

    Example::

        columns = burg.read_results("runs/first", ["object", "outcome", "clearance"])
        lifted = columns["object"][columns["outcome"] == "lifted"]

    Args:
        path: folder of a run, of one scene or of many.
        names: names of the columns; all if None. With many grasps only these are read from disk.
            Cells of columns that a run lacks are NaN or empty texts.

    Raises:
        InvalidInputError: there is no run.
        DocumentError: run.yaml or campaign.yaml does not fit the schema.
        MissingDependencyError: a run over many scenes without pyarrow.
    """
    found = open_results(path)
    if isinstance(found, Run) and (found.path / PARTS_FOLDER).is_dir():
        rows = read_rows(found, names)
        return rows.columns(rows.table.column_names)
    return found.columns(names)


SceneStateName = Literal["open", "done", "failed", "empty"]


@dataclass(frozen=True, kw_only=True)
class SceneState:
    """Progress of a scene.

    Attributes:
        scene: name of the scene in the run.
        state: `open` once its grasps are known, `done` once all assigned grasps are judged,
            `failed` if it cannot be judged, `empty` if there are no grasps for it.
        run: hash of the scene's run.
        grasps: number of grasps on the scene.
        mine: number of grasps assigned to this run (or shard).
        sampling: CPU time of the sampling [s].
        size: size of the journal when the scene was done [bytes].
        failed: number of grasps that could not be simulated.
        interrupted: number of failed grasps whose worker was killed from outside.
        why: reason of the failure.
        missing: notes on instances with fewer grasps than asked for; see `run_notes`.
    """

    scene: str
    state: SceneStateName
    run: str = ""
    grasps: int = 0
    mine: int = 0
    sampling: float = 0.0
    size: int = 0
    failed: int = 0
    interrupted: int = 0
    why: str = ""
    missing: str = ""


SCENE_STATE_TYPES = dict.fromkeys(("scene", "state", "run", "why", "missing"), str) | {
    "sampling": float
}
"""Types of the fields of `SceneState`; the others are integers."""


class SceneStates:
    """Progress of the scenes of a run, kept in a file."""

    def __init__(self, folder: Path) -> None:
        """Reads the file of a run, if it exists.

        Raises:
            InvalidInputError: the file cannot be read.
        """
        self._path = folder / SCENE_STATES_FILE
        self.states: dict[str, SceneState] = {}
        self._offset = 0
        self.refresh()

    def refresh(self) -> None:
        """Reads the lines that other processes have appended since the last read."""
        if not self._path.exists():
            self.states, self._offset = {}, 0
            return
        with open_regular(self._path) as stream:
            if os.fstat(stream.fileno()).st_size < self._offset:
                self.states, self._offset = {}, 0
            stream.seek(self._offset)
            while (line := stream.readline(1 << 16)).endswith(b"\n"):
                self._offset += len(line)
                state = _read_state(line)
                if state is not None:
                    self.states[state.scene] = state

    def note(self, state: SceneState) -> None:
        """Appends a state.

        Raises:
            InvalidInputError: the file cannot be written.
        """
        if self.states.get(state.scene) == state:
            return
        torn = self._path.exists() and not _ends_with_newline(self._path)
        line = ("\n" if torn else "") + _state_line(state)
        try:
            with self._path.open("a", encoding="utf-8") as stream:
                stream.write(line)
        except OSError as error:
            raise InvalidInputError(f"cannot write {self._path}: {error.strerror}") from error
        self.states[state.scene] = state


def scene_states_text(states: Iterable[SceneState]) -> str:
    """Contents of the file that `SceneStates` reads."""
    return "".join(_state_line(state) for state in states)


def _state_line(state: SceneState) -> str:
    """Encodes a state as one line of JSON, without fields at their default."""
    defaults = asdict(SceneState(scene="", state="open"))
    fields = {
        name: value
        for name, value in asdict(replace(state, why=state.why[:4000])).items()
        if value != defaults[name] or name in ("scene", "state")
    }
    return json.dumps(fields, separators=(",", ":")) + "\n"


def _read_state(line: bytes) -> SceneState | None:
    """Decodes a line; None if it is not a valid state."""
    try:
        stored: Any = json.loads(line)
        state = SceneState(**stored)
    except (ValueError, RecursionError, TypeError):
        return None
    known = state.state in get_args(SceneStateName)
    typed = all(type(v) is SCENE_STATE_TYPES.get(k, int) for k, v in stored.items())
    return state if known and typed else None


def _ends_with_newline(path: Path) -> bool:
    with open_regular(path) as stream:
        size = stream.seek(0, os.SEEK_END)
        stream.seek(max(0, size - 1))
        return size == 0 or stream.read(1) == b"\n"
