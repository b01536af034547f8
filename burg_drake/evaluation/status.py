"""How far a run is, seen from another process while it works, or afterwards.

The first look counts the lines of the journals that the store does not have yet; each later look
reads what has come since.
"""

from __future__ import annotations

import os
import re
import time
from collections import Counter
from dataclasses import dataclass, field
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from burg_drake.core.files import open_regular
from burg_drake.core.outcome import Outcome
from burg_drake.evaluation.campaign import LOCK_FILE, Campaign
from burg_drake.evaluation.journal import JOURNAL_FILE
from burg_drake.evaluation.ledger import Ledger
from burg_drake.evaluation.lock import is_locked
from burg_drake.evaluation.results import open_results
from burg_drake.evaluation.run_document import RunDocument, Stretch
from burg_drake.evaluation.shard import share

LINE = re.compile(rb'^\{"id":"((?:[^"\\]|\\.)*)","outcome":"([a-z_]+)"[^\n]*\}\n', re.MULTILINE)
"""A line of a journal, as `journal.encode` writes it."""
FAILED = Outcome.SIMULATION_FAILED.value.encode()
CHUNK = 1 << 22
WINDOW = 60.0
"""The rate is that of so long [s], once a status has been followed for that long."""


@dataclass(frozen=True, kw_only=True)
class Status:
    """How far a run is.

    Attributes:
        path: its folder.
        kind: `run` of one scene, or `campaign` of many.
        working: whether a process is at it.
        judged: grasps that have a verdict.
        total: of how many; expected, as long as scenes have not been sampled.
        outcomes: number of grasps by outcome.
        rate: grasps a second: lately, or of the stretch of work that is under way; None if unknown.
        left: expected time left [s]; None if unknown.
        last: date of the last verdict, seconds since 1970; None if there is none.
        shard: share that is judged here, as `K/N`; empty if all.
        scenes: how many there are, and `done` of them.
        failed: why scenes could not be judged, by name.
        under_way: scenes that have been begun and are not done.
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
    scenes: int = 1
    done: int = 0
    failed: dict[str, str] = field(default_factory=dict)
    under_way: tuple[str, ...] = ()

    @property
    def complete(self) -> bool:
        """Whether nothing is left to judge."""
        return self.done + len(self.failed) == self.scenes

    def plain(self) -> dict[str, Any]:
        """As JSON values."""
        return {**vars(self), "outcomes": dict(self.outcomes), "complete": self.complete}


@dataclass
class _Tail:
    """What is known of a journal, up to a byte."""

    path: Path
    place: int = 0
    lines: int = 0
    outcomes: Counter[bytes] = field(default_factory=Counter)
    failed: set[bytes] = field(default_factory=set)
    modified: float = 0.0

    def refresh(self) -> None:
        """Reads what has come since."""
        try:
            status = os.stat(self.path)
        except OSError:
            return
        if status.st_size < self.place:  # it was begun again
            self.place, self.lines, self.outcomes, self.failed = 0, 0, Counter(), set()
        if status.st_size == self.place:
            return
        self.modified = status.st_mtime
        with open_regular(self.path) as stream:
            stream.seek(self.place)
            while data := stream.read(CHUNK):
                whole = data.rfind(b"\n") + 1
                if not whole:
                    return
                self._count(data[:whole])
                self.place += whole
                stream.seek(self.place)

    def _count(self, data: bytes) -> None:
        found = LINE.findall(data)
        self.lines += len(found)
        self.outcomes.update(outcome for _, outcome in found)
        if self.failed:
            for id, _ in found:
                if id in self.failed:  # judged again
                    self.failed.discard(id)
                    self.outcomes[FAILED] -= 1
                    self.lines -= 1
        self.failed |= {id for id, outcome in found if outcome == FAILED}


class Watch:
    """Looks at a run again and again."""

    def __init__(self, path: str | Path) -> None:
        """Reads what does not change.

        Raises:
            InvalidInputError: there is no run.
            DocumentError: its document does not fit the schema.
        """
        self._result = open_results(path)
        self._tails: dict[str, _Tail] = {}
        self._ledger = Ledger(self._result.path)
        self._history: list[tuple[float, int]] = []

    def look(self) -> Status:
        """How far it is now."""
        if isinstance(self._result, Campaign):
            return self._campaign(self._result)
        run = open_results(self._result.path)
        assert isinstance(run.document, RunDocument)
        document = run.document
        tail = self._tail("", run.path)
        total = len(share(range(document.grasps.count), document.shard))
        judged = min(tail.lines, total)
        working = is_locked(run.path / JOURNAL_FILE)
        rate = self._rate(judged, document.stretches, working)
        return Status(
            path=str(run.path),
            kind="run",
            working=working,
            judged=judged,
            total=total,
            outcomes=_texts(tail.outcomes),
            rate=rate,
            left=(total - judged) / rate if rate else None,
            last=tail.modified or None,
            shard=document.shard,
            done=int(judged == total),
            under_way=() if judged == total else (document.scene.name,),
        )

    def _campaign(self, campaign: Campaign) -> Status:
        self._ledger.refresh()
        states = self._ledger.states
        campaign.__dict__["states"] = states
        begun = [n for n in campaign.names if n in states and states[n].state in ("open", "done")]
        outcomes: Counter[bytes] = Counter()
        judged, last = 0, 0.0
        for name in begun:
            tail = self._tail(name, campaign.folder(name))
            outcomes.update(tail.outcomes)
            judged += tail.lines
            last = max(last, tail.modified)
        working = is_locked(campaign.path / LOCK_FILE)
        total = max(judged, sum(campaign.expected.values()))
        now = open_results(campaign.path)
        rate = self._rate(judged, now.document.stretches, working)
        mine = set(campaign.names)
        ended = [s for n, s in states.items() if n in mine and s.state in ("done", "empty")]
        return Status(
            path=str(campaign.path),
            kind="campaign",
            working=working,
            judged=judged,
            total=total,
            outcomes=_texts(outcomes),
            rate=rate,
            left=(total - judged) / rate if rate else None,
            last=last or None,
            shard=campaign.document.shard,
            scenes=len(campaign.names),
            done=len(ended),
            failed=campaign.failed,
            under_way=tuple(n for n in begun if states[n].state == "open"),
        )

    def _tail(self, name: str, folder: Path) -> _Tail:
        tail = self._tails.setdefault(name, _Tail(folder / JOURNAL_FILE))
        tail.refresh()
        return tail

    def _rate(self, judged: int, stretches: tuple[Stretch, ...], working: bool) -> float | None:
        """Grasps a second: of the time in which this was followed, if that is long enough, else
        of the stretch that is under way."""
        now = time.monotonic()
        self._history.append((now, judged))
        while len(self._history) > 2 and self._history[1][0] < now - WINDOW:
            self._history.pop(0)
        if not working:
            return None
        begun, before = self._history[0]
        if now - begun >= WINDOW / 4:
            return (judged - before) / (now - begun) or None
        if not stretches or stretches[-1].judged is not None:
            return None
        earlier = sum(stretch.judged or 0 for stretch in stretches[:-1])
        seconds = (
            datetime.now(UTC) - datetime.fromisoformat(stretches[-1].started)
        ).total_seconds()
        return (judged - earlier) / seconds if seconds > 0 and judged > earlier else None


def read_status(path: str | Path) -> Status:
    """How far a run of one scene or of many is.

    Raises:
        InvalidInputError: there is no run.
        DocumentError: its document does not fit the schema.
    """
    return Watch(path).look()


def _texts(outcomes: Counter[bytes]) -> Counter[str]:
    return Counter({name.decode(): count for name, count in outcomes.items() if count > 0})
