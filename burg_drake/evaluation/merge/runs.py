"""Merges runs of the same: shards, or copies that were interrupted.

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
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path

from burg_drake.core import InvalidInputError, listing
from burg_drake.core.files import writable_folder
from burg_drake.evaluation.merge.campaigns import merge_campaigns
from burg_drake.evaluation.merge.finishing import (
    MissingFromMerge,
    finish,
    lock_file,
    note_unfinished,
    unfinished,
)
from burg_drake.evaluation.merge.merged_run import missing_shards, write_merged
from burg_drake.evaluation.records import unchanged
from burg_drake.evaluation.store import Campaign, Run, is_campaign, open_results


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
            notes.append(f"only shard {shard} was given, so the merged run has that shard alone")
        if not (self.missing or self.scenes):
            return tuple(notes)
        if self.missing:
            notes.append(f"{self.missing:,} grasps are not judged yet")
        if self.scenes:
            notes.append(f"{len(self.scenes):,} scenes are not begun yet: {listing(self.scenes)}")
        if self.shards and not shard:
            notes.append(f"shards that were not given: {listing(self.shards)}")
        how = f"shard {shard}" if shard else "no shard"
        notes.append(
            f"to judge the rest, run the same evaluation into {self.result.path}, with {how}"
        )
        return tuple(notes)


def merge_runs(paths: Sequence[str | Path], out: str | Path) -> Run | Campaign:
    """Merges runs of the same scenes and grasps; see `merge_folders`."""
    return merge_folders(paths, out).result


def merge_folders(paths: Sequence[str | Path], out: str | Path) -> Merged:
    """Merges runs of the same scenes and grasps: shards, or copies that were interrupted.

    Of each grasp the verdict is taken that some run has; one of a trial goes before
    `simulation_failed`. The runs stay as they are.

    Args:
        paths: folders of runs, all of one scene or all of many.
        out: folder for the merged run; it does not exist, or is empty, or the same call was killed
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
            left = _merge_folders(folders, folder)
    return Merged(finish(folder, folders), left.missing, left.scenes, left.shards)


def _merge_folders(folders: Sequence[Path], folder: Path) -> MissingFromMerge:
    """Puts a merged run where it is to be, but for what is made from its journals."""
    results = [open_results(path) for path in folders]
    kinds = {type(result) for result in results}
    if len(kinds) > 1:
        one = next(r.path for r in results if isinstance(r, Run))
        many = next(r.path for r in results if isinstance(r, Campaign))
        raise InvalidInputError(
            f"{one} is a run of one scene, {many} one of many scenes; merge runs of one kind"
        )
    staging = _staging_folder(folder)
    try:
        campaigns = [result for result in results if isinstance(result, Campaign)]
        if campaigns:
            left = merge_campaigns(campaigns, staging, folder)
        else:
            runs = [result for result in results if isinstance(result, Run)]
            choice = write_merged(runs, staging, folder)
            left = MissingFromMerge(choice.missing, (), missing_shards(runs))
        note_unfinished(staging, folders, left)
        move(staging, folder)
        return left
    finally:
        shutil.rmtree(staging, ignore_errors=True)


def move(staging: Path, folder: Path) -> None:
    """Puts a folder where it is to be.

    Raises:
        InvalidInputError: it cannot be.
    """
    try:
        os.rename(staging, folder)  # also in the place of an empty one
    except OSError as error:
        raise InvalidInputError(f"cannot write {folder}: {error.strerror}") from error


def _distinct(paths: Sequence[str | Path]) -> list[Path]:
    """The folders, each once, however it is written."""
    found = {Path(path).resolve(): Path(path) for path in paths}
    if not found:
        raise InvalidInputError("no runs are given; give the folders of one or more")
    return list(found.values())


def _staging_folder(folder: Path) -> Path:
    """An empty folder beside another; those of merges that were killed go."""
    if folder.is_file() or (folder.is_dir() and any(folder.iterdir())):
        raise InvalidInputError(f"{folder} exists already; choose another folder").about("out")
    parent = writable_folder(folder.absolute().parent)
    left = re.compile(rf"\.{re.escape(folder.name)}\.[0-9a-f]{{16}}")
    for path in parent.iterdir():
        if left.fullmatch(path.name) and path.is_dir():
            shutil.rmtree(path, ignore_errors=True)
    staging = parent / f".{folder.name}.{secrets.token_hex(8)}"
    staging.mkdir()
    return staging
