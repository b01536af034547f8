"""Progress of a run, read from another process while it works, or afterwards."""

from __future__ import annotations

import time
from collections import Counter
from dataclasses import dataclass, field, replace
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from burg_drake.evaluation.campaign_folder import (
    CAMPAIGN_FILE,
    CAMPAIGN_LOCK_FILE,
    Campaign,
    open_results,
)
from burg_drake.evaluation.journal import JOURNAL_FILE, is_locked
from burg_drake.evaluation.part_store import JournalCounts, read_journal_counts
from burg_drake.evaluation.run_document import WorkSession
from burg_drake.evaluation.run_folder import RUN_FILE, Run
from burg_drake.evaluation.settings import select_share


@dataclass(frozen=True, kw_only=True)
class Status:
    """Progress of a run.

    Attributes:
        path: folder of the run.
        kind: `run` for one scene, `campaign` for many.
        working: whether a process is working on it.
        judged: number of grasps with a verdict.
        total: number of grasps; an estimate until all scenes are sampled.
        outcomes: number of grasps by outcome.
        rate: recent grasps per second, or those of the current session; None if unknown.
        left: expected remaining time [s]; None if unknown.
        last: date of the last verdict, seconds since 1970; None if there is none.
        shard: shard of the run, as `K/N`; empty for all.
        sampled: whether all grasps of a run of one scene are known.
        scenes, done: number of scenes, and of finished scenes.
        failed: scenes that could not be judged, with the reason of each.
        under_way: scenes in progress.
    """

    path: str
    kind: str
    working: bool
    judged: int
    total: int
    outcomes: Counter[str]
    rate: float | None = None
    left: float | None = None
    last: float | None = None
    shard: str = ""
    sampled: bool = True
    scenes: int = 1
    done: int = 0
    failed: dict[str, str] = field(default_factory=dict)
    under_way: tuple[str, ...] = ()

    @property
    def complete(self) -> bool:
        """Whether all grasps are judged."""
        return self.done + len(self.failed) == self.scenes

    def plain(self) -> dict[str, Any]:
        """The status as JSON values."""
        return {**vars(self), "outcomes": dict(self.outcomes), "complete": self.complete}


class RunWatch:
    """Reads the progress of a run repeatedly."""

    def __init__(self, path: str | Path) -> None:
        """Opens the run and counts the verdicts in its parts.

        Raises:
            InvalidInputError: there is no run.
            DocumentError: run.yaml or campaign.yaml does not fit the schema.
        """
        self._date = _document_time(Path(path))
        self._result = result = open_results(path)
        self._counts = read_journal_counts(result)
        self._history: list[tuple[float, int]] = []

    def look(self) -> Status:
        """Reads the current progress."""
        self._result = result = self._refresh_result()
        if isinstance(result, Campaign):
            return self._look_at_scenes(result)
        document = result.document
        counts = self._refresh_counts("")
        total = len(select_share(range(document.grasps.count), document.shard))
        judged = min(counts.judged, total)
        status = self._make_status(
            result.path / JOURNAL_FILE, judged, total, counts.outcomes, counts.modified
        )
        done = judged == total and result.is_sampled
        under_way = () if done else (document.scene.name,)
        status = replace(status, sampled=result.is_sampled)
        return replace(status, kind="run", done=int(done), under_way=under_way)

    def _look_at_scenes(self, campaign: Campaign) -> Status:
        states = {name: s for name, s in campaign.states.items() if name in set(campaign.names)}
        begun = [n for n in campaign.names if n in states and states[n].state in ("open", "done")]
        scene_counts = [self._refresh_counts(name) for name in begun]
        outcomes: Counter[bytes] = Counter()
        for counts in scene_counts:
            outcomes.update(counts.outcomes)
        judged = sum(counts.judged for counts in scene_counts)
        last = max((counts.modified for counts in scene_counts), default=0.0)
        lock = campaign.path / CAMPAIGN_LOCK_FILE
        total = max(judged, campaign.expected)
        return replace(
            self._make_status(lock, judged, total, outcomes, last),
            kind="campaign",
            scenes=len(campaign.names),
            done=sum(state.state in ("done", "empty") for state in states.values()),
            failed=campaign.failed,
            under_way=tuple(n for n in begun if states[n].state == "open"),
        )

    def _make_status(
        self, lock: Path, judged: int, total: int, outcomes: Counter[bytes], last: float
    ) -> Status:
        """Status with the fields common to runs of one scene and of many."""
        document = self._result.document
        working = is_locked(lock)
        rate = self._judging_rate(judged, document.stretches, working)
        return Status(
            path=str(self._result.path),
            kind="",
            working=working,
            judged=judged,
            total=total,
            outcomes=Counter({name.decode(): n for name, n in outcomes.items() if n > 0}),
            rate=rate,
            left=(total - judged) / rate if rate else None,
            last=last or None,
            shard=document.shard,
        )

    def _refresh_result(self) -> Run | Campaign:
        """The run with its current document, which is read again if its date has changed."""
        path = self._result.path
        date = _document_time(path)
        if date == self._date:
            return replace(self._result)  # drops cached properties
        self._date = date
        return open_results(path)

    def _refresh_counts(self, name: str) -> JournalCounts:
        counts = self._counts[name]
        counts.refresh()
        return counts

    def _judging_rate(
        self, judged: int, sessions: tuple[WorkSession, ...], working: bool
    ) -> float | None:
        """Grasps per second over the last minute, else over the current session."""
        window = 60.0  # Seconds over which the rate is taken.
        now = time.monotonic()
        self._history.append((now, judged))
        while len(self._history) > 2 and self._history[1][0] < now - window:
            self._history.pop(0)
        if not working:
            return None
        begun, before = self._history[0]
        if now - begun >= window / 4:
            return (judged - before) / (now - begun) or None
        return _session_rate(sessions[-1], judged) if sessions else None


def _document_time(path: Path) -> tuple[int, ...]:
    """Modification times of the run's documents [ns]; 0 for a missing one."""
    files = (path / CAMPAIGN_FILE, path / RUN_FILE)
    return tuple(file.stat().st_mtime_ns if file.exists() else 0 for file in files)


def _session_rate(session: WorkSession, judged: int) -> float | None:
    """Grasps per second of the current session; None if unknown."""
    if session.judged is not None or session.before is None:
        return None
    begun = datetime.fromisoformat(session.started)
    seconds = (datetime.now(UTC) - begun).total_seconds()
    done = judged - session.before
    return done / seconds if seconds > 0 and done > 0 else None


def read_status(path: str | Path) -> Status:
    """Reads the progress of a run of one scene or of many.

    Raises:
        InvalidInputError: there is no run.
        DocumentError: run.yaml or campaign.yaml does not fit the schema.
    """
    return RunWatch(path).look()
