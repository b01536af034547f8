"""The folder of a run over many scenes, and how to read the results in a folder of either kind."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from burg_drake.core import (
    InvalidInputError,
    UnknownNameError,
    ensure_writable_folder,
    load_document,
    save_document,
    suggest_names,
)
from burg_drake.evaluation.campaign_document import CampaignDocument, Ledger, SceneState
from burg_drake.evaluation.part_store import PARTS_FOLDER, StoredRun, read_rows
from burg_drake.evaluation.results_table import TEXT_COLUMNS, Columns
from burg_drake.evaluation.run_folder import REPORT_FILE, RUN_FILE, Run, load_run
from burg_drake.evaluation.settings import select_share
from burg_drake.evaluation.table_parts import StoredRows, frame_of_rows

if TYPE_CHECKING:
    import pandas

CAMPAIGN_FILE = "campaign.yaml"
SCENES_FOLDER = "scenes"
CAMPAIGN_LOCK_FILE = ".lock"


@dataclass(frozen=True, eq=False, repr=False)
class Campaign:
    """A run over many scenes, complete or not.

    Attributes:
        path: its folder.
        document: contents of campaign.yaml.
    """

    path: Path
    document: CampaignDocument

    def __repr__(self) -> str:
        count, done = len(self.document.mine), sum(s.state == "done" for s in self.states.values())
        return f"Campaign({str(self.path)!r}, {done} of {count} scenes judged)"

    @property
    def names(self) -> list[str]:
        """Names of the scenes that are judged here, in order."""
        return [entry.name for entry in self.document.mine]

    @cached_property
    def states(self) -> dict[str, SceneState]:
        """How far scenes are, by name; nothing is known of one that has not been begun."""
        return Ledger(self.path).states

    @cached_property
    def runs(self) -> tuple[Run, ...]:
        """The runs of the scenes that have been begun, in order; each is read from its folder."""
        return tuple(
            load_run(place.folder) for place in self.places if (place.folder / RUN_FILE).exists()
        )

    def run(self, name: str) -> Run:
        """The run of a scene.

        Raises:
            UnknownNameError: there is no such scene.
            InvalidInputError: it has not been begun, or could not be judged.
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
    def places(self) -> list[StoredRun]:
        """Where the runs of the scenes are, begun or not."""
        return [StoredRun(name, self.folder(name)) for name in self.names]

    def rows(self, names: Sequence[str] | None = None) -> StoredRows:
        """Columns of all judged grasps, as they lie in the store; `StoredRows.run` is the place of
        each row's scene in `names`.

        Raises:
            MissingDependencyError: pyarrow is not installed.
        """
        return read_rows(self.path, self.places, names, self.document.instances)

    def columns(self, names: Sequence[str] | None = None) -> Columns:
        """Columns of all judged grasps, scene by scene; see `evaluation.results_table`.

        Args:
            names: of the columns; all if None, which takes much memory where there are many
                grasps. What a scene does not have is NaN, or an empty text.

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
        return frame_of_rows(self.rows(names), self.names)

    @property
    def failed(self) -> dict[str, str]:
        """Why scenes could not be judged, by name."""
        return {n: s.why for n in self.names if (s := self.states.get(n)) and s.state == "failed"}

    @property
    def complete(self) -> bool:
        """Whether every grasp of every scene that is judged here is judged."""
        states = [self.states.get(name) for name in self.names]
        return all(state is not None and state.state in ("done", "empty") for state in states)

    @property
    def report_path(self) -> Path:
        """The report."""
        return self.path / REPORT_FILE

    @property
    def expected(self) -> int:
        """Number of grasps that are judged here; see `expected_by_scene`."""
        return sum(self.expected_by_scene.values())

    @property
    def expected_by_scene(self) -> dict[str, int]:
        """Number of grasps that are judged here, by scene; of scenes that have not been begun as
        many as are asked for, and 0 if grasps are given."""
        document, shard = self.document, self.document.shard_of_grasps
        only = set(document.grasps.only)
        found = {}
        for entry in document.mine:
            state = self.states.get(entry.name)
            asked = range((document.grasps.per_object or 0) * len(entry.chosen(only)))
            mine = select_share(asked, shard)
            found[entry.name] = len(mine) if state is None or state.why else state.mine
        return found


def load_campaign(path: str | Path) -> Campaign:
    """Reads a run over many scenes, complete or not.

    Example::

        campaign = burg.load_campaign("runs/many")
        for run in campaign.runs:
            print(run.path.name, run.best(3))

    Raises:
        InvalidInputError: there is none.
        DocumentError: its campaign.yaml does not fit the schema.
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
    """Refuses a folder that holds anything but a run over many scenes; makes none.

    Raises:
        InvalidInputError: it cannot be written, or something else is in it.
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
    foreign = sorted(path.name for path in folder.iterdir() if not path.name.startswith("."))
    if foreign:
        raise InvalidInputError(
            f"{folder} is not empty and not a run: it has {foreign[0]} in it; choose another folder"
        ).about("out")


def open_results(path: str | Path) -> Run | Campaign:
    """The run in a folder, of one scene or of many.

    Raises:
        InvalidInputError: there is no run.
        DocumentError: its document does not fit the schema.
    """
    return load_campaign(path) if is_campaign(path) else load_run(path)


def load_runs(path: str | Path) -> list[Run]:
    """The runs in a folder: one, or those of each scene of a run over many scenes.

    Raises:
        InvalidInputError: there is no run.
        DocumentError: its document does not fit the schema.
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
        names: of the columns, which is all that is read where there are many grasps; all if None.
            What a run does not have is NaN, or an empty text.

    Raises:
        InvalidInputError: there is no run.
        DocumentError: its document does not fit the schema.
        MissingDependencyError: a run over many scenes without pyarrow.
    """
    found = open_results(path)
    if isinstance(found, Campaign):
        return found.columns(names)
    if (found.path / PARTS_FOLDER).is_dir():
        rows = read_rows(found.path, [StoredRun("", found.path)], names)
        return rows.columns(rows.table.column_names)
    table = found.results
    count = len(table["id"])
    missing = {name: np.full(count, "" if name in TEXT_COLUMNS else np.nan) for name in names or ()}
    return table if names is None else {name: {**missing, **table}[name] for name in names}
