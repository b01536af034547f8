"""How many grasps a journal has judged, without reading all that is in it: what the parts of a
table have is counted there, and only the rest is read, each time from where it was left."""

from __future__ import annotations

import os
import re
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from burg_drake.core.files import open_regular
from burg_drake.core.grasps import Outcome
from burg_drake.evaluation.store.part_file import CANDIDATE, read_part
from burg_drake.evaluation.store.part_segments import chain
from burg_drake.evaluation.store.part_store import PARTS_FOLDER, PartIndex, StoredRun, merged

LINE = re.compile(rb'^\{"id":"((?:[^"\\]|\\.)*)","outcome":"([a-z_]+)"[^\n]*\}\n', re.MULTILINE)
"""A line of a journal, as `journal.encode` writes it."""
BEFORE = re.compile(rb'"outcome_before":"([a-z_]+)"')
"""In the line of a grasp that was judged again: the outcome that no longer counts."""
FAILED = Outcome.SIMULATION_FAILED.value.encode()
CHUNK = 1 << 22


@dataclass
class JournalTail:
    """What is known of a journal, up to a byte.

    Attributes:
        path: the journal.
        place: the byte.
        lines: grasps that have a verdict.
        outcomes: number of grasps by outcome.
        failed: ids of those that could not be simulated, which may be judged again.
        modified: date of the last verdict, seconds since 1970; 0 if there is none.
    """

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
        self.modified = status.st_mtime if status.st_size else 0.0
        if status.st_size == self.place:
            return
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
        again = BEFORE.findall(data)
        self.lines -= len(again)
        self.outcomes.subtract(again)
        if not self.failed and self.outcomes[FAILED] == 0:
            return
        for id, outcome in found:
            if id in self.failed:  # judged again
                self.failed.discard(id)
                self.outcomes[FAILED] -= 1
                self.lines -= 1
            if outcome == FAILED:
                self.failed.add(id)


def tails_of(folder: Path, places: Sequence[StoredRun]) -> dict[str, JournalTail]:
    """What the parts of a run know of its journals, by scene.

    Args:
        folder: that has the parts.
        places: the runs.
    """
    tails = {place.scene: JournalTail(place.journal) for place in places}
    if not (folder / PARTS_FOLDER).is_dir() or find_spec("pyarrow") is None:
        return tails
    index = PartIndex.of(folder)
    names = ["id", "outcome", CANDIDATE]
    tables: dict[Path, Any] = {part.path: read_part(part, names) for part in index.parts}
    segments = index.segments()
    for place in places:
        where = {s: (part, row) for s, part, row in segments.get(place.scene, [])}
        found = chain(list(where), place.journal)
        whole = [segment for segment in found if tables[where[segment][0].path] is not None]
        if found and found == whole:
            pieces = [(*where[segment], segment.rows) for segment in found]
            slices = [tables[part.path].slice(row, rows) for part, row, rows in pieces]
            _count_rows(tails[place.scene], slices)
            tails[place.scene].place = found[-1].end
    return tails


def _count_rows(tail: JournalTail, slices: Sequence[Any]) -> None:
    """Counts rows of Arrow tables."""
    table = merged(slices) if len(slices) > 1 else slices[0]
    column = table.column("outcome")
    counts = {item["values"]: item["counts"] for item in column.value_counts().to_pylist()}
    tail.lines = table.num_rows
    tail.outcomes = Counter({str(text).encode(): n for text, n in counts.items()})
    if tail.outcomes[FAILED]:
        pairs = zip(table.column("id").to_pylist(), column.to_pylist(), strict=True)
        tail.failed = {id.encode() for id, text in pairs if text == FAILED.decode()}
