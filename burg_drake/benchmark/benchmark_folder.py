"""The folder of a benchmark: its record, the suite, the planner's answers, and the judged grasps.

RESULT/benchmark.yaml            which planner was run on which suite, and how long it took
RESULT/suite.yaml                the suite
RESULT/answers/SCENE.CAMERA.npz  grasps of one answer that are judged, best first
RESULT/trials/                   run over all scenes, as `evaluate` writes it
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from burg_drake.benchmark.settings import Conditions, Protocol, Split
from burg_drake.benchmark.suite import SuiteDocument
from burg_drake.core import (
    Array,
    GraspSet,
    InvalidInputError,
    Outcome,
    Stage,
    UnknownNameError,
    Verdict,
    content_hash,
    load_document,
    save_document,
)
from burg_drake.evaluation import (
    INSTANCE_COLUMN,
    TRIAL_FRICTION_COLUMN,
    Campaign,
    is_campaign,
    load_campaign,
    shown_ids,
)
from burg_drake.scene import Scene

BENCHMARK_FILE = "benchmark.yaml"
SUITE_FILE = "suite.yaml"
ANSWERS_FOLDER = "answers"
TRIALS_FOLDER = "trials"
ROUNDS_FOLDER = "rounds"
SCENES_FOLDER = "scenes"
RANK_COLUMN = "rank"
"""Column of an answer: place of the grasp, from 0."""
CAMERA_COLUMN = "camera"
"""Column of an answer: camera of the observation."""
SCORE_COLUMN = "planner_score"
"""Column of an answer: score that the planner gave."""
FRICTION_COLUMN = "friction_needed"
"""Column of an answer: smallest friction coefficient at which the grasp holds, by geometry."""


@dataclass(frozen=True, kw_only=True)
class BenchmarkTimes:
    """Wall-clock time of the parts of a benchmark, of calls that ran to the end [s].

    Attributes:
        rendering: time waited for observations.
        planning: time waited for the planner.
        judging: time of the screens, the arm's motions and the trials.
        total: all of it.
    """

    rendering: float = 0.0
    planning: float = 0.0
    judging: float = 0.0
    total: float = 0.0

    def __add__(self, other: BenchmarkTimes) -> BenchmarkTimes:
        return BenchmarkTimes(**{k: round(v + vars(other)[k], 3) for k, v in vars(self).items()})


@dataclass(frozen=True, kw_only=True)
class BenchmarkDocument:
    """A benchmark of one planner on one suite (`benchmark.yaml`).

    Attributes:
        command: command line that began the benchmark.
        name: name of the method in tables.
        planner: reference by which the planner was opened.
        planner_content: hash of the file with the planner's function, or for a built-in planner the
            version of burg_drake; empty for servers and commands.
        suite: name of the suite.
        release: release of the suite.
        suite_hash: hash of all that decides the suite's results.
        protocol: `single`: one answer for each image is judged. `clear`: the best grasp that can be
            executed takes its object away, and the planner is asked again.
        split: the scenes that were observed: `test` or `tuning`.
        depth_only: whether the planner got no colour images.
        settled: engine that judges contested grasps again; none if empty.
        conditions: how sensor, calibration and friction differ from the suite.
        images: hash of the images of a real camera; empty if images were rendered.
        photographed: names of the scenes that have images of a real camera.
        versions: versions of the software and the machine.
        complete: whether all scenes were observed and judged, and contested grasps settled.
        times: wall-clock times.
    """

    version: int = 1
    command: str
    name: str
    planner: str
    planner_content: str = ""
    suite: str
    release: int
    suite_hash: str
    protocol: Protocol = "single"
    split: Split = "test"
    depth_only: bool = False
    settled: str = ""
    conditions: Conditions = field(default_factory=Conditions)
    images: str = ""
    photographed: tuple[str, ...] = ()
    versions: dict[str, str] = field(default_factory=dict)
    complete: bool = False
    times: BenchmarkTimes = BenchmarkTimes()

    def differences(self, other: BenchmarkDocument) -> list[str]:
        """Differences of two requests in words; `self` is in the folder, `other` is asked for."""
        names = ["planner" if self.planner != other.planner else "name"]
        names += ["suite", "suite_hash", "protocol", "split", "depth_only"]
        names += ["conditions", "images"]
        if self.protocol == "clear":  # verdicts decide how a scene goes on
            names.append("settled")
        return [
            f"{name.replace('_', ' ')}: {getattr(self, name) or 'none'} there,"
            f" {getattr(other, name) or 'none'} here"
            for name in names
            if getattr(self, name) != getattr(other, name)
        ]


@dataclass(frozen=True, eq=False)
class StoredAnswer:
    """A planner's answer to one observation, as far as it is judged.

    Attributes:
        scene, camera: the observation.
        grasps: the grasps that are judged, best first, in the frames of their objects, with the
            columns `instance`, `rank`, `camera`, `planner_score` and `friction_needed`.
        observation: id of the observation.
        seconds: time that planning took [s]; NaN if there was no answer.
        answered: number of grasps in the answer.
        error: why there is no answer; empty if there is one.
        notes: remarks about the answer.
    """

    scene: str
    camera: str
    grasps: GraspSet
    observation: str
    seconds: float = math.nan
    answered: int = 0
    error: str = ""
    notes: tuple[str, ...] = ()

    @property
    def candidate_ids(self) -> list[str]:
        """Ids of the grasps in the run over all scenes."""
        return shown_ids(self.grasps)

    def save(self, folder: Path) -> None:
        """Writes the file of the answer into the folder of a round."""
        record = {
            "scene": self.scene,
            "camera": self.camera,
            "observation": self.observation,
            "seconds": None if math.isnan(self.seconds) else self.seconds,
            "answered": self.answered,
            "error": self.error,
            "notes": list(self.notes),
        }
        replace(self.grasps, provenance={"answer": record}).save(
            answer_path(folder, self.scene, self.camera)
        )

    @classmethod
    def load(cls, folder: Path, scene: str, camera: str) -> StoredAnswer:
        """Reads the file of an answer.

        Raises:
            InvalidInputError: the file is missing or damaged.
        """
        path = answer_path(folder, scene, camera)
        grasps = GraspSet.load(path)
        try:
            record: Mapping[str, Any] = grasps.provenance["answer"]
            seconds = record["seconds"]
            return cls(
                scene=scene,
                camera=camera,
                grasps=grasps,
                observation=str(record["observation"]),
                seconds=math.nan if seconds is None else float(seconds),
                answered=int(record["answered"]),
                error=str(record["error"]),
                notes=tuple(map(str, record["notes"])),
            )
        except (KeyError, TypeError, ValueError) as error:
            raise InvalidInputError(
                f"{path} is not the file of an answer ({error!r}); run the benchmark again into"
                " another folder"
            ) from error


def answer_path(folder: Path, scene: str, camera: str) -> Path:
    """Path of the file of an answer in the folder of a round."""
    return folder / ANSWERS_FOLDER / f"{scene}.{camera}.npz"


@dataclass(frozen=True)
class StoredGrasps:
    """Grasps of all answers, by scene, as `evaluate` takes them.

    Attributes:
        folder: folder of the round.
        cameras: names of the cameras.
        content: hash of all answers.
        count: number of all grasps.
    """

    folder: Path
    cameras: tuple[str, ...]
    content: str
    count: int

    def __call__(self, scene: Scene) -> dict[str, GraspSet]:
        """Grasps of a scene by instance."""
        parts = [StoredAnswer.load(self.folder, scene.name, c).grasps for c in self.cameras]
        grasps = GraspSet.concatenate([part for part in parts if len(part)] or parts[:1])
        if not len(grasps):
            return {}
        instance = grasps.columns[INSTANCE_COLUMN]
        return {
            name: grasps.select(instance == name) for name in scene.instances if name in instance
        }


@dataclass(frozen=True, eq=False)
class JudgedAnswer:
    """A planner's answer to one observation, with the verdicts.

    Attributes:
        answer: the answer.
        verdicts: verdict of each grasp, best first; None if the scene could not be judged.
        is_judged: whether the scene could be judged, so that the answer counts.
    """

    answer: StoredAnswer
    verdicts: tuple[Verdict | None, ...]
    is_judged: bool = True

    @property
    def ids(self) -> list[str]:
        """Ids of the grasps in the run over all scenes."""
        return self.answer.candidate_ids

    @property
    def executed(self) -> int | None:
        """Index of the best grasp that can be executed: the hand is clear and the arm gets there.
        None if there is none."""
        places = range(len(self.verdicts))
        return next((k for k in places if _is_executed(self.verdicts[k])), None)

    def lifted(self, *, contested_as: bool | None = None) -> Array:
        """(N,) whether each grasp lifted its object, 0 or 1.

        Args:
            contested_as: what contested verdicts count as; what they say if None.
        """
        return self._shares(lambda outcome: outcome is Outcome.LIFTED, contested_as)

    def held(self, *, contested_as: bool | None = None) -> Array:
        """(N,) whether each grasp held its object to the end, 0 or 1; see `lifted`."""
        return self._shares(lambda outcome: outcome.held, contested_as)

    def _shares(self, holds: Callable[[Outcome], bool], contested_as: bool | None) -> Array:
        """(N,) whether something holds of the outcome of each grasp, 0 or 1."""
        found = []
        for verdict in self.verdicts:
            if verdict is not None and verdict.contested and contested_as is not None:
                found.append(contested_as)
            else:
                found.append(verdict is not None and holds(verdict.outcome))
        return np.array(found, dtype=float)


def _is_executed(verdict: Verdict | None) -> bool:
    return verdict is not None and verdict.stage is Stage.EXECUTED


@dataclass(frozen=True, eq=False)
class BenchmarkResult:
    """A benchmark of one planner on one suite.

    Attributes:
        path: folder of the benchmark.
        document: contents of benchmark.yaml.
        suite: contents of suite.yaml.
    """

    path: Path
    document: BenchmarkDocument
    suite: SuiteDocument

    def __repr__(self) -> str:
        return f"BenchmarkResult({str(self.path)!r}, {self.document.name} on {self.suite.name})"

    def require_complete(self) -> None:
        """Refuses a benchmark that was interrupted.

        Raises:
            InvalidInputError: the message has the command that finishes it.
        """
        if not self.document.complete:
            raise InvalidInputError(
                f"{self.path} is not complete; finish it with the command that began it:"
                f" {self.document.command}"
            )

    @property
    def scene_names(self) -> list[str]:
        """Names of the scenes that are observed, in order: those of the split, or those that were
        photographed."""
        if self.document.images:
            return list(self.document.photographed)
        return [one.name for one in self.suite.scenes if one.split == self.document.split]

    @property
    def rounds(self) -> list[Round]:
        """The rounds: one, or with the protocol `clear` as many as were begun."""
        cameras = [camera.name for camera in self.suite.cameras]
        if self.document.protocol == "clear" or self.document.images:
            cameras = cameras[:1]
        found = [Round(self.path, tuple(self.scene_names), tuple(cameras))]
        while (folder := round_folder(self.path, len(found) + 1)).is_dir():
            names = [n for n in self.scene_names if scene_path(folder, n).exists()]
            found.append(Round(folder, tuple(names), tuple(cameras)))
        return found

    @cached_property
    def answers(self) -> list[JudgedAnswer]:
        """The first answer to each observation with its verdicts, scene by scene.

        Raises:
            InvalidInputError: the benchmark is not complete.
        """
        return self.judged_answers(self.rounds[0])

    def judged_answers(self, round: Round) -> list[JudgedAnswer]:
        """The answers of a round with their verdicts, scene by scene.

        Raises:
            InvalidInputError: an answer or a verdict is missing.
        """
        campaign, found = round.campaign, []
        finish = f"finish it with the command that began it: {self.document.command}"
        if campaign is not None and campaign.open_scenes:
            raise InvalidInputError(f"grasps in {campaign.path} are not all judged; {finish}")
        failed = {} if campaign is None else campaign.failed
        for scene in round.scenes:
            verdicts = _scene_verdicts(campaign, scene)
            for camera in round.cameras:
                path = answer_path(round.path, scene, camera)
                if not path.exists():
                    raise InvalidInputError(
                        f"{self.path} is not complete ({path.relative_to(self.path)} is missing);"
                        f" {finish}"
                    )
                answer = StoredAnswer.load(round.path, scene, camera)
                if len(answer.grasps) and campaign is None:
                    raise InvalidInputError(f"grasps of {self.path} are not judged; {finish}")
                known = tuple(verdicts.get(id) for id in answer.candidate_ids)
                found.append(JudgedAnswer(answer, known, scene not in failed))
        return found


@dataclass(frozen=True)
class Round:
    """The observations of all scenes that are not cleared yet.

    Attributes:
        path: folder of the round; that of the benchmark for the first.
        scenes: names of the scenes.
        cameras: names of the cameras.
    """

    path: Path
    scenes: tuple[str, ...]
    cameras: tuple[str, ...]

    @property
    def cases(self) -> list[tuple[str, str]]:
        """Scene and camera of each observation, in order."""
        return [(scene, camera) for scene in self.scenes for camera in self.cameras]

    @property
    def campaign(self) -> Campaign | None:
        """The run over the scenes; None if no grasp has been judged."""
        folder = self.path / TRIALS_FOLDER
        return load_campaign(folder) if is_campaign(folder) else None

    def run_folder(self, scene: str) -> Path:
        """Folder of a scene's run."""
        return self.path / TRIALS_FOLDER / SCENES_FOLDER / scene

    def stored_grasps(self) -> StoredGrasps:
        """Grasps of all answers of the round."""
        found = [StoredAnswer.load(self.path, *case).grasps for case in self.cases]
        content = content_hash(
            [
                [one.id.tolist(), one.columns[INSTANCE_COLUMN].tolist()]
                + [one.columns[n].tolist() for n in (TRIAL_FRICTION_COLUMN,) if n in one.columns]
                for one in found
            ]
        )
        return StoredGrasps(self.path, self.cameras, content, sum(map(len, found)))


def round_folder(folder: Path, number: int) -> Path:
    """Folder of a round, numbered from 1, in the folder of a benchmark."""
    return folder if number == 1 else folder / ROUNDS_FOLDER / f"{number:02d}"


def scene_path(folder: Path, scene: str) -> Path:
    """File of a scene in the folder of a later round."""
    return folder / SCENES_FOLDER / f"{scene}.yaml"


def _scene_verdicts(campaign: Campaign | None, scene: str) -> Mapping[str, Verdict]:
    """Verdicts of a scene's grasps by id; empty if the scene could not be judged."""
    if campaign is None or scene not in campaign.states:
        return {}
    return campaign.run(scene).verdicts if campaign.states[scene].state == "done" else {}


def save_result(path: Path, document: BenchmarkDocument, suite: SuiteDocument) -> BenchmarkResult:
    """Writes benchmark.yaml and suite.yaml."""
    header = "Record of a burg-drake benchmark; written by the program."
    if not (path / SUITE_FILE).exists():
        save_document(suite, path / SUITE_FILE, "The suite of the benchmark in this folder.")
    save_document(document, path / BENCHMARK_FILE, header)
    return BenchmarkResult(path, document, suite)


def load_result(folder: str | Path) -> BenchmarkResult:
    """Loads a benchmark, complete or not.

    Raises:
        UnknownNameError: the folder holds no benchmark.
        DocumentError: a file of it is damaged.
        InvalidInputError: its suite is not the one that the benchmark was run on.
    """
    path = Path(folder)
    if not (path / BENCHMARK_FILE).is_file():
        raise UnknownNameError(
            f"{path} is not the result of a benchmark ({BENCHMARK_FILE} is missing); give a folder"
            " that `benchmark run` wrote"
        )
    document = load_document(path / BENCHMARK_FILE, BenchmarkDocument)
    suite = load_document(path / SUITE_FILE, SuiteDocument)
    if suite.hash != document.suite_hash:
        raise InvalidInputError(
            f"{path / SUITE_FILE} has been changed since the benchmark was run (its hash is"
            f" {suite.hash}, that of the benchmark {document.suite_hash}); restore it, or run the"
            " benchmark again into another folder"
        )
    return BenchmarkResult(path, document, suite)
