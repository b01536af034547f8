"""What is left of a merge when the merged run is in its place: tables, parts and reports.

A file in the run's folder tells of it until it is done, so that the same merge finishes what was
killed; `evaluate`, which finishes it, too, removes the file.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

from burg_drake.core import content_hash
from burg_drake.evaluation.records import JOURNAL_FILE, Lock
from burg_drake.evaluation.report import write_campaign_report
from burg_drake.evaluation.run import finish_run, is_finished
from burg_drake.evaluation.store import (
    LOCK_FILE,
    RUN_FILE,
    Campaign,
    PartWriter,
    Run,
    is_campaign,
    load_run,
    open_results,
)


@dataclass(frozen=True)
class MissingFromMerge:
    """What none of the merged runs had.

    Attributes:
        missing: number of grasps.
        scenes: that have not been begun.
        shards: that were not among the runs.
    """

    missing: int = 0
    scenes: tuple[str, ...] = ()
    shards: tuple[str, ...] = ()


def note_unfinished(folder: Path, sources: Sequence[Path], left: MissingFromMerge) -> None:
    """Notes in a merged run that it is to be finished."""
    _note(folder, sources).write_text(json.dumps(asdict(left)), encoding="utf-8")


def unfinished(folder: Path, sources: Sequence[Path]) -> MissingFromMerge | None:
    """What these runs lacked, if a folder has what they make together, not finished."""
    try:
        stored = json.loads(_note(folder, sources).read_text(encoding="utf-8"))
        return MissingFromMerge(stored["missing"], tuple(stored["scenes"]), tuple(stored["shards"]))
    except (OSError, ValueError, KeyError, TypeError):
        return None


def finish(folder: Path, sources: Sequence[Path]) -> Run | Campaign:
    """Writes what is made from the journals of a merged run, as far as it is not there.

    Raises:
        InvalidInputError: another process is writing it, or it cannot be written.
    """
    with Lock(lock_file(folder)):
        result = open_results(folder)
        if isinstance(result, Campaign):
            _finish_campaign(result)
        else:
            result = finish_run(result, result.document.table)
        _note(folder, sources).unlink(missing_ok=True)
    return result


def lock_file(folder: Path) -> Path:
    """The file by which a run is locked."""
    return folder / (LOCK_FILE if is_campaign(folder) else JOURNAL_FILE)


def _finish_campaign(campaign: Campaign) -> None:
    document = campaign.document
    reports = document.has_few_scenes
    for place in campaign.places:
        if not (place.folder / RUN_FILE).exists():
            continue
        size = place.journal.stat().st_size
        if not is_finished(place.folder, size, document.table, report=reports):
            finish_run(load_run(place.folder), document.table, report=reports)
    writer = PartWriter(campaign.path, campaign.places, document.instances)
    writer.catch_up()
    writer.close()
    write_campaign_report(campaign)


def _note(folder: Path, sources: Sequence[Path]) -> Path:
    """Named as `files.remove_unfinished` wants it."""
    names = sorted(str(path.resolve()) for path in sources)
    return folder / f".merge.{content_hash(names)[:16]}"
