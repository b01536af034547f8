"""Merges runs of the same scenes and grasps: shards, or copies that were interrupted."""

from __future__ import annotations

import json
import os
import re
import secrets
import shutil
from collections.abc import Sequence
from contextlib import ExitStack
from dataclasses import asdict, dataclass
from pathlib import Path

from burg_drake.core import (
    InvalidInputError,
    atomic_write,
    content_hash,
    ensure_writable_folder,
    list_names,
)
from burg_drake.evaluation.campaign_folder import (
    CAMPAIGN_LOCK_FILE,
    SCENE_STATES_FILE,
    SCENES_FOLDER,
    Campaign,
    SceneState,
    is_campaign,
    open_results,
    save_campaign,
    scene_states_text,
)
from burg_drake.evaluation.candidates import share_rows
from burg_drake.evaluation.journal import JOURNAL_FILE, WriterLock, hold_unchanged
from burg_drake.evaluation.merged_run import (
    JournalChoice,
    choose_verdicts,
    common_shard,
    copy_documents,
    merge_documents,
    missing_shards,
    require_mergeable,
    write_merged,
)
from burg_drake.evaluation.part_store import PARTS_FOLDER, PartIndex, update_parts
from burg_drake.evaluation.report.pages import write_campaign_report
from burg_drake.evaluation.run_folder import REPORT_FILE, RUN_FILE, Run, load_run
from burg_drake.evaluation.run_identity import run_differences
from burg_drake.evaluation.run_preparation import finish_run
from burg_drake.evaluation.run_summary import run_shortfall_notes
from burg_drake.evaluation.scene_tasks import is_finished
from burg_drake.evaluation.table_parts import require_arrow


@dataclass(frozen=True)
class MissingFromMerge:
    """Grasps, scenes and shards that none of the merged runs has.

    Attributes:
        missing: number of grasps without a verdict.
        scenes: scenes that have not been begun.
        shards: shards that are not among the runs.
    """

    missing: int = 0
    scenes: tuple[str, ...] = ()
    shards: tuple[str, ...] = ()


def read_merge_note(folder: Path, sources: Sequence[Path]) -> MissingFromMerge | None:
    """Reads the note of an unfinished merge of the runs `sources`; None if there is none."""
    try:
        stored = json.loads(_merge_note_path(folder, sources).read_text(encoding="utf-8"))
        return MissingFromMerge(stored["missing"], tuple(stored["scenes"]), tuple(stored["shards"]))
    except (OSError, ValueError, KeyError, TypeError):
        return None


def finish_merge(folder: Path, sources: Sequence[Path]) -> Run | Campaign:
    """Writes the missing tables, reports and parts of a merged run.

    Raises:
        InvalidInputError: another process is writing the run, or it cannot be written.
    """
    with WriterLock(lock_file(folder)):
        result = open_results(folder)
        if isinstance(result, Campaign):
            _finish_campaign(result)
        else:
            result = finish_run(result, result.document.table)
        _merge_note_path(folder, sources).unlink(missing_ok=True)
    return result


def lock_file(folder: Path) -> Path:
    """Path of the lock file of a run."""
    return folder / (CAMPAIGN_LOCK_FILE if is_campaign(folder) else JOURNAL_FILE)


def _finish_campaign(campaign: Campaign) -> None:
    document = campaign.document
    reports = document.writes_scene_reports
    for stored in campaign.stored_runs:
        if not (stored.folder / RUN_FILE).exists():
            continue
        size = stored.journal.stat().st_size
        if not is_finished(stored.folder, size, document.table, report=reports):
            finish_run(load_run(stored.folder), document.table, report=reports)
    update_parts(campaign)
    write_campaign_report(campaign)


def _merge_note_path(folder: Path, sources: Sequence[Path]) -> Path:
    """Path of the note of an unfinished merge, named so that `remove_unfinished` finds it."""
    names = sorted(str(path.resolve()) for path in sources)
    return folder / f".merge.{content_hash(names)[:16]}"


def merge_campaigns(campaigns: Sequence[Campaign], staging: Path, folder: Path) -> MissingFromMerge:
    """Writes journals and documents of a merged run over many scenes, but no tables and reports.

    Args:
        campaigns: the runs.
        staging: empty folder to write it to.
        folder: final folder, for which references are made.

    Returns:
        Grasps, scenes and shards that no run has.

    Raises:
        InvalidInputError: the runs have different inputs or settings, or disagree about a grasp.
        MissingDependencyError: pyarrow is not installed.
    """
    require_arrow("a run over many scenes")
    first = campaigns[0]
    documents = [campaign.document for campaign in campaigns]
    for other in campaigns[1:]:
        require_mergeable(first, other, run_differences(first.document, other.document))
    merged = Campaign(staging, merge_documents(documents, common_shard(campaigns)))
    (staging / SCENES_FOLDER).mkdir()
    merge = _Merge(campaigns, merged, folder)
    for name in merged.names:
        merge.add_scene(name)
    merge.copy_parts()
    atomic_write(staging / SCENE_STATES_FILE, scene_states_text(merge.states))
    save_campaign(merged)
    return MissingFromMerge(merge.missing, tuple(merge.not_begun), missing_shards(campaigns))


class _Merge:
    """Merges the scenes of runs one by one.

    Attributes:
        states: progress of the merged scenes.
        copied: scenes that were copied unchanged from each run, by the number of the run.
        missing: number of grasps without a verdict.
        not_begun: scenes that no run has begun.
    """

    def __init__(self, campaigns: Sequence[Campaign], merged: Campaign, folder: Path) -> None:
        self._campaigns, self._merged, self._folder = campaigns, merged, folder
        shard = merged.document.shard_of_grasps
        self._shard = "" if shard is None else str(shard)
        self.states: list[SceneState] = []
        self.copied: dict[int, set[str]] = {k: set() for k in range(len(campaigns))}
        self.missing = 0
        self.not_begun: list[str] = []

    def add_scene(self, name: str) -> None:
        """Copies or merges a scene."""
        begun = [k for k, c in enumerate(self._campaigns) if (c.folder(name) / RUN_FILE).exists()]
        known = [s for c in self._campaigns if (s := c.states.get(name)) is not None]
        if not begun:
            if known:
                self.states.append(known[0])
            else:
                self.not_begun.append(name)
            return
        with ExitStack() as stack:
            for k in begun:
                stack.enter_context(hold_unchanged(self._campaigns[k].folder(name) / JOURNAL_FILE))
            self._merge_scene(name, begun)

    def _merge_scene(self, name: str, begun: Sequence[int]) -> None:
        target = self._merged.folder(name)
        final = self._folder / SCENES_FOLDER / name
        runs = [load_run(self._campaigns[k].folder(name)) for k in begun]
        if len(runs) == 1 and runs[0].document.shard == self._shard:
            self._copy_scene(begun[0], name, runs[0], target, final)
            return
        target.mkdir()
        choice = write_merged(runs, target, final, self._shard)
        self._note_state(name, runs[0], choice)

    def copy_parts(self) -> None:
        """Copies parts whose scenes were all copied; the journals have the rows of other parts."""
        number = 0
        parts = self._merged.path / PARTS_FOLDER
        parts.mkdir()
        for k, campaign in enumerate(self._campaigns):
            for part in PartIndex.of(campaign.path).parts:
                if all(segment.scene in self.copied[k] for segment in part.segments):
                    number += 1
                    digest = part.path.stem.rpartition("-")[2]
                    shutil.copy2(part.path, parts / f"part-{number:06d}-{digest}.parquet")

    def _copy_scene(self, k: int, name: str, run: Run, target: Path, final: Path) -> None:
        # the report has commands with the old path of the run
        shutil.copytree(run.path, target, ignore=shutil.ignore_patterns(".*", REPORT_FILE))
        copy_documents(run, target, final)
        self.copied[k].add(name)
        state = self._campaigns[k].states.get(name)
        size = (target / JOURNAL_FILE).stat().st_size
        if state is not None and state.state == "done" and state.size == size:
            self.states.append(state)
            return
        assigned = share_rows(len(run.candidates), run.document.shard)
        choice = choose_verdicts([target / JOURNAL_FILE], run.candidates, assigned)
        self._note_state(name, run, choice)

    def _note_state(self, name: str, run: Run, choice: JournalChoice) -> None:
        index = choice.index
        missing = int((~index.judged).sum())
        self.missing += missing
        count = len(run.candidates)
        size = (self._merged.folder(name) / JOURNAL_FILE).stat().st_size
        state = SceneState(
            scene=name,
            state="open" if missing else "done",
            run=run.document.hash,
            grasps=count,
            mine=len(share_rows(count, self._shard)),
            sampling=run.document.grasps.cpu,
            size=0 if missing else size,
            failed=int(index.failed.sum()),
            interrupted=int((index.failed & index.interrupted).sum()),
            missing="; ".join(run_shortfall_notes(run)),
        )
        self.states.append(state)


@dataclass(frozen=True, eq=False, kw_only=True)
class MergeResult(MissingFromMerge):
    """A merged run, and the grasps, scenes and shards that it lacks.

    Attributes:
        result: the run.
    """

    result: Run | Campaign

    @property
    def notes(self) -> tuple[str, ...]:
        """Notes on missing grasps and how to judge them, one sentence each."""
        notes = []
        shard = self.result.document.shard
        if shard:
            notes.append(f"only shard {shard} was given, so the merged run has that shard alone")
        if not (self.missing or self.scenes):
            return tuple(notes)
        if self.missing:
            notes.append(f"{self.missing:,} grasps are not judged yet")
        if self.scenes:
            notes.append(
                f"{len(self.scenes):,} scenes are not begun yet: {list_names(self.scenes)}"
            )
        if self.shards and not shard:
            notes.append(f"shards that were not given: {list_names(self.shards)}")
        how = f"shard {shard}" if shard else "no shard"
        notes.append(
            f"to judge the rest, run the same evaluation into {self.result.path}, with {how}"
        )
        return tuple(notes)


def merge_runs(paths: Sequence[str | Path], out: str | Path) -> Run | Campaign:
    """Merges runs of the same scenes and grasps; see `merge_folders`."""
    return merge_folders(paths, out).result


def merge_folders(paths: Sequence[str | Path], out: str | Path) -> MergeResult:
    """Merges runs of the same scenes and grasps: shards, or copies that were interrupted.

    If several runs have judged a grasp, a verdict of a trial is preferred to `simulation_failed`.
    The runs are not changed.

    Args:
        paths: folders of runs, all of one scene or all of many.
        out: folder for the merged run; new, empty, or left by the same call if it was killed.

    Raises:
        InvalidInputError: a folder holds no run or is being written, the runs have different inputs
            or settings, two disagree about a grasp, or `out` cannot be written.
        MissingDependencyError: runs over many scenes without pyarrow.
    """
    folders, folder = _distinct_folders(paths), Path(out)
    left = read_merge_note(folder, folders)
    if left is None:
        with ExitStack() as stack:
            for path in folders:
                stack.enter_context(hold_unchanged(lock_file(path), make=is_campaign(path)))
            left = _merge_folders(folders, folder)
    return MergeResult(**vars(left), result=finish_merge(folder, folders))


def _merge_folders(folders: Sequence[Path], folder: Path) -> MissingFromMerge:
    """Writes a merged run to its folder, without tables, reports and parts."""
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
            missing = int((~choice.index.judged).sum())
            left = MissingFromMerge(missing, (), missing_shards(runs))
        note = _merge_note_path(staging, folders)
        note.write_text(json.dumps(asdict(left)), encoding="utf-8")
        move_folder(staging, folder)
        return left
    finally:
        shutil.rmtree(staging, ignore_errors=True)


def move_folder(staging: Path, folder: Path) -> None:
    """Moves a staging folder to its final path.

    Raises:
        InvalidInputError: the final path cannot be written.
    """
    try:
        os.rename(staging, folder)  # also replaces an empty folder
    except OSError as error:
        raise InvalidInputError(f"cannot write {folder}: {error.strerror}") from error


def _distinct_folders(paths: Sequence[str | Path]) -> list[Path]:
    """The folders without duplicates; different paths of one folder count as the same."""
    found = {Path(path).resolve(): Path(path) for path in paths}
    if not found:
        raise InvalidInputError("no runs are given; give the folders of one or more")
    return list(found.values())


def _staging_folder(folder: Path) -> Path:
    """Creates an empty folder beside another, and removes such folders of killed merges."""
    if folder.is_file() or (folder.is_dir() and any(folder.iterdir())):
        raise InvalidInputError(f"{folder} exists already; choose another folder").about("out")
    parent = ensure_writable_folder(folder.absolute().parent)
    staging_name = re.compile(rf"\.{re.escape(folder.name)}\.[0-9a-f]{{16}}")
    for path in parent.iterdir():
        if staging_name.fullmatch(path.name) and path.is_dir():
            shutil.rmtree(path, ignore_errors=True)
    staging = parent / f".{folder.name}.{secrets.token_hex(8)}"
    staging.mkdir()
    return staging
