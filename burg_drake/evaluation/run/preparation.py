"""From a scene to a run that can be judged: its folder, its candidates, and what is left to do."""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Callable
from dataclasses import asdict, replace
from pathlib import Path

from burg_drake.core.grasps import Mode
from burg_drake.evaluation.candidates import (
    Candidate,
    Candidates,
    given_candidates,
)
from burg_drake.evaluation.grasp_sets import correction_of
from burg_drake.evaluation.records import (
    RunDocument,
    TableFormat,
    require_same_run,
    run_hash,
    write_table,
)
from burg_drake.evaluation.report import write_report
from burg_drake.evaluation.run.balancing import sample_requested
from burg_drake.evaluation.run.request import ByInstance, Request
from burg_drake.evaluation.stages import require_scene_for
from burg_drake.evaluation.store import (
    GRASPS_FILE,
    JOURNAL_FILE,
    RUN_FILE,
    Run,
    create_run,
    load_run,
    save_run,
    write_copies,
)
from burg_drake.scene.document import Scene
from burg_drake.station.document import Engine, Station


def require_sound(scene: Scene, station: Station, mode: Mode, engine: Engine) -> None:
    """Refuses a scene that cannot be judged, before any work is spent on it.

    Raises:
        InvalidInputError: unsound scene, an arm that stands in something or does not reach, or
            objects or a hand that the engine cannot have.
    """
    from burg_drake.motion.workspace import require_usable_arm
    from burg_drake.station.checks import require_valid_scene

    require_valid_scene(scene, station)
    if mode != "hand":
        require_usable_arm(scene, station)
    require_scene_for(engine, scene, station)


def open_run(
    folder: Path,
    scene: Scene,
    request: Request,
    given: ByInstance | None,
    sampling: Callable[[], None] = lambda: None,
) -> Run:
    """Goes on with the run in a folder, or begins a new one there.

    Args:
        folder: of the run.
        scene: to judge.
        request: what is asked about it.
        given: the user's grasps by instance; sampled if None.
        sampling: called before grasps are sampled.

    Raises:
        InvalidInputError: the folder holds another run.
    """
    document = request.document(folder, scene)
    candidates = None if given is None else given_candidates(scene, given)
    if candidates is not None:
        document = _with_grasps(document, scene, candidates, 0.0)
    if (folder / RUN_FILE).exists():
        run = load_run(folder)
        require_same_run(folder, run.document, document)
        write_copies(folder, scene, request.station)
        if document.grasps.until_balanced and run.candidates.content != run.document.grasps.content:
            # killed between the two files of a round, of which the grasps are the newer one
            return _resampled(run, run.document, scene, request.station)
        return run
    if candidates is None:
        sampling()
        start = time.process_time()
        candidates = sample_requested(scene, request.station, document)
        document = _with_grasps(document, scene, candidates, time.process_time() - start)
    document = replace(document, hash=run_hash(document))
    return create_run(folder, document, scene, request.station, candidates)


def extend_run(run: Run, document: RunDocument, scene: Scene, station: Station) -> Run:
    """Samples the grasps that a run's new document asks for, those that it has among them, of the
    objects of which it asks for more.

    The candidates come before run.yaml, so that a call that is killed between them is found out by
    their hash: `open_run` then samples those of the document again.
    """
    return _resampled(run, document, scene, station, before=run)


def _resampled(
    run: Run, document: RunDocument, scene: Scene, station: Station, before: Run | None = None
) -> Run:
    """With the grasps of a document; see `sample_requested`."""
    start = time.process_time()
    candidates = sample_requested(scene, station, document, before)
    cpu = document.grasps.cpu + time.process_time() - start
    document = _with_grasps(document, scene, candidates, cpu)
    candidates.save(run.path / GRASPS_FILE)
    return save_run(Run(run.path, replace(document, hash=run_hash(document))))


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
            correction=correction_of(candidates.grasps),
            count=len(candidates),
            objects=dict(counts),
            content=candidates.content,
            cpu=cpu,
        ),
    )


def open_grasps(run: Run, *, retry_failed: bool) -> list[Candidate]:
    """Grasps that this run judges and has no verdict about, and those to be tried again."""
    verdicts = run.verdicts
    mine = set(run.mine)
    known = {id for id, v in verdicts.items() if not v.is_open(retry_failed=retry_failed)}
    return [c for c in run.candidates if c.id in mine and c.id not in known]


def finish_run(run: Run, table: TableFormat, *, report: bool = True) -> Run:
    """Writes table and report, unless they are there already; where no report is wanted, one that
    is out of date is removed."""
    if run.document.table != table:
        run = save_run(Run(run.path, replace(run.document, table=table)))
    journal = run.path / JOURNAL_FILE
    if not _is_new(run.table_path, journal):
        _write_table(run)
    if not _is_new(run.report_path, journal):
        run.report_path.unlink(missing_ok=True)
        if report:
            write_report(run)
    return run


def _is_new(path: Path, journal: Path) -> bool:
    return path.exists() and path.stat().st_mtime_ns >= journal.stat().st_mtime_ns


def _write_table(run: Run) -> None:
    write_table(run.table_path, run.results, asdict(run.document))
