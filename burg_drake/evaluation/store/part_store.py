"""The columnar store of a run: parts of its table beside its journals, read column by column.

Parts are made from journals and can be deleted at any time. What they do not have yet, or have of
another state of a journal, or damaged, is read from the journal, which takes longer and gives the
same rows.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from burg_drake.core.grasps import PREFIXES
from burg_drake.evaluation.records import JOURNAL_FILE, read_journal
from burg_drake.evaluation.store.part_file import (
    CANDIDATE,
    Part,
    arrow_table,
    column_names,
    empty_column,
    open_part,
    read_part,
    require_arrow,
)
from burg_drake.evaluation.store.part_segments import JournalSegment, chain, whole_lines
from burg_drake.evaluation.store.run_folder import Run, load_run
from burg_drake.evaluation.store.stored_rows import StoredRows

PARTS_FOLDER = "parts"


@dataclass(frozen=True)
class StoredRun:
    """A run whose rows are wanted.

    Attributes:
        scene: name by which parts know it; empty where the run is alone.
        folder: of the run.
    """

    scene: str
    folder: Path

    @property
    def journal(self) -> Path:
        """Its journal."""
        return self.folder / JOURNAL_FILE


@dataclass(eq=False)
class PartIndex:
    """The parts of a folder and what they are made of.

    Attributes:
        parts: those that are whole, by their numbers.
        damaged: files that are not.
    """

    parts: list[Part] = field(default_factory=list)
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

    def drop(self, part: Part) -> None:
        """Takes out a part that is damaged."""
        self.parts = [other for other in self.parts if other is not part]
        self.damaged.append(part.path)

    def segments(self) -> dict[str, list[tuple[JournalSegment, Part, int]]]:
        """By scene: segments, the parts that they are in, and where their rows begin there."""
        found: dict[str, list[tuple[JournalSegment, Part, int]]] = defaultdict(list)
        for part in self.parts:
            row = 0
            for segment in part.segments:
                found[segment.scene].append((segment, part, row))
                row += segment.rows
        return found


def read_rows(
    folder: Path,
    places: Sequence[StoredRun],
    names: Sequence[str] | None,
    instances: Sequence[str] = (),
) -> StoredRows:
    """Columns of the judged grasps of runs.

    Args:
        folder: that has the parts.
        places: the runs, in the order of their rows.
        names: of the columns; all if None. What a run does not have is null.
        instances: names of the free objects of all runs, for which all have columns.

    Raises:
        MissingDependencyError: pyarrow is not installed.
        BurgError: a run cannot be read.
    """
    index = PartIndex.of(folder)
    while True:
        found = _read(index, places, names, instances)
        if isinstance(found, StoredRows):
            return found
        index.drop(found)


def segment_table(run: Run, begin: int, end: int) -> Any:
    """The rows of a stretch of a run's journal, in the order of the candidates."""
    verdicts = read_journal(run.path / JOURNAL_FILE, begin, end)
    ids = run.candidates.id
    places = [place for place, id in enumerate(ids) if id in verdicts]
    part = run.with_verdicts({ids[place]: verdicts[ids[place]] for place in places})
    return arrow_table({**part.results, CANDIDATE: np.array(places, dtype=np.int64)})


def merged(tables: Sequence[Any]) -> Any:
    """Tables of one run as one: of each candidate the last row, in the order of the candidates."""
    arrow = require_arrow("a columnar table")
    table = arrow.concat_tables(tables, promote_options="permissive")
    candidate = table.column(CANDIDATE).to_numpy()
    order = np.lexsort((np.arange(len(candidate)), candidate))
    last = np.append(candidate[order][1:] != candidate[order][:-1], True)
    return table.take(order[last]) if len(order) else table


def _read(
    index: PartIndex,
    places: Sequence[StoredRun],
    names: Sequence[str] | None,
    instances: Sequence[str],
) -> StoredRows | Part:
    """The rows, or a part that is damaged."""
    arrow = require_arrow("reading the results of many grasps")
    segments = index.segments()
    pieces: list[list[tuple[Part, int, int]]] = []
    tails: list[Any | None] = []
    for place in places:
        mine = segments.get(place.scene, [])
        found = chain([segment for segment, _, _ in mine], place.journal)
        where = {segment: (part, row, segment.rows) for segment, part, row in mine}
        pieces.append([where[segment] for segment in found])
        tail = _tail(place, found[-1].end if found else 0)
        tails.append(None if tail is None else with_instances(tail, instances))
    used = {part.path: part for piece in pieces for part, _, _ in piece}
    if names is None:
        names = _all_names(list(used.values()), tails)
    wanted = [*dict.fromkeys([*names, CANDIDATE])]
    tables: dict[Path, Any] = {}
    for path, part in used.items():
        table = read_part(part, wanted)
        if table is None:
            return part
        tables[path] = table
    runs: list[Any] = []
    for piece, tail in zip(pieces, tails, strict=True):
        if tail is None and len(piece) == 1:
            runs.append(piece[0])
            continue
        slices = [tables[part.path].slice(row, rows) for part, row, rows in piece]
        if tail is not None:
            slices.append(_with_columns(tail, wanted))
        runs.append(merged(slices) if len(slices) > 1 else slices[0] if slices else None)
    counts = np.array([_size(run) for run in runs], dtype=np.int64)
    there = [table for table in _joined(runs, tables) if table.num_rows]
    empty = arrow.table({name: empty_column(name, 0) for name in wanted})
    whole = arrow.concat_tables(there, promote_options="permissive") if there else empty
    return StoredRows(whole.select(list(names)), counts)


def _size(run: Any) -> int:
    """Rows of a run: of a piece of a part, of a table, or none."""
    return 0 if run is None else run[2] if isinstance(run, tuple) else run.num_rows


def _joined(runs: Sequence[Any], tables: Mapping[Path, Any]) -> Iterator[Any]:
    """Tables of runs one after the other; pieces that follow on each other in a part as one."""
    k = 0
    while k < len(runs):
        if isinstance(runs[k], tuple):
            part, begin, rows = runs[k]
            while (
                k + 1 < len(runs)
                and runs[k + 1] is not None
                and isinstance(runs[k + 1], tuple)
                and runs[k + 1][:2] == (part, begin + rows)
            ):
                k, rows = k + 1, rows + runs[k + 1][2]
            yield tables[part.path].slice(begin, rows)
        elif runs[k] is not None:
            yield runs[k]
        k += 1


def _tail(place: StoredRun, begin: int) -> Any | None:
    """Rows of what a journal has beyond its parts; None if it has nothing."""
    end = whole_lines(place.journal)
    return segment_table(load_run(place.folder), begin, end) if end > begin else None


def _with_columns(table: Any, names: Sequence[str]) -> Any:
    for name in names:
        if name not in table.column_names:
            table = table.append_column(name, empty_column(name, table.num_rows))
    return table.select(list(names))


def _all_names(parts: Sequence[Part], tails: Sequence[Any | None]) -> list[str]:
    """Names of all columns, in the order of the tables."""
    names: dict[str, None] = {}
    for part in parts:
        names |= dict.fromkeys(column_names(part))
    for tail in tails:
        names |= dict.fromkeys([] if tail is None else tail.column_names)
    names.pop(CANDIDATE, None)
    return list(names)


def with_instances(table: Any, instances: Sequence[str]) -> Any:
    """A table with columns for all instances, each kind where its first one is."""
    if not instances:
        return table
    arrow = require_arrow("a columnar table")
    columns: dict[str, Any] = {}
    for name in table.column_names:
        for prefix in PREFIXES.values():
            if name.startswith(prefix) and name.removeprefix(prefix) in instances:
                for instance in instances:
                    columns.setdefault(prefix + instance, None)
        columns[name] = table.column(name)
    rows = table.num_rows
    return arrow.table({n: empty_column(n, rows) if c is None else c for n, c in columns.items()})
