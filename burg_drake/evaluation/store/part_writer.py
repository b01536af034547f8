"""Keeps the parts of a run up with its journals."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np

from burg_drake.core.files import remove_unfinished
from burg_drake.evaluation.store.part_file import (
    CANDIDATE,
    Part,
    column_names,
    read_part,
    require_arrow,
    write_part,
)
from burg_drake.evaluation.store.part_segments import (
    JournalSegment,
    chain,
    line_end,
    segment_of,
    whole_lines,
)
from burg_drake.evaluation.store.part_store import (
    PARTS_FOLDER,
    PartIndex,
    StoredRun,
    segment_table,
    with_instances,
)
from burg_drake.evaluation.store.run_folder import Run, load_run

PART_ROWS = 50_000
"""Rows of a part: few enough to be made in a second or two, enough that parts are few."""
BATCH_BYTES = 32 << 20
"""Bytes of a journal whose rows are made at a time; a row has some hundred."""


class PartWriter:
    """Writes parts; one process at a time, the one that has the run."""

    def __init__(self, folder: Path, places: Sequence[StoredRun], instances: Sequence[str]) -> None:
        """Looks at what is there, and removes what is damaged or does not hold any more.

        Args:
            folder: of the run.
            places: all runs whose rows are kept here.
            instances: names of the free objects of all of them, so that all parts have the same
                columns.
        """
        self._folder = folder / PARTS_FOLDER
        self._instances = list(instances)
        self._pending: list[tuple[Any, JournalSegment]] = []
        self._places = {place.scene: place for place in places}
        self._folder.mkdir(parents=True, exist_ok=True)
        remove_unfinished(self._folder)
        self._index = PartIndex.of(folder)
        for path in self._index.damaged:
            path.unlink(missing_ok=True)
        self._ends: dict[str, int] = {}
        self._number = max((part.number for part in self._index.parts), default=0)
        self._remove_stale_segments()

    def behind(self) -> list[str]:
        """Scenes whose journals have more than the parts."""
        return [
            scene
            for scene, place in self._places.items()
            if place.journal.exists() and place.journal.stat().st_size > self._ends.get(scene, 0)
        ]

    def catch_up(self, scenes: Iterable[str] | None = None) -> None:
        """Takes what the journals have beyond the parts; of all scenes if None."""
        for scene in self.behind() if scenes is None else scenes:
            self.take(scene)

    def take(self, scene: str, run: Run | None = None) -> None:
        """Takes what the journal of a scene has beyond the parts."""
        place = self._places[scene]
        begin, end = self._ends.get(scene, 0), whole_lines(place.journal)
        if end > begin and run is None:
            run = load_run(place.folder)
        while begin < end:
            assert run is not None
            upto = min(end, line_end(place.journal, min(end, begin + BATCH_BYTES)))
            table = segment_table(run, begin, upto)
            segment = segment_of(scene, place.journal, begin, upto, table.num_rows)
            self._pending.append((with_instances(table, self._instances), segment))
            self._ends[scene] = begin = upto
            if sum(segment.rows for _, segment in self._pending) >= PART_ROWS:
                self.flush()

    def flush(self) -> None:
        """Writes what was taken."""
        if self._pending:
            arrow = require_arrow("a columnar table")
            tables, segments = zip(*self._pending, strict=True)
            table = arrow.concat_tables(tables, promote_options="permissive").combine_chunks()
            self._write(table.unify_dictionaries(), segments)
            self._pending.clear()

    def close(self) -> None:
        """Writes what is left; of grasps that were judged again only the last row stays."""
        self.flush()
        again = self._judged_again()
        if again:
            self._remove(
                {
                    segment
                    for part in self._index.parts
                    for segment in part.segments
                    if segment.scene in again
                }
            )
            for scene in again:
                self._ends.pop(scene)
            self.catch_up(again)
            self.flush()

    def _judged_again(self) -> list[str]:
        """Scenes with several rows about a grasp."""
        segments = self._index.segments()
        several = [scene for scene, found in segments.items() if len(found) > 1]
        twice = []
        for scene in several:
            places = [
                self._candidates(part)[row : row + s.rows] for s, part, row in segments[scene]
            ]
            if len(np.unique(np.concatenate(places))) < sum(map(len, places)):
                twice.append(scene)
        return twice

    def _candidates(self, part: Part) -> Any:
        table = read_part(part, [CANDIDATE])
        return np.empty(0) if table is None else table.column(CANDIDATE).to_numpy()

    def _write(self, table: Any, segments: Sequence[JournalSegment]) -> None:
        self._number += 1
        self._index.parts.append(write_part(self._folder, self._number, table, segments))

    def _remove_stale_segments(self) -> None:
        stale: set[JournalSegment] = set()
        for scene, found in self._index.segments().items():
            place = self._places.get(scene)
            segments = [segment for segment, _, _ in found]
            held = chain(segments, place.journal) if place else []
            stale |= {*segments} - {*held}
            self._ends[scene] = held[-1].end if held else 0
        self._remove(stale)

    def _remove(self, stale: set[JournalSegment]) -> None:
        """Writes parts without some of their segments again, and without those that a newer part
        has, too, because the process was killed at this."""
        seen: set[JournalSegment] = set()
        for part in sorted(self._index.parts, key=lambda part: -part.number):
            kept = [s for s in part.segments if s not in stale and s not in seen]
            seen |= set(kept)
            if len(kept) == len(part.segments):
                continue
            table = read_part(part, column_names(part)) if kept else None
            self._index.parts.remove(part)
            if table is not None:
                arrow = require_arrow("a columnar table")
                slices, row = [], 0
                for segment in part.segments:
                    if segment in kept:
                        slices.append(table.slice(row, segment.rows))
                    row += segment.rows
                self._write(arrow.concat_tables(slices).combine_chunks(), kept)
            for segment in kept if table is None else ():  # damaged: made again
                self._ends[segment.scene] = min(self._ends[segment.scene], segment.begin)
            part.path.unlink(missing_ok=True)


def keep_parts(run: Run) -> None:
    """Keeps parts of a run of one scene, if it is so large that they matter and pyarrow is
    installed."""
    if len(run.candidates) < PART_ROWS or find_spec("pyarrow") is None:
        return
    writer = PartWriter(run.path, [StoredRun("", run.path)], ())
    writer.catch_up()
    writer.close()
