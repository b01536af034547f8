"""The same grasps judged in steps that each add one cause of the gap: the hand alone, with the arm,
by the whole arm, and with objects that are not quite where they should be.

Every step is an ordinary run, or several, in a folder of its own: each can be opened, replayed and
gone on with.

hand/, reach/, arm/    the grasps in this mode
scenes/NNN.yaml        the scene with displaced objects
placed/NNN/            those that succeed in the last mode, in this scene
tried_HASH/NNN/        further ones, of real trials
gap.yaml               what was asked
gap.html, gap.json     what was found
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from burg_drake.core import (
    InvalidInputError,
    content_hash,
    software_versions,
)
from burg_drake.core.documents import load_document, save_document
from burg_drake.core.files import writable_folder
from burg_drake.core.grasps import MODES, GraspSet, Mode
from burg_drake.core.paths import portable_reference
from burg_drake.core.terminal import Listener
from burg_drake.evaluation import evaluate
from burg_drake.evaluation.candidates import Candidates
from burg_drake.evaluation.records import (
    JOURNAL_FILE,
    EvaluationSettings,
    Grasps,
    Journal,
    Lock,
    limit_settings,
    motion_in,
    numbers,
    read_journal,
    require_same_run,
    run_hash,
)
from burg_drake.evaluation.run import GraspsLike
from burg_drake.evaluation.stages import arm_settings, mode_for
from burg_drake.evaluation.store import (
    RUN_FILE,
    Run,
    create_run,
    load_run,
    require_run_folder,
)
from burg_drake.evaluation.workers import Executor, LocalExecutor
from burg_drake.experiment.gap.displacement import commanded_candidates
from burg_drake.experiment.gap.placement_noise import NoisyScene, PlacementNoise, noisy_scene
from burg_drake.experiment.gap.reach_step import reach_verdicts
from burg_drake.experiment.gap.settings import GapSettings
from burg_drake.experiment.gap.steps import GapDocument, GapStep, GapSteps
from burg_drake.scene.document import Scene, SceneLike, as_scene, load_scene, save_scene
from burg_drake.station.document import Station, StationLike, as_station

DOCUMENT_FILE = "gap.yaml"
LOCK_FILE = ".gap.lock"
HEADER = "Where grasps are lost, step by step; written by burg-drake gap."


def measure_gap(
    source: Run | SceneLike,
    out: str | Path,
    *,
    station: StationLike = "panda_tabletop",
    grasps: GraspsLike | None = None,
    evaluation: EvaluationSettings | None = None,
    settings: GapSettings | None = None,
    tried: Sequence[str] = (),
    executor: Executor | None = None,
    progress: bool | Listener = True,
) -> GapSteps:
    """Judges the same grasps step by step; the same call goes on where an earlier one stopped.

    Args:
        source: a run whose grasps are judged, with its scene, station, engine and motion; it is the
            step of its mode itself. Or a scene.
        out: folder; made if need be.
        station: of a scene.
        grasps: for `evaluate`, with a scene; sampled if None.
        evaluation: likewise: engine, motion, and how to sample grasps. The mode is that of a step.
        settings: which steps; all that the station can have, and five displaced scenes, if None.
        tried: ids of grasps of real trials, which are judged in displaced scenes even if they fail
            in the last mode.
        executor: who judges; as many processes as there are processors if None.
        progress: as for `evaluate`.

    Raises:
        InvalidInputError: as `evaluate`; or the folder has other steps, or the run is incomplete.
    """
    run = source if isinstance(source, Run) else None
    if run is not None:
        scene, station = run.scene(), run.station()
        if not run.complete:
            raise InvalidInputError(
                f"{run.path} is not complete; finish it first with the command in its report"
            )
    else:
        assert not isinstance(source, Run)
        scene = as_scene(source)
        station = as_station(station)
    settings = settings or GapSettings()
    noise, samples, last = settings.noise, settings.samples, settings.last
    if last is None:
        last = "hand" if station.document.arm is None else "arm"
    mode_for(station, last)
    executor = LocalExecutor.of_this_machine() if executor is None else executor
    path = Path(out)
    document = _requested(run, scene, station, last, settings)
    _begin(path, document)
    options = {"executor": executor, "progress": progress}
    begin = {"grasps": grasps, "settings": evaluation or EvaluationSettings()}
    steps: list[GapStep] = []
    for mode in MODES[: MODES.index(last) + 1]:
        made = _mode_step(mode, run, steps, scene, station, path, options, begin)
        steps.append(GapStep(mode, (made,)))
    extra: tuple[Run, ...] = ()
    if samples:
        run = steps[-1].runs[0]
        scenes = list(_noisy_scenes(scene, station, noise, samples))
        held = [id for id, v in run.verdicts.items() if v.outcome.held]
        others = sorted({*tried}.intersection(run.candidates.id).difference(held))
        placing = _Placing(run, scene, station, path, [one.scene for one in scenes], options)
        steps.append(GapStep("placed", placing.judge(held, "placed")))
        extra = placing.judge(others, f"tried_{content_hash(others)[:8]}")
        document = replace(
            document,
            redrawn=tuple(one.redrawn for one in scenes),
            kept={f"{k:03d}": one.kept for k, one in enumerate(scenes, 1) if one.kept},
        )
    save_document(document, path / DOCUMENT_FILE, HEADER)  # with what was drawn, too
    return GapSteps(path, document, tuple(steps), extra)


def _requested(
    run: Run | None, scene: Scene, station: Station, last: Mode, settings: GapSettings
) -> GapDocument:
    """What a call asks for, with the versions that are installed."""
    noise = settings.noise
    return GapDocument(
        source="" if run is None else run.document.hash,
        scene=scene.content,
        station=station.content,
        last=last,
        place_mm=1e3 * noise.place,
        turn_deg=float(np.rad2deg(noise.turn)),
        seed=noise.seed,
        samples=settings.samples,
        versions=software_versions(),
    )


def _begin(path: Path, document: GapDocument) -> None:
    """Makes the folder and says first of all what is asked there, which refuses others from then
    on, however this call ends."""
    file = path / DOCUMENT_FILE
    if not file.exists():
        writable_folder(path)
    with Lock(path / LOCK_FILE):
        if file.exists() and any(path.glob(f"*/{JOURNAL_FILE}")):  # else nothing came of it
            _require_same(path, load_document(file, GapDocument), document)
        else:
            save_document(document, file, HEADER)


def _require_same(path: Path, there: GapDocument, document: GapDocument) -> None:
    """Refuses a folder with other steps; more scenes of the same kind are welcome."""
    for name in ("source", "scene", "station", "place_mm", "turn_deg", "seed"):
        old, new = getattr(there, name), getattr(document, name)
        if old != new:
            raise InvalidInputError(
                f"{path} has steps of another measurement ({name} is {_short(old)} there,"
                f" {_short(new)} here); choose another folder, or delete it"
            ).about("out")


def _short(value: object) -> str:
    return f"{value[:12]!r}" if isinstance(value, str) else f"{value:g}"


def _mode_step(
    mode: Mode,
    run: Run | None,
    steps: Sequence[GapStep],
    scene: Scene,
    station: Station,
    path: Path,
    options: dict[str, Any],
    begin: dict[str, Any],
) -> Run:
    if run is not None and run.document.mode == mode:
        return run
    if not steps and run is None:
        return evaluate(scene, station, path / mode, **_in_mode(begin, mode), **options)
    like = run if not steps else steps[0].runs[0]
    assert like is not None
    if mode == "reach":
        _begin_reach(steps[0].runs[0], scene, station, path / mode, options)
    return evaluate(scene, station, path / mode, **_in_mode(_same(like), mode), **options)


def _same(run: Run) -> dict[str, Any]:
    """What makes `evaluate` judge the grasps of a run as it did."""
    settings = EvaluationSettings(
        mode=run.document.mode,
        engine=run.document.engine,
        seed=run.document.seed,
        motion=motion_in(run.document.trial),
        table=run.document.table,
        **limit_settings(run.document.trial),
    )
    return {"grasps": by_instance(run.candidates), "settings": settings}


def _in_mode(asked: dict[str, Any], mode: Mode) -> dict[str, Any]:
    """The same arguments of `evaluate` in another mode; the whole arm approaches anyway."""
    settings = asked["settings"]
    approach = settings.approach and mode != "arm"
    return {**asked, "settings": replace(settings, mode=mode, approach=approach)}


def by_instance(candidates: Candidates) -> dict[str, GraspSet]:
    """The grasps by name of their instance."""
    names = dict.fromkeys(candidates.instance.tolist())
    return {n: candidates.grasps.select(np.flatnonzero(candidates.instance == n)) for n in names}


def _begin_reach(
    hand: Run, scene: Scene, station: Station, folder: Path, options: dict[str, Any]
) -> None:
    """Writes the run of mode `reach` as far as the hand's trials tell, which is all of it."""
    grasps = Grasps(
        origin="given",
        correction=hand.document.grasps.correction,
        count=hand.document.grasps.count,
        objects=hand.document.grasps.objects,
        content=hand.document.grasps.content,
    )
    motion = motion_in(hand.document.trial)
    document = replace(
        hand.document,
        mode="reach",
        grasps=grasps,
        arm=numbers(arm_settings(motion)),
        versions=software_versions(),
        stretches=(),
        hash="",
    )
    require_run_folder(folder)
    writable_folder(folder)
    with Journal(folder / JOURNAL_FILE) as lines:
        if (folder / RUN_FILE).exists():
            require_same_run(folder, load_run(folder).document, document)
        else:
            document = replace(document, hash=run_hash(document))
            create_run(folder, document, scene, station, hand.candidates)
        known = read_journal(folder / JOURNAL_FILE)
        for id, verdict in reach_verdicts(hand, known, **options):
            lines.append(id, verdict)


def _noisy_scenes(
    scene: Scene, station: Station, noise: PlacementNoise, samples: int
) -> Iterator[NoisyScene]:
    from burg_drake.station.checks import SceneCheck

    check = SceneCheck(station, scene.library)
    for number in range(1, samples + 1):
        yield noisy_scene(scene, noise, number, check.issues)


@dataclass(frozen=True, eq=False)
class _Placing:
    """Judges grasps of a run in displaced scenes."""

    run: Run
    scene: Scene
    station: Station
    path: Path
    scenes: Sequence[Scene]
    options: dict[str, Any]

    def judge(self, ids: Sequence[str], folder: str) -> tuple[Run, ...]:
        """A run in each scene; none if there are no grasps."""
        if not ids:
            return ()
        of, chosen = self.run.candidates, set(ids)
        rows = np.flatnonzero([id in chosen for id in of.id])
        candidates = Candidates(of.grasps.select(rows), of.instance[rows])
        return tuple(
            self._judge(candidates, scene, f"{number:03d}", folder)
            for number, scene in enumerate(self.scenes, 1)
        )

    def _judge(self, candidates: Candidates, scene: Scene, number: str, folder: str) -> Run:
        now = _written(scene, self.path / "scenes" / f"{number}.yaml")
        moved = commanded_candidates(self.scene, now, candidates)
        same = _same(self.run) | {"grasps": by_instance(moved)}
        return evaluate(now, self.station, self.path / folder / number, **same, **self.options)


def _written(scene: Scene, path: Path) -> Scene:
    """The scene as a file of its own."""
    path.parent.mkdir(parents=True, exist_ok=True)
    library = portable_reference(scene.library.root, path.parent)
    save_scene(replace(scene.document, library=library), path)
    return load_scene(path)
