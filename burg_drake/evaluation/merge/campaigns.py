"""Merges runs over many scenes: scenes that one of them has are copied, others are merged."""

from __future__ import annotations

import shutil
from collections.abc import Sequence
from contextlib import ExitStack
from dataclasses import replace
from pathlib import Path

from burg_drake.core import InvalidInputError
from burg_drake.core.files import atomic_write
from burg_drake.evaluation.merge.finishing import MissingFromMerge
from burg_drake.evaluation.merge.journals import choose
from burg_drake.evaluation.merge.merged_run import (
    all_sessions,
    common_shard,
    copy_documents,
    missing_shards,
    write_merged,
)
from burg_drake.evaluation.records import (
    JOURNAL_FILE,
    LEDGER_FILE,
    SceneState,
    campaign_differences,
    ledger_text,
    share,
    unchanged,
)
from burg_drake.evaluation.results import shortfalls
from burg_drake.evaluation.store import (
    PARTS_FOLDER,
    REPORT_FILE,
    RUN_FILE,
    SCENES_FOLDER,
    Campaign,
    PartIndex,
    Run,
    load_run,
    require_arrow,
    save_campaign,
)


def merge_campaigns(campaigns: Sequence[Campaign], staging: Path, folder: Path) -> MissingFromMerge:
    """Writes a merged run over many scenes, but for what is made from its journals.

    Args:
        campaigns: the runs.
        staging: an empty folder to write it to.
        folder: where it is to be, which references have to fit.

    Returns:
        What no run has.

    Raises:
        InvalidInputError: the runs are not of the same, or disagree.
        MissingDependencyError: pyarrow is not installed.
    """
    require_arrow("a run over many scenes")
    first = campaigns[0]
    for other in campaigns[1:]:
        if found := campaign_differences(first.document, other.document):
            raise InvalidInputError(
                f"{first.path} and {other.path} are different runs ({'; '.join(found)});"
                " only shards or copies of the same run can be merged"
            )
    document = replace(
        first.document,
        shard=common_shard(campaigns),
        stretches=all_sessions([campaign.document.stretches for campaign in campaigns]),
        hints=next((c.document.hints for c in campaigns if c.document.hints), ()),
    )
    merged = Campaign(staging, document)
    (staging / SCENES_FOLDER).mkdir()
    merge = _Merge(campaigns, merged, folder)
    for name in merged.names:
        merge.take(name)
    merge.copy_parts()
    atomic_write(staging / LEDGER_FILE, ledger_text(merge.states))
    save_campaign(merged)
    return MissingFromMerge(merge.missing, tuple(merge.not_begun), missing_shards(campaigns))


class _Merge:
    """What is known while scenes are taken.

    Attributes:
        states: of the scenes.
        copied: by number of the run: scenes that were copied from it as they are.
        missing: grasps without a verdict.
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

    def take(self, name: str) -> None:
        """Takes a scene."""
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
                stack.enter_context(unchanged(self._campaigns[k].folder(name) / JOURNAL_FILE))
            self._take(name, begun)

    def _take(self, name: str, begun: Sequence[int]) -> None:
        target = self._merged.folder(name)
        final = self._folder / SCENES_FOLDER / name
        runs = [load_run(self._campaigns[k].folder(name)) for k in begun]
        if len(runs) == 1 and runs[0].document.shard == self._shard:
            self._copy(begun[0], name, runs[0], target, final)
            return
        target.mkdir()
        choice = write_merged(runs, target, final, self._shard)
        self._note(name, runs[0], choice.missing, choice.failed, choice.interrupted)

    def copy_parts(self) -> None:
        """Copies the parts of which all scenes were copied; the others are made from journals."""
        number = 0
        parts = self._merged.path / PARTS_FOLDER
        parts.mkdir()
        for k, campaign in enumerate(self._campaigns):
            for part in PartIndex.of(campaign.path).parts:
                if all(segment.scene in self.copied[k] for segment in part.segments):
                    number += 1
                    digest = part.path.stem.rpartition("-")[2]
                    shutil.copy2(part.path, parts / f"part-{number:06d}-{digest}.parquet")

    def _copy(self, k: int, name: str, run: Run, target: Path, final: Path) -> None:
        # the report tells commands about the run where it was
        shutil.copytree(run.path, target, ignore=shutil.ignore_patterns(".*", REPORT_FILE))
        copy_documents(run, target, final)
        self.copied[k].add(name)
        state = self._campaigns[k].states.get(name)
        size = (target / JOURNAL_FILE).stat().st_size
        if state is not None and state.state == "done" and state.size == size:
            self.states.append(state)
            return
        choice = choose([target / JOURNAL_FILE], run.mine)
        self._note(name, run, choice.missing, choice.failed, choice.interrupted)

    def _note(self, name: str, run: Run, missing: int, failed: int, interrupted: int) -> None:
        self.missing += missing
        count = len(run.candidates)
        shard = self._merged.document.shard_of_grasps
        mine = len(share(range(count), shard))
        size = (self._merged.folder(name) / JOURNAL_FILE).stat().st_size
        state = SceneState(
            scene=name,
            state="open" if missing else "done",
            run=run.document.hash,
            grasps=count,
            mine=mine,
            sampling=run.document.grasps.cpu,
            size=0 if missing else size,
            failed=failed,
            interrupted=interrupted,
            missing="; ".join(shortfalls(run)),
        )
        self.states.append(state)
