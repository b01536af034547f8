"""Unites runs of the same: shards, or copies that were interrupted.

What comes of it has the rows of a run that nobody divided, to the bit. Its journals are written
beside the place where it is to be, and get there when they are whole; what is made from them
follows, and if that is killed, the same call finishes it.
"""

from __future__ import annotations

import os
import re
import secrets
import shutil
from collections.abc import Sequence
from contextlib import ExitStack, suppress
from dataclasses import dataclass, replace
from pathlib import Path

from burg_drake.core import BurgError, InvalidInputError, listing
from burg_drake.core.documents import load_document, save_document
from burg_drake.core.files import writable_folder
from burg_drake.core.paths import PACKAGE_URI, portable_reference, resolve
from burg_drake.evaluation.merge.finishing import (
    MissingFromMerge,
    finish,
    lock_file,
    note_unfinished,
    unfinished,
)
from burg_drake.evaluation.merge.journals import JournalChoice, choose, chosen_lines
from burg_drake.evaluation.records import (
    JOURNAL_FILE,
    Shard,
    WorkSession,
    differences,
    identity,
    share,
    unchanged,
)
from burg_drake.evaluation.store import (
    GRASPS_FILE,
    SCENE_FILE,
    STATION_FILE,
    Campaign,
    Run,
    is_campaign,
    open_results,
    portable_station,
    save_run,
)
from burg_drake.scene.document import SceneDocument, save_scene
from burg_drake.station.document import StationDocument


@dataclass(frozen=True, eq=False)
class Merged:
    """What came of it.

    Attributes:
        result: the run.
        missing: grasps that are not judged.
        scenes: that have not been begun.
        shards: that were not among the runs.
    """

    result: Run | Campaign
    missing: int = 0
    scenes: tuple[str, ...] = ()
    shards: tuple[str, ...] = ()

    @property
    def notes(self) -> tuple[str, ...]:
        """What is missing, and how to judge it, one sentence each."""
        notes = []
        shard = self.result.document.shard
        if shard:
            notes.append(f"all that was given is shard {shard}, and so is the united run")
        if not (self.missing or self.scenes):
            return tuple(notes)
        if self.missing:
            notes.append(f"{self.missing:,} grasps are not judged")
        if self.scenes:
            notes.append(f"{len(self.scenes):,} scenes have not been begun: {listing(self.scenes)}")
        if self.shards and not shard:
            notes.append(f"shards that were not given: {listing(self.shards)}")
        how = f"--shard {shard}" if shard else "no --shard"
        notes.append(
            f"to judge the rest: the command of the runs with {how} and -o {self.result.path}"
        )
        return tuple(notes)


def merge_runs(paths: Sequence[str | Path], out: str | Path) -> Run | Campaign:
    """Unites runs of the same scenes and grasps; see `unite`."""
    return unite(paths, out).result


def unite(paths: Sequence[str | Path], out: str | Path) -> Merged:
    """Unites runs of the same scenes and grasps: shards, or copies that were interrupted.

    Of each grasp the verdict is taken that some run has; one of a trial goes before
    `simulation_failed`. The runs stay as they are.

    Args:
        paths: folders of runs, all of one scene or all of many.
        out: folder for the united run; it does not exist, or is empty, or the same call was killed
            when it had put the run there.

    Raises:
        InvalidInputError: a folder holds no run or is being written, the runs are not of the same,
            two disagree about a grasp, or `out` cannot be written.
        MissingDependencyError: runs over many scenes without pyarrow.
    """
    folders, folder = _distinct(paths), Path(out)
    left = unfinished(folder, folders)
    if left is None:
        with ExitStack() as stack:
            for path in folders:
                stack.enter_context(unchanged(lock_file(path), make=is_campaign(path)))
            left = _unite(folders, folder)
    return Merged(finish(folder, folders), left.missing, left.scenes, left.shards)


def _unite(folders: Sequence[Path], folder: Path) -> MissingFromMerge:
    """Puts a united run where it is to be, but for what is made from its journals."""
    results = [open_results(path) for path in folders]
    kinds = {type(result) for result in results}
    if len(kinds) > 1:
        one = next(r.path for r in results if isinstance(r, Run))
        many = next(r.path for r in results if isinstance(r, Campaign))
        raise InvalidInputError(
            f"{one} is a run of one scene, {many} one of many; only runs of the same can be united"
        )
    beside = _place_beside(folder)
    try:
        campaigns = [result for result in results if isinstance(result, Campaign)]
        if campaigns:
            from burg_drake.evaluation.merge.campaigns import merge_campaigns

            left = merge_campaigns(campaigns, beside, folder)
        else:
            runs = [result for result in results if isinstance(result, Run)]
            choice = write_united(runs, beside, folder)
            left = MissingFromMerge(choice.missing, (), missing_shards(runs))
        note_unfinished(beside, folders, left)
        move(beside, folder)
        return left
    finally:
        shutil.rmtree(beside, ignore_errors=True)


def write_united(
    runs: Sequence[Run], beside: Path, folder: Path, shard: str | None = None
) -> JournalChoice:
    """Writes a united run, but for what is made from its journal.

    Args:
        runs: of one scene.
        beside: an empty folder to write it to.
        folder: where it is to be, which references have to fit.
        shard: that the united run is; what all of them are if None.

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
    shutil.copyfile(first.path / GRASPS_FILE, beside / GRASPS_FILE)
    with (beside / JOURNAL_FILE).open("wb") as stream:
        stream.writelines(chosen_lines(journals, choice))
        stream.flush()
        os.fsync(stream.fileno())
    document = replace(
        first.document,
        shard=shard,
        stretches=all_sessions([run.document.stretches for run in runs]),
    )
    save_run(Run(beside, document))
    copy_documents(first, beside, folder)
    return choice


def require_mergeable(first: Run, other: Run) -> None:
    """Refuses to unite runs that are not of the same.

    Raises:
        InvalidInputError: names every difference.
    """
    a, b = first.document, other.document
    if a.hash == b.hash:
        return
    found = differences(identity(a), identity(b))
    if not found:
        found = [f"grasps are {a.grasps.content[:12]} there, {b.grasps.content[:12]} here"]
    raise InvalidInputError(
        f"{first.path} and {other.path} are not the same run ({'; '.join(found)}); only shards and"
        " copies of one run can be united"
    )


def copy_documents(run: Run, beside: Path, folder: Path) -> None:
    """Copies scene and station of a run, with references that hold in another folder."""
    for name in (SCENE_FILE, STATION_FILE):
        shutil.copyfile(run.path / name, beside / name)
    scene = load_document(run.path / SCENE_FILE, SceneDocument)
    if not scene.library.startswith(PACKAGE_URI):
        with suppress(BurgError):  # it is gone: the run's document knows where it was
            root = resolve(scene.library, "models", run.path)
            library = portable_reference(root, folder)
            save_scene(replace(scene, library=library), beside / SCENE_FILE)
    station = load_document(run.path / STATION_FILE, StationDocument)
    told = [station.hand, *([station.arm.model] if station.arm else []), *station.packages.values()]
    if not all(reference.startswith(PACKAGE_URI) for reference in told):
        with suppress(BurgError):
            save_document(portable_station(run.station(), folder), beside / STATION_FILE)


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


def all_sessions(stretches: Sequence[Sequence[WorkSession]]) -> tuple[WorkSession, ...]:
    """All stretches of work, by their beginning."""
    found = dict.fromkeys(stretch for some in stretches for stretch in some)
    return tuple(sorted(found, key=lambda stretch: stretch.started))


def move(beside: Path, folder: Path) -> None:
    """Puts a folder where it is to be.

    Raises:
        InvalidInputError: it cannot be.
    """
    try:
        os.rename(beside, folder)  # also in the place of an empty one
    except OSError as error:
        raise InvalidInputError(f"cannot write {folder}: {error.strerror}") from error


def _distinct(paths: Sequence[str | Path]) -> list[Path]:
    """The folders, each once, however it is written."""
    found = {Path(path).resolve(): Path(path) for path in paths}
    if not found:
        raise InvalidInputError("no runs are given; give the folders of one or more")
    return list(found.values())


def _place_beside(folder: Path) -> Path:
    """An empty folder beside another; those of merges that were killed go."""
    if folder.is_file() or (folder.is_dir() and any(folder.iterdir())):
        raise InvalidInputError(f"{folder} is there already; choose another -o")
    parent = writable_folder(folder.absolute().parent)
    left = re.compile(rf"\.{re.escape(folder.name)}\.[0-9a-f]{{16}}")
    for path in parent.iterdir():
        if left.fullmatch(path.name) and path.is_dir():
            shutil.rmtree(path, ignore_errors=True)
    beside = parent / f".{folder.name}.{secrets.token_hex(8)}"
    beside.mkdir()
    return beside
