"""Columnar store of a run: its table in parts (Parquet files), made from its journals."""

from __future__ import annotations

import os
import re
from collections import Counter, defaultdict
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from importlib.util import find_spec
from pathlib import Path
from typing import Any, Protocol

import numpy as np

from burg_drake.core import INSTANCE_PREFIXES, Outcome, open_regular, remove_unfinished
from burg_drake.evaluation.journal import JOURNAL_FILE, read_journal
from burg_drake.evaluation.result_rows import CHUNK_ROWS
from burg_drake.evaluation.results_table import make_columns
from burg_drake.evaluation.run_folder import Run, StoredRun, load_run
from burg_drake.evaluation.table_parts import (
    CANDIDATE_COLUMN,
    JournalSegment,
    StoredRows,
    TablePart,
    arrow_table,
    column_names,
    empty_column,
    last_line_end,
    line_end,
    open_part,
    read_part,
    require_arrow,
    segment_of,
    select_columns,
    valid_segments,
    write_part,
)

PARTS_FOLDER = "parts"


class StoredResults(Protocol):
    """A run of one scene or of many, whose rows are kept in parts.

    Attributes:
        path: folder of the run, with the parts.
        stored_runs: runs of the scenes, in the order of the rows.
        instances: names of the free objects of all scenes; all parts have columns for them.
    """

    @property
    def path(self) -> Path: ...

    @property
    def stored_runs(self) -> Sequence[StoredRun]: ...

    @property
    def instances(self) -> Sequence[str]: ...


@dataclass(eq=False)
class PartIndex:
    """Parts in a folder, and the journal segments that the parts are made from.

    Attributes:
        parts: intact parts, sorted by number.
        damaged: damaged files.
    """

    parts: list[TablePart] = field(default_factory=list)
    damaged: list[Path] = field(default_factory=list)

    @classmethod
    def of(cls, folder: Path) -> PartIndex:
        """Reads the footers of the parts of a run."""
        index = cls()
        parts = folder / PARTS_FOLDER
        for path in sorted(parts.glob("part-*.parquet")) if parts.is_dir() else ():
            part = open_part(path)
            if part is None:
                index.damaged.append(path)
            else:
                index.parts.append(part)
        return index

    def mark_damaged(self, part: TablePart) -> None:
        """Moves a part to the damaged ones."""
        self.parts = [other for other in self.parts if other is not part]
        self.damaged.append(part.path)

    def segments(self) -> dict[str, list[tuple[JournalSegment, TablePart, int]]]:
        """Segments by scene, each with its part and the row of the part at which it begins."""
        found: dict[str, list[tuple[JournalSegment, TablePart, int]]] = defaultdict(list)
        for part in self.parts:
            row = 0
            for segment in part.segments:
                found[segment.scene].append((segment, part, row))
                row += segment.rows
        return found


def read_rows(run: StoredResults, names: Sequence[str] | None) -> StoredRows:
    """Reads columns of the judged grasps of a run.

    Args:
        run: the run.
        names: names of the columns; all if None. Cells of columns that a scene lacks are null.

    Raises:
        MissingDependencyError: pyarrow is not installed.
        BurgError: a run cannot be read.
    """
    index = PartIndex.of(run.path)
    while True:
        found = _read_tables(index, run, names)
        if isinstance(found, StoredRows):
            return found
        index.mark_damaged(found)


def segment_table(run: Run, begin: int, end: int) -> Any:
    """Arrow table of a range of bytes of a run's journal, in the order of the candidates."""
    verdicts = read_journal(run.path / JOURNAL_FILE, begin, end)
    rows = run.candidates.rows(list(verdicts))
    order = np.argsort(rows)
    order = order[rows[order] >= 0]
    found = list(verdicts.values())
    tables = []
    for begin in range(0, max(1, len(order)), CHUNK_ROWS):
        chosen = order[begin : begin + CHUNK_ROWS]
        judged = [found[k] for k in chosen.tolist()]
        columns = make_columns(run.candidates, rows[chosen], judged, **run.table_settings)
        tables.append(arrow_table({**columns, CANDIDATE_COLUMN: rows[chosen]}))
    return require_arrow("a columnar table").concat_tables(tables)


def merge_tables(tables: Sequence[Any]) -> Any:
    """Merges tables of one run: the last row of each candidate, in the candidates' order."""
    arrow = require_arrow("a columnar table")
    table = arrow.concat_tables(tables, promote_options="permissive")
    candidate = table.column(CANDIDATE_COLUMN).to_numpy()
    order = np.lexsort((np.arange(len(candidate)), candidate))
    last = np.append(candidate[order][1:] != candidate[order][:-1], True)
    return table.take(order[last]) if len(order) else table


def _read_tables(
    index: PartIndex, run: StoredResults, names: Sequence[str] | None
) -> StoredRows | TablePart:
    """Reads the rows of a run; returns the part if one turns out to be damaged."""
    arrow = require_arrow("reading the results of many grasps")
    segments = index.segments()
    pieces: list[list[tuple[TablePart, int, int]]] = []
    tails: list[Any | None] = []
    for stored in run.stored_runs:
        located = segments.get(stored.scene, [])
        valid = valid_segments([segment for segment, _, _ in located], stored.journal)
        where = {segment: (part, row, segment.rows) for segment, part, row in located}
        pieces.append([where[segment] for segment in valid])
        tail = _read_tail(stored, valid[-1].end if valid else 0)
        tails.append(None if tail is None else with_instance_columns(tail, run.instances))
    used = {part.path: part for piece in pieces for part, _, _ in piece}
    if names is None:
        names = _all_names(list(used.values()), tails)
    wanted = [*dict.fromkeys([*names, CANDIDATE_COLUMN])]
    tables: dict[Path, Any] = {}
    for path, part in used.items():
        table = read_part(part, wanted)
        if table is None:
            return part
        tables[path] = table
    sources: list[Any] = []
    for piece, tail in zip(pieces, tails, strict=True):
        if tail is None and len(piece) == 1:
            sources.append(piece[0])
            continue
        slices = [tables[part.path].slice(row, rows) for part, row, rows in piece]
        if tail is not None:
            slices.append(select_columns(tail, wanted))
        sources.append(merge_tables(slices) if len(slices) > 1 else slices[0] if slices else None)
    counts = np.array([_row_count(source) for source in sources], dtype=np.int64)
    filled = [table for table in _run_tables(sources, tables) if table.num_rows]
    empty = arrow.table({name: empty_column(name, 0) for name in wanted})
    whole = arrow.concat_tables(filled, promote_options="permissive") if filled else empty
    return StoredRows(whole.select(list(names)), counts)


def _row_count(source: Any) -> int:
    """Number of rows of a run; `source` is a slice of a part, a table, or None."""
    return 0 if source is None else source[2] if isinstance(source, tuple) else source.num_rows


def _run_tables(sources: Sequence[Any], tables: Mapping[Path, Any]) -> Iterator[Any]:
    """Yields the tables of runs in order; adjacent slices of a part are joined to one.

    Args:
        sources: slice of a part, table or None for each run.
        tables: tables of the parts, by file.
    """
    k = 0
    while k < len(sources):
        if isinstance(sources[k], tuple):
            part, begin, rows = sources[k]
            while (
                k + 1 < len(sources)
                and isinstance(sources[k + 1], tuple)
                and sources[k + 1][:2] == (part, begin + rows)
            ):
                k, rows = k + 1, rows + sources[k + 1][2]
            yield tables[part.path].slice(begin, rows)
        elif sources[k] is not None:
            yield sources[k]
        k += 1


def _read_tail(stored: StoredRun, begin: int) -> Any | None:
    """Reads the rows of a journal that are not in parts yet; None if there are none."""
    end = last_line_end(stored.journal)
    return segment_table(load_run(stored.folder), begin, end) if end > begin else None


def _all_names(parts: Sequence[TablePart], tails: Sequence[Any | None]) -> list[str]:
    """Names of the columns of all tables, each once."""
    names: dict[str, None] = {}
    for part in parts:
        names |= dict.fromkeys(column_names(part))
    for tail in tails:
        names |= dict.fromkeys([] if tail is None else tail.column_names)
    names.pop(CANDIDATE_COLUMN, None)
    return list(names)


def with_instance_columns(table: Any, instances: Sequence[str]) -> Any:
    """Table with columns for all instances, inserted at the first column of each kind."""
    if not instances:
        return table
    arrow = require_arrow("a columnar table")
    columns: dict[str, Any] = {}
    for name in table.column_names:
        for prefix in INSTANCE_PREFIXES.values():
            if name.startswith(prefix) and name.removeprefix(prefix) in instances:
                for instance in instances:
                    columns.setdefault(prefix + instance, None)
        columns[name] = table.column(name)
    rows = table.num_rows
    return arrow.table({n: empty_column(n, rows) if c is None else c for n, c in columns.items()})


PART_ROWS = 50_000
"""Rows per part: few enough to write one in a second or two, enough to keep parts few."""
BATCH_BYTES = 8 << 20
"""Bytes of a journal that are converted at a time; a row takes a few hundred."""


class PartWriter:
    """Writes the parts of a run; only for the process that holds the run's lock."""

    def __init__(self, run: StoredResults) -> None:
        """Reads the existing parts; removes damaged parts and stale segments."""
        self._folder = run.path / PARTS_FOLDER
        self._instances = list(run.instances)
        self._pending: list[tuple[Any, JournalSegment]] = []
        self._stored_runs = {stored.scene: stored for stored in run.stored_runs}
        self._folder.mkdir(parents=True, exist_ok=True)
        remove_unfinished(self._folder)
        self._index = PartIndex.of(run.path)
        for path in self._index.damaged:
            path.unlink(missing_ok=True)
        self._ends: dict[str, int] = {}
        self._number = max((part.number for part in self._index.parts), default=0)
        self._remove_stale_segments()

    def scenes_with_new_rows(self) -> list[str]:
        """Scenes whose journals have lines that are not in parts yet."""
        return [
            scene
            for scene, stored in self._stored_runs.items()
            if stored.journal.exists() and stored.journal.stat().st_size > self._ends.get(scene, 0)
        ]

    def add_new_rows(self, scenes: Iterable[str] | None = None) -> None:
        """Adds the new rows of the journals of scenes; of all scenes if None."""
        for scene in self.scenes_with_new_rows() if scenes is None else scenes:
            self.add_rows(scene)

    def add_rows(self, scene: str, run: Run | None = None) -> None:
        """Adds the new rows of the journal of a scene; full parts are written."""
        stored = self._stored_runs[scene]
        begin, end = self._ends.get(scene, 0), last_line_end(stored.journal)
        if end > begin and run is None:
            run = load_run(stored.folder)
        while begin < end:
            assert run is not None
            batch_end = min(end, line_end(stored.journal, min(end, begin + BATCH_BYTES)))
            table = segment_table(run, begin, batch_end)
            segment = segment_of(scene, stored.journal, begin, batch_end, table.num_rows)
            self._pending.append((with_instance_columns(table, self._instances), segment))
            self._ends[scene] = begin = batch_end
            if sum(segment.rows for _, segment in self._pending) >= PART_ROWS:
                self.flush()

    def flush(self) -> None:
        """Writes the pending rows to a part."""
        if self._pending:
            arrow = require_arrow("a columnar table")
            tables, segments = zip(*self._pending, strict=True)
            table = arrow.concat_tables(tables, promote_options="permissive").combine_chunks()
            self._write(table.unify_dictionaries(), segments)
            self._pending.clear()

    def close(self) -> None:
        """Writes pending rows; keeps only the last row of grasps that were judged again."""
        self.flush()
        again = self._scenes_judged_again()
        if again:
            parts = self._index.parts
            self._rewrite_without({s for part in parts for s in part.segments if s.scene in again})
            for scene in again:
                self._ends.pop(scene)
            self.add_new_rows(again)
            self.flush()

    def _scenes_judged_again(self) -> list[str]:
        """Scenes with several rows of one grasp."""
        segments = self._index.segments()
        repeated = []
        for scene, found in segments.items():
            if len(found) == 1:
                continue
            rows = [_candidate_rows(part)[row : row + s.rows] for s, part, row in found]
            if len(np.unique(np.concatenate(rows))) < sum(map(len, rows)):
                repeated.append(scene)
        return repeated

    def _write(self, table: Any, segments: Sequence[JournalSegment]) -> None:
        self._number += 1
        self._index.parts.append(write_part(self._folder, self._number, table, segments))

    def _remove_stale_segments(self) -> None:
        stale: set[JournalSegment] = set()
        for scene, found in self._index.segments().items():
            stored = self._stored_runs.get(scene)
            segments = [segment for segment, _, _ in found]
            valid = valid_segments(segments, stored.journal) if stored else []
            stale |= {*segments} - {*valid}
            self._ends[scene] = valid[-1].end if valid else 0
        self._rewrite_without(stale)

    def _rewrite_without(self, stale: set[JournalSegment]) -> None:
        """Rewrites parts without their stale segments.

        Also drops segments that a newer part has: a process was killed while it rewrote the older.
        """
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
            for segment in kept if table is None else ():  # the part is damaged: rows made again
                self._ends[segment.scene] = min(self._ends[segment.scene], segment.begin)
            part.path.unlink(missing_ok=True)


def _candidate_rows(part: TablePart) -> Any:
    table = read_part(part, [CANDIDATE_COLUMN])
    return np.empty(0) if table is None else table.column(CANDIDATE_COLUMN).to_numpy()


def keep_parts(run: Run) -> None:
    """Writes parts of a run of one scene if it is large enough and pyarrow is installed."""
    if len(run.candidates) < PART_ROWS or find_spec("pyarrow") is None:
        return
    writer = PartWriter(run)
    writer.add_rows("", run)
    writer.close()


def update_parts(run: StoredResults) -> None:
    """Writes the new rows of the journals of a run to parts; see `PartWriter`."""
    writer = PartWriter(run)
    writer.add_new_rows()
    writer.close()


JOURNAL_LINE_PATTERN = re.compile(
    rb'^\{"id":"((?:[^"\\]|\\.)*)","outcome":"([a-z_]+)"[^\n]*\}\n', re.MULTILINE
)
"""Matches a line of a journal, as `encode_verdict` writes it."""
PREVIOUS_OUTCOME_PATTERN = re.compile(rb'"outcome_before":"([a-z_]+)"')
"""Matches, in the line of a grasp judged again, the outcome that no longer counts."""
FAILED_OUTCOME = Outcome.SIMULATION_FAILED.value.encode()


@dataclass
class JournalCounts:
    """Counts of the verdicts in a journal, updated as the journal grows.

    Attributes:
        path: the journal.
        counted_bytes: number of bytes that were counted.
        judged: number of grasps with a verdict.
        outcomes: number of grasps by outcome.
        failed: ids of grasps that could not be simulated, which may be judged again.
        modified: date of the last verdict, seconds since 1970; 0 if there is none.
    """

    path: Path
    counted_bytes: int = 0
    judged: int = 0
    outcomes: Counter[bytes] = field(default_factory=Counter)
    failed: set[bytes] = field(default_factory=set)
    modified: float = 0.0

    def refresh(self) -> None:
        """Counts the lines that were appended since the last call."""
        try:
            status = os.stat(self.path)
        except OSError:
            return
        if status.st_size < self.counted_bytes:  # the journal was started anew
            self.counted_bytes, self.judged, self.outcomes, self.failed = 0, 0, Counter(), set()
        self.modified = status.st_mtime if status.st_size else 0.0
        if status.st_size == self.counted_bytes:
            return
        with open_regular(self.path) as stream:
            stream.seek(self.counted_bytes)
            while data := stream.read(1 << 22):
                whole = data.rfind(b"\n") + 1
                if not whole:
                    return
                self._count(data[:whole])
                self.counted_bytes += whole
                stream.seek(self.counted_bytes)

    def _count(self, data: bytes) -> None:
        found = JOURNAL_LINE_PATTERN.findall(data)
        self.judged += len(found)
        self.outcomes.update(outcome for _, outcome in found)
        again = PREVIOUS_OUTCOME_PATTERN.findall(data)
        self.judged -= len(again)
        self.outcomes.subtract(again)
        if not self.failed and self.outcomes[FAILED_OUTCOME] == 0:
            return
        for id, outcome in found:
            if id in self.failed:  # judged again
                self.failed.discard(id)
                self.outcomes[FAILED_OUTCOME] -= 1
                self.judged -= 1
            if outcome == FAILED_OUTCOME:
                self.failed.add(id)


def read_journal_counts(run: StoredResults) -> dict[str, JournalCounts]:
    """Counts by scene of the journal lines whose rows are in the parts of a run."""
    counts = {stored.scene: JournalCounts(stored.journal) for stored in run.stored_runs}
    if not (run.path / PARTS_FOLDER).is_dir() or find_spec("pyarrow") is None:
        return counts
    index = PartIndex.of(run.path)
    names = ["id", "outcome", CANDIDATE_COLUMN]
    tables: dict[Path, Any] = {part.path: read_part(part, names) for part in index.parts}
    segments = index.segments()
    for stored in run.stored_runs:
        where = {s: (part, row) for s, part, row in segments.get(stored.scene, [])}
        found = valid_segments(list(where), stored.journal)
        whole = [segment for segment in found if tables[where[segment][0].path] is not None]
        if found and found == whole:
            pieces = [(*where[segment], segment.rows) for segment in found]
            slices = [tables[part.path].slice(row, rows) for part, row, rows in pieces]
            _count_rows(counts[stored.scene], slices)
            counts[stored.scene].counted_bytes = found[-1].end
    return counts


def _count_rows(counts: JournalCounts, slices: Sequence[Any]) -> None:
    """Sets the counts of a journal from the rows of Arrow tables."""
    table = merge_tables(slices) if len(slices) > 1 else slices[0]
    column = table.column("outcome")
    pairs = [(item["values"], item["counts"]) for item in column.value_counts().to_pylist()]
    counts.judged = table.num_rows
    counts.outcomes = Counter({str(text).encode(): n for text, n in pairs})
    if counts.outcomes[FAILED_OUTCOME]:
        ids = zip(table.column("id").to_pylist(), column.to_pylist(), strict=True)
        counts.failed = {id.encode() for id, text in ids if text == FAILED_OUTCOME.decode()}
