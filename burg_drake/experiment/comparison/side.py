"""What is compared: a run, or real trials, and by which settings it was made."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from burg_drake.core.errors import InvalidInputError
from burg_drake.evaluation.origin import engine_label
from burg_drake.evaluation.results import load_runs
from burg_drake.evaluation.run_document import HASH_DIGITS, differences, identity
from burg_drake.evaluation.run_store import Run
from burg_drake.experiment.trials.sheet import TrialSheet

MOST_NAMED = 3


@dataclass(frozen=True, kw_only=True)
class Side:
    """One of the things compared.

    Attributes:
        kind: `run`, or `trials` on the robot.
        path: folder of the run, or the trials file.
        label: for people, such as `hand, standard`; `reality`.
        scenes: names of the scenes.
        hashes: of the runs.
        station, mode, engine: how it was judged; several are joined by commas.
    """

    kind: Literal["run", "trials"]
    path: str
    label: str
    scenes: tuple[str, ...]
    hashes: tuple[str, ...]
    station: str
    mode: str
    engine: str


@dataclass(frozen=True, eq=False)
class Judged:
    """The runs in a folder.

    Attributes:
        path: the folder.
        runs: one for each scene.
    """

    path: Path
    runs: Sequence[Run]

    @classmethod
    def load(cls, path: str | Path | Run) -> Judged:
        """The runs in a folder; see `load_runs`."""
        if isinstance(path, Run):
            return cls(path.path, [path])
        return cls(Path(path), load_runs(path))

    @property
    def scenes(self) -> dict[str, str]:
        """Names of the scenes by content, as tables have it."""
        inputs = [run.document.scene for run in self.runs]
        return {scene.content[:HASH_DIGITS]: scene.name for scene in inputs}

    @property
    def folders(self) -> dict[str, str]:
        """Folders of the runs by content of the scene."""
        runs = reversed(self.runs)
        return {run.document.scene.content[:HASH_DIGITS]: str(run.path) for run in runs}

    @property
    def side(self) -> Side:
        """What it is, for people."""
        documents = [run.document for run in self.runs]
        mode = _joined(d.mode for d in documents)
        engine = _joined(engine_label(d.engine) for d in documents)
        return Side(
            kind="run",
            path=str(self.path),
            label=f"{mode}, {engine}",
            scenes=tuple(dict.fromkeys(d.scene.name for d in documents)),
            hashes=tuple(d.hash for d in documents),
            station=_joined(d.station.name for d in documents),
            mode=mode,
            engine=engine,
        )


def side_of_trials(sheet: TrialSheet, path: Path) -> Side:
    """Real trials, for people."""
    sources = sheet.runs.values()
    return Side(
        kind="trials",
        path=str(path),
        label="reality",
        scenes=tuple(dict.fromkeys(s.scene.name for s in sources)),
        hashes=tuple(s.hash for s in sources),
        station=_joined(s.station.name for s in sources),
        mode="robot",
        engine="reality",
    )


def settings_apart(first: Judged, second: Judged) -> tuple[str, ...]:
    """In what the runs of two folders differ, in words, by their first scene in common."""
    theirs = {run.document.scene.content: run for run in second.runs}
    for run in first.runs:
        other = theirs.get(run.document.scene.content)
        if other is not None:
            found = differences(identity(run.document), identity(other.document))
            return tuple(
                text.replace(" there, ", " in the first, ").removesuffix(" here") + " in the second"
                for text in found
            )
    return ()


def require_common_scene(first: Judged, second: Judged) -> None:
    """Refuses runs of different scenes.

    Raises:
        InvalidInputError: they have no scene in common; the message names them.
    """
    if not set(first.scenes) & set(second.scenes):
        raise InvalidInputError(
            f"{first.path} is of scene {_named(first)}, {second.path} of {_named(second)}; runs to"
            " be compared judge the same grasps on the same scene"
        )


def _named(judged: Judged) -> str:
    names = [f"{name} ({content})" for content, name in judged.scenes.items()]
    more = f" and {len(names) - MOST_NAMED} more" if len(names) > MOST_NAMED else ""
    return ", ".join(names[:MOST_NAMED]) + more


def _joined(texts: Iterable[str]) -> str:
    return ", ".join(dict.fromkeys(texts))
