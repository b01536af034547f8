"""What is compared: a run, or real trials, and by which settings it was made."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import Literal

import numpy as np

from burg_drake.core import InvalidInputError
from burg_drake.evaluation.records import HASH_DIGITS, engine_label, request_differences
from burg_drake.evaluation.store import (
    RUN_FILE,
    Campaign,
    Run,
    load_run,
    open_results,
    read_results,
)
from burg_drake.experiment.pairing.result_table import ResultTable
from burg_drake.experiment.pairing.text_codes import Factor
from burg_drake.experiment.trials import TrialSheet

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
        judged_again: how many of the compared grasps another engine has judged again, by the name
            of that engine.
    """

    kind: Literal["run", "trials"]
    path: str
    label: str
    scenes: tuple[str, ...]
    hashes: tuple[str, ...]
    station: str
    mode: str
    engine: str
    judged_again: Mapping[str, int] = field(default_factory=dict)

    @property
    def engines(self) -> str:
        """Whose verdicts they are, in words."""
        parts = [f"engine {self.engine}"]
        for name, count in self.judged_again.items():
            parts.append(f"{count:,} grasp{'' if count == 1 else 's'} judged again by {name}")
        return ", ".join(parts)


@dataclass(frozen=True, eq=False)
class JudgedRuns:
    """The runs in a folder.

    Attributes:
        found: a run of one scene or of many.
    """

    found: Run | Campaign

    @classmethod
    def load(cls, path: str | Path | Run | Campaign) -> JudgedRuns:
        """The runs in a folder; see `evaluation.results`."""
        return cls(path if isinstance(path, (Run, Campaign)) else open_results(path))

    @property
    def path(self) -> Path:
        """The folder."""
        return self.found.path

    @cached_property
    def scenes(self) -> dict[str, str]:
        """Names of the scenes by content, as tables have it."""
        if isinstance(self.found, Run):
            scene = self.found.document.scene
            return {scene.content[:HASH_DIGITS]: scene.name}
        return {e.content[:HASH_DIGITS]: e.name for e in self.found.document.mine}

    @cached_property
    def folders(self) -> dict[str, str]:
        """Folders of the runs by content of the scene."""
        if isinstance(self.found, Run):
            return dict.fromkeys(self.scenes, str(self.path))
        return {content: str(self.found.folder(name)) for content, name in self.scenes.items()}

    def runs_of(self, contents: Collection[str]) -> list[Run]:
        """The runs of some scenes by their content, in full; only these are opened."""
        if isinstance(self.found, Run):
            return [self.found]
        wanted = {content[:HASH_DIGITS] for content in contents}
        folders = [Path(self.folders[content]) for content in self.scenes if content in wanted]
        return [load_run(folder) for folder in folders if (folder / RUN_FILE).exists()]

    def instances_of(self, contents: Collection[str]) -> dict[str, tuple[str, ...]]:
        """Names of the free instances of some scenes by their content."""
        return {run.document.scene.content: run.instances for run in self.runs_of(contents)}

    def table(self, names: Sequence[str]) -> ResultTable:
        """Columns of all judged grasps; `evaluation.records.table` says which there are."""
        if isinstance(self.found, Campaign):
            return ResultTable.of_rows(self.found.rows(names), names)
        return ResultTable.of_columns(read_results(self.path, names), names)

    @property
    def grasps_place(self) -> str:
        """The folder that `evaluate` takes their grasps from, in words; of many scenes one each."""
        if isinstance(self.found, Run):
            return f"folder {self.path}"
        return f"of each scene folder {self.found.folder('SCENE')}"

    @property
    def side(self) -> Side:
        """What it is, for people."""
        document = self.found.document
        engine = engine_label(document.engine)
        return Side(
            kind="run",
            path=str(self.path),
            label=f"{document.mode}, {engine}",
            scenes=tuple(self.scenes.values()),
            hashes=(document.hash,),
            station=document.station.name,
            mode=document.mode,
            engine=engine,
        )


def settled_side(side: Side, judged_again: Factor) -> Side:
    """A side with the engines that have judged its grasps again.

    Args:
        side: a run.
        judged_again: (N,) of the compared grasps; empty texts where none has.
    """
    counts = np.bincount(judged_again.index, minlength=len(judged_again.names)).tolist()
    named = zip(judged_again.names, counts, strict=True)
    return replace(side, judged_again={name: n for name, n in named if name and n})


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


def settings_apart(first: JudgedRuns, second: JudgedRuns) -> tuple[str, ...]:
    """In what the runs of two folders differ, in words."""
    sides = ("in the first", "in the second")
    return tuple(request_differences(first.found.document, second.found.document, sides))


def require_common_scene(first: JudgedRuns, second: JudgedRuns) -> None:
    """Refuses runs of different scenes.

    Raises:
        InvalidInputError: they have no scene in common; the message names them.
    """
    if not set(first.scenes) & set(second.scenes):
        raise InvalidInputError(
            f"{first.path} is of scene {named(first.scenes)}, but {second.path} is of"
            f" scene {named(second.scenes)}; runs can be compared if they judge the same"
            " grasps in the same scene"
        )


def named(scenes: Mapping[str, str]) -> str:
    """Names of scenes by content, for messages; of many the first few."""
    names = [f"{name} ({content})" for content, name in scenes.items()]
    more = f" and {len(names) - MOST_NAMED} more" if len(names) > MOST_NAMED else ""
    return ", ".join(names[:MOST_NAMED]) + more


def _joined(texts: Iterable[str]) -> str:
    return ", ".join(dict.fromkeys(texts))
