"""The parts that a merged run is put together of: its documents and its journal."""

from __future__ import annotations

import os
import shutil
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import replace
from pathlib import Path

from burg_drake.core import BurgError, InvalidInputError
from burg_drake.core.documents import load_document, save_document
from burg_drake.core.paths import PACKAGE_URI, portable_reference, resolve
from burg_drake.evaluation.merge.journals import JournalChoice, choose, chosen_lines
from burg_drake.evaluation.records import (
    JOURNAL_FILE,
    Shard,
    WorkSession,
    grasp_differences,
    run_differences,
    share,
)
from burg_drake.evaluation.store import (
    GRASPS_FILE,
    SCENE_FILE,
    STATION_FILE,
    Campaign,
    Run,
    portable_station,
    save_run,
)
from burg_drake.scene.document import SceneDocument, save_scene
from burg_drake.station.document import StationDocument


def write_merged(
    runs: Sequence[Run], staging: Path, folder: Path, shard: str | None = None
) -> JournalChoice:
    """Writes a merged run, but for what is made from its journal.

    Args:
        runs: of one scene.
        staging: an empty folder to write it to.
        folder: where it is to be, which references have to fit.
        shard: that the merged run is; what all of them are if None.

    Returns:
        Which verdicts were taken.

    Raises:
        InvalidInputError: the runs are not of the same, or disagree.
    """
    first = runs[0]
    for run in runs[1:]:
        require_mergeable(first, run)
    shard = common_shard(runs) if shard is None else shard
    ids = share(first.candidates.id, shard)
    journals = [run.path / JOURNAL_FILE for run in runs]
    choice = choose(journals, ids)
    shutil.copyfile(first.path / GRASPS_FILE, staging / GRASPS_FILE)
    with (staging / JOURNAL_FILE).open("wb") as stream:
        stream.writelines(chosen_lines(journals, choice))
        stream.flush()
        os.fsync(stream.fileno())
    document = replace(
        first.document,
        shard=shard,
        stretches=all_sessions([run.document.stretches for run in runs]),
        hints=next((run.document.hints for run in runs if run.document.hints), ()),
    )
    save_run(Run(staging, document))
    copy_documents(first, staging, folder)
    return choice


def require_mergeable(first: Run, other: Run) -> None:
    """Refuses to merge runs that are not of the same.

    Raises:
        InvalidInputError: names every difference.
    """
    a, b = first.document, other.document
    if a.hash == b.hash:
        return
    found = run_differences(a, b) or grasp_differences(a.grasps, b.grasps)
    raise InvalidInputError(
        f"{first.path} and {other.path} are different runs ({'; '.join(found)}); only"
        " shards or copies of the same run can be merged"
    )


def copy_documents(run: Run, staging: Path, folder: Path) -> None:
    """Copies scene and station of a run, with references that hold in another folder."""
    for name in (SCENE_FILE, STATION_FILE):
        shutil.copyfile(run.path / name, staging / name)
    scene = load_document(run.path / SCENE_FILE, SceneDocument)
    if not scene.library.startswith(PACKAGE_URI):
        with suppress(BurgError):  # it is gone: the run's document knows where it was
            root = resolve(scene.library, "models", run.path)
            library = portable_reference(root, folder)
            save_scene(replace(scene, library=library), staging / SCENE_FILE)
    station = load_document(run.path / STATION_FILE, StationDocument)
    references = [
        station.hand,
        *([station.arm.model] if station.arm else []),
        *station.packages.values(),
    ]
    if not all(reference.startswith(PACKAGE_URI) for reference in references):
        with suppress(BurgError):
            save_document(portable_station(run.station(), folder), staging / STATION_FILE)


def common_shard(runs: Sequence[Run | Campaign]) -> str:
    """The shard that all of them are; empty if they are several, or none."""
    shards = {run.document.shard for run in runs}
    return shards.pop() if len(shards) == 1 else ""


def missing_shards(runs: Sequence[Run | Campaign]) -> tuple[str, ...]:
    """Shards of the same number that are not among runs; none if one of them is of everything."""
    shards = [run.document.shard for run in runs]
    if not all(shards):
        return ()
    counts = {Shard.parse(shard).count for shard in shards}
    return tuple(
        f"{k}/{count}"
        for count in (counts if len(counts) == 1 else ())
        for k in range(1, count + 1)
        if f"{k}/{count}" not in shards
    )


def all_sessions(sessions: Sequence[Sequence[WorkSession]]) -> tuple[WorkSession, ...]:
    """All sessions, by their beginning."""
    found = dict.fromkeys(session for some in sessions for session in some)
    return tuple(sorted(found, key=lambda session: session.started))
