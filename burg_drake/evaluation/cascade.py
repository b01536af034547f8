"""The main job: judges grasps of a scene on a station, stage by stage, and records it all.

Every grasp goes candidate → clear → reachable → planned → executed, as far as the run's mode asks,
and ends with exactly one outcome. What is judged is on disk at once; the same call on the same
folder goes on where an earlier one stopped.
"""

from __future__ import annotations

import shlex
import sys
import time
from collections import Counter
from collections.abc import Iterable, Mapping
from contextlib import closing
from dataclasses import asdict, replace
from datetime import UTC, datetime
from pathlib import Path

from burg_drake.core.errors import InvalidInputError
from burg_drake.core.files import remove_unfinished, writable_folder
from burg_drake.core.grasps import GraspSet
from burg_drake.core.processes import default_workers
from burg_drake.core.progress import STARTING, Listener, Pace, Progress, Reporter
from burg_drake.core.references import portable_reference
from burg_drake.core.resources import PACKAGE_URI
from burg_drake.evaluation.candidate_files import by_names
from burg_drake.evaluation.candidate_sampling import sample_candidates
from burg_drake.evaluation.candidates import Candidate, Candidates, given_candidates
from burg_drake.evaluation.executor import Executor, Job, LocalExecutor
from burg_drake.evaluation.instance_names import chosen_instances, on_chosen
from burg_drake.evaluation.journal import Journal
from burg_drake.evaluation.mode import Mode, mode_for
from burg_drake.evaluation.report import write_report
from burg_drake.evaluation.run_document import (
    Grasps,
    Library,
    RunDocument,
    Stretch,
    TableFormat,
    input_of,
    numbers,
    require_same_run,
    run_hash,
    software_versions,
)
from burg_drake.evaluation.run_store import (
    JOURNAL_FILE,
    RUN_FILE,
    Run,
    create_run,
    load_run,
    require_run_folder,
    save_run,
    write_copies,
)
from burg_drake.evaluation.sampling_settings import DEFAULT_APPROACH_ANGLE_DEG, SamplingSettings
from burg_drake.evaluation.screens import arm_settings
from burg_drake.evaluation.station_judge import StationJudgeFactory
from burg_drake.evaluation.table_file import require_writer, write_table
from burg_drake.scene.scene import Scene, load_scene
from burg_drake.station.engine import ENGINES, Engine, engine_preset
from burg_drake.station.grasp_motion import GraspMotion
from burg_drake.station.station import Station, load_station


def evaluate(
    scene: Scene | str | Path,
    station: Station | str | Path,
    out: str | Path,
    *,
    grasps_per_object: int = 100,
    approach_angle_deg: float = DEFAULT_APPROACH_ANGLE_DEG,
    blind: bool = False,
    only: Iterable[str] | None = None,
    grasps: GraspSet | Mapping[str, GraspSet] | None = None,
    engine: Engine | str = ENGINES["standard"],
    seed: int = 0,
    workers: int | None = None,
    executor: Executor | None = None,
    table: TableFormat = "csv",
    mode: Mode | None = None,
    motion: GraspMotion | None = None,
    retry_failed: bool = False,
    progress: bool | Listener = True,
) -> Run:
    """Judges grasps and writes a run.

    Results do not depend on the number of workers or on the order in which they finish. A grasp
    that Drake cannot simulate ends as `simulation_failed`, and the others go on. An interrupted
    call loses nothing that was judged; the same call goes on from there, and returns at once when
    nothing is left to do. It tries those grasps again whose worker process was ended from outside,
    for example because the memory ran out.

    Args:
        scene, station: as loaded, or references for `load_scene` and `load_station`.
        out: folder of the run; made if need be.
        grasps_per_object: antipodal grasps to sample for each free instance; the same ones as
            those of `sample_grasps` with these settings. Of an object that has fewer,
            `Summary.notes` says why.
        approach_angle_deg: largest angle between the approach of sampled grasps and straight down,
            above 0; 90 is as far as from the side, 180 from anywhere.
        blind: sample without regard to the hand; otherwise it is clear of the scene at all grasps,
            see `SamplingSettings`.
        only: names of free instances, or of objects for all their instances, to judge grasps of;
            all if None.
        grasps: the user's own grasps in the object frame; nothing is sampled then. A set goes to
            the instances that its column `instance` names, or else to all instances of its objects;
            a mapping has sets by instance, such as those of `read_grasps`.
        engine: how trials are stepped; an engine or the name of a preset.
        seed: of the sampling.
        workers: number of processes; as many as there are processors if None.
        executor: judges in place of processes of this machine, such as those of a cluster;
            `workers` is not given then.
        table: format of the results file.
        mode: `hand`: the hand alone executes grasps that are clear. `reach`: those that the arm can
            execute, too, with a path, a straight approach and a straight lift. `arm`: those, and
            the whole arm executes them. None is `reach` if the station has an arm, else `hand`.
        motion: how the hand goes to a grasp and away from it; as the station says if None.
        retry_failed: try all grasps again that an earlier call could not simulate.
        progress: True shows a bar on standard error, False nothing; a function gets the events.

    Returns:
        The complete run. Its `failures` lists grasps that could not be simulated.

    Raises:
        InvalidInputError: bad argument, unsound scene, a mode that needs an arm where there is
            none, or one that stands in something, collides in its home posture or does not reach
            the board, unwritable folder, or a folder that holds another run or is being written.
        UnknownNameError: a reference to something that does not exist.
        MissingDependencyError: Parquet without pyarrow.
        SimulationError: the simulation of the scene cannot be built.
    """
    if grasps is None and grasps_per_object < 1:
        raise InvalidInputError(f"grasps_per_object is {grasps_per_object}; give 1 or more")
    scene = scene if isinstance(scene, Scene) else load_scene(scene)
    station = station if isinstance(station, Station) else load_station(station)
    mode = mode_for(station, mode)
    motion = motion or station.document.motion
    engine = engine if isinstance(engine, Engine) else engine_preset(engine)
    chosen = chosen_instances(scene, only)
    if grasps is not None:
        grasps = by_names(scene, grasps) if isinstance(grasps, GraspSet) else grasps
        grasps = on_chosen(scene, grasps, only)
    if executor is None:
        executor = LocalExecutor(default_workers() if workers is None else workers)
    elif workers is not None:
        raise InvalidInputError("give workers or an executor, not both")
    require_writer(table)
    folder = Path(out)
    require_run_folder(folder)
    if not (folder / RUN_FILE).exists():
        _require_sound(scene, station, mode)
    given = None if grasps is None else given_candidates(scene, grasps)
    writable_folder(folder)
    asked = Grasps(origin="given", count=0, objects={}, content="")
    if grasps is None:
        angle = float(approach_angle_deg)
        asked = replace(
            asked,
            origin="sampled",
            per_object=grasps_per_object,
            approach_angle_deg=angle,
            blind=blind,
            only=() if chosen == tuple(scene.instances) else chosen,
        )
    with Reporter(progress) as reporter, Journal(folder / JOURNAL_FILE) as journal:
        run = _open(
            folder,
            scene,
            station,
            given,
            _document(
                folder,
                scene,
                station,
                asked,
                engine,
                seed=seed,
                mode=mode,
                motion=motion,
                table=table,
            ),
            reporter,
        )
        make_judge = StationJudgeFactory(scene, station, engine, mode, motion)
        remove_unfinished(folder)
        left = _open_grasps(run, retry_failed)
        run = _judge(run, left, make_judge, journal, executor, reporter)
        return _finish(run, table)


def _document(
    folder: Path,
    scene: Scene,
    station: Station,
    grasps: Grasps,
    engine: Engine,
    *,
    seed: int,
    mode: Mode,
    motion: GraspMotion,
    table: TableFormat,
) -> RunDocument:
    """What this call asks for; what comes of the grasps is filled in later."""
    from burg_drake.simulation.trial_settings import TrialSettings

    instances = [*scene.instances.values(), *scene.background.values()]
    library = portable_reference(scene.library.root, folder)
    return RunDocument(
        command=_command(),
        scene=input_of(scene, "scenes"),
        station=input_of(station, "stations"),
        library=Library(
            name=scene.library.name,
            path=library if library.startswith(PACKAGE_URI) else str(scene.library.root.resolve()),
            objects={i.object: scene.library.entry(i.object).build for i in instances},
        ),
        grasps=grasps,
        engine=engine,
        trial=numbers(TrialSettings(motion=motion)),
        mode=mode,
        arm={} if mode == "hand" else numbers(arm_settings(motion)),
        seed=seed,
        table=table,
        versions=software_versions(),
    )


def _open(
    folder: Path,
    scene: Scene,
    station: Station,
    candidates: Candidates | None,
    document: RunDocument,
    reporter: Reporter,
) -> Run:
    """Goes on with the run in the folder, or begins a new one there; samples if no candidates are
    given."""
    if candidates is not None:
        document = _with_grasps(document, scene, candidates, 0.0)
    if (folder / RUN_FILE).exists():
        run = load_run(folder)
        require_same_run(folder, run.document, document)
        write_copies(folder, scene, station)
        return run
    if candidates is None:
        reporter.show(Progress("sampling"))
        start = time.process_time()
        asked = document.grasps
        assert asked.per_object is not None
        settings = SamplingSettings(approach_angle_deg=asked.approach_angle_deg, blind=asked.blind)
        candidates = sample_candidates(
            scene, station, asked.per_object, document.seed, settings, asked.only or None
        )
        cpu = time.process_time() - start
        document = _with_grasps(document, scene, candidates, cpu)
    document = replace(document, hash=run_hash(document))
    return create_run(folder, document, scene, station, candidates)


def _with_grasps(
    document: RunDocument, scene: Scene, candidates: Candidates, cpu: float
) -> RunDocument:
    names = document.grasps.only or scene.instances
    counts = Counter({scene.instance(name).object: 0 for name in names})
    counts.update(scene.instance(name).object for name in candidates.instance.tolist())
    return replace(
        document,
        grasps=replace(
            document.grasps,
            count=len(candidates),
            objects=dict(counts),
            content=candidates.content,
            cpu=cpu,
        ),
    )


def _require_sound(scene: Scene, station: Station, mode: Mode) -> None:
    from burg_drake.motion.usable_arm import require_usable_arm
    from burg_drake.station.check import require_sound_scene

    require_sound_scene(scene, station)
    if mode != "hand":
        require_usable_arm(scene, station)


def _open_grasps(run: Run, retry_failed: bool) -> list[Candidate]:
    """Grasps without a verdict, and those that are to be tried again."""
    verdicts = run.verdicts
    known = {id for id, v in verdicts.items() if not v.is_open(retry_failed=retry_failed)}
    return [candidate for candidate in run.candidates if candidate.id not in known]


def _judge(
    run: Run,
    open_grasps: list[Candidate],
    make_judge: StationJudgeFactory,
    journal: Journal,
    executor: Executor,
    reporter: Reporter,
) -> Run:
    """Judges what is left and keeps each verdict at once; returns the run as it is then."""
    if not open_grasps:
        return run
    done, total = len(run.candidates) - len(open_grasps), len(run.candidates)
    again = {grasp.id for grasp in open_grasps}
    outcomes = Counter(v.outcome for id, v in run.verdicts.items() if id not in again)
    pace = Pace(reporter.show, Progress(STARTING, done, total, outcomes=outcomes), "judging")
    stretches = run.document.stretches
    stretch = Stretch(
        started=datetime.now(UTC).isoformat(timespec="seconds"), workers=executor.workers
    )
    save_run(replace(run, document=replace(run.document, stretches=(*stretches, stretch))))
    begun = time.monotonic()
    try:
        job = Job(run.document.hash, make_judge, open_grasps)
        with closing(executor.judge([job])) as judged:
            for _, candidate, verdict in judged:
                journal.append(candidate.id, verdict)
                done += 1
                pace.step(outcome=verdict.outcome)
    finally:
        seconds = round(time.monotonic() - begun, 3)
        stretch = replace(stretch, judged=done - total + len(open_grasps), seconds=seconds)
        document = replace(run.document, stretches=(*stretches, stretch))
        run = save_run(Run(run.path, document))
    return run


def _finish(run: Run, table: TableFormat) -> Run:
    """Writes table and report, unless they are there already."""
    if run.document.table != table:
        run = save_run(Run(run.path, replace(run.document, table=table)))
    journal = run.path / JOURNAL_FILE
    for path, write in ((run.table_path, _write_table), (run.report_path, write_report)):
        if not path.exists() or path.stat().st_mtime_ns < journal.stat().st_mtime_ns:
            write(run)
    return run


def _write_table(run: Run) -> None:
    write_table(run.table_path, run.results, asdict(run.document))


def _command() -> str:
    """The command that is running, as one can type it again."""
    program = Path(sys.argv[0]).name if sys.argv and sys.argv[0] else "python"
    return shlex.join([program, *sys.argv[1:]])
