"""Merges runs of one scene: chooses verdicts, and writes the merged journal and documents."""

from __future__ import annotations

import os
import shutil
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, suppress
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from burg_drake.core import (
    PACKAGE_URI,
    BurgError,
    InvalidInputError,
    Verdict,
    load_document,
    open_regular,
    portable_reference,
    resolve_reference,
    save_document,
)
from burg_drake.evaluation.campaign_folder import Campaign
from burg_drake.evaluation.candidates import Candidates, share_rows
from burg_drake.evaluation.journal import (
    COMPLETED_RANK,
    JOURNAL_FILE,
    MAX_JOURNAL_LINE,
    JournalIndex,
    encode_verdict,
    index_journal,
    read_verdicts,
)
from burg_drake.evaluation.run_document import OneRunDocument
from burg_drake.evaluation.run_folder import (
    GRASPS_FILE,
    SCENE_FILE,
    STATION_FILE,
    Run,
    portable_station,
    save_run,
)
from burg_drake.evaluation.run_identity import grasp_differences, run_differences
from burg_drake.evaluation.settings import Shard
from burg_drake.scene import SceneDocument, save_scene
from burg_drake.station import StationDocument


@dataclass(frozen=True, eq=False)
class JournalChoice:
    """Choice of a verdict for each of N grasps from several journals.

    Attributes:
        index: index of the chosen verdicts.
        source: (N,) number of the journal that has each chosen verdict.
    """

    index: JournalIndex
    source: NDArray[np.int32]


def choose_verdicts(
    journals: Sequence[Path], candidates: Candidates, chosen: NDArray[np.int64]
) -> JournalChoice:
    """Chooses for each grasp the first verdict with the highest `JournalIndex.rank`.

    Args:
        journals: journals of the runs; in each the last verdict on a grasp counts.
        candidates: grasps of the runs.
        chosen: (N,) rows of the grasps that are merged.

    Raises:
        InvalidInputError: two runs have different verdicts on a grasp, other than in CPU time.
    """
    best: JournalIndex | None = None
    source = np.zeros(len(chosen), np.int32)
    for number, journal in enumerate(journals):
        index = index_journal(journal, len(candidates), candidates.rows).select(chosen)
        if best is None:
            best = index
            continue
        both = (index.rank == COMPLETED_RANK) & (best.rank == COMPLETED_RANK)
        for known in np.unique(source[both]).tolist():
            rows = np.flatnonzero(both & (source == known))
            ids = [candidates.id[row] for row in chosen[rows].tolist()]
            first = (journals[known], best.line_begin[rows].tolist())
            _require_same_verdicts(ids, first, (journal, index.line_begin[rows].tolist()))
        better = index.rank > best.rank
        source[better] = number
        best.replace_rows(better, index)
    assert best is not None
    return JournalChoice(best, source)


def chosen_lines(journals: Sequence[Path], choice: JournalChoice) -> Iterator[bytes]:
    """Reads the journal lines of the chosen verdicts, in the order of the grasps."""
    with ExitStack() as stack:
        streams = [stack.enter_context(open_regular(j)) if j.exists() else None for j in journals]
        for k in np.flatnonzero(choice.index.judged).tolist():
            stream = streams[choice.source[k]]
            assert stream is not None
            stream.seek(int(choice.index.line_begin[k]))
            yield stream.readline(MAX_JOURNAL_LINE)


def _require_same_verdicts(
    ids: Sequence[str], first: tuple[Path, list[int]], second: tuple[Path, list[int]]
) -> None:
    """Refuses two journals with different verdicts on a grasp, other than in CPU time.

    Args:
        ids: (N,) ids of the grasps.
        first, second: journal, and the bytes at which its N lines begin.

    Raises:
        InvalidInputError: two verdicts differ; the message names the first such grasp.
    """
    step = 4096  # Lines that are read at a time.
    for begin in range(0, len(ids), step):
        part = slice(begin, begin + step)
        pairs = zip(*(read_verdicts(path, at[part]) for path, at in (first, second)), strict=True)
        for id, (a, b) in zip(ids[part], pairs, strict=True):
            a, b = replace(a, cpu={}), replace(b, cpu={})
            if encode_verdict(id, a) != encode_verdict(id, b):
                raise _conflict_error(id, (first[0], a), (second[0], b))


def _conflict_error(
    id: str, first: tuple[Path, Verdict], second: tuple[Path, Verdict]
) -> InvalidInputError:
    (there, a), (here, b) = first, second
    names = [name for name in vars(a) if str(vars(a)[name]) != str(vars(b)[name])]
    how = f"{a.outcome.value} in {there.parent} and {b.outcome.value} in {here.parent}"
    if "outcome" not in names:
        how += f", with other values of {', '.join(names)}"
    return InvalidInputError(
        f"grasp {id} ended as {how}; the same run gives the same verdict on every"
        " machine, so one of them was judged in another way: leave it out"
    )


def write_merged(
    runs: Sequence[Run], staging: Path, folder: Path, shard: str | None = None
) -> JournalChoice:
    """Writes journal, grasps and documents of a merged run, but not its table and report.

    Args:
        runs: runs of one scene.
        staging: empty folder to write it to.
        folder: final folder, for which references are made.
        shard: shard of the merged run; the common shard of the runs if None.

    Returns:
        The chosen verdicts.

    Raises:
        InvalidInputError: the runs have different inputs or settings, or disagree about a grasp.
    """
    first = runs[0]
    for run in runs[1:]:
        there, here = first.document, run.document
        if there.hash != here.hash:
            differences = run_differences(there, here)
            differences = differences or grasp_differences(there.grasps, here.grasps)
            require_mergeable(first, run, differences)
    shard = common_shard(runs) if shard is None else shard
    candidates = first.candidates
    journals = [run.path / JOURNAL_FILE for run in runs]
    choice = choose_verdicts(journals, candidates, share_rows(len(candidates), shard))
    shutil.copyfile(first.path / GRASPS_FILE, staging / GRASPS_FILE)
    with (staging / JOURNAL_FILE).open("wb") as stream:
        stream.writelines(chosen_lines(journals, choice))
        stream.flush()
        os.fsync(stream.fileno())
    save_run(Run(staging, merge_documents([run.document for run in runs], shard)))
    copy_documents(first, staging, folder)
    return choice


def require_mergeable(
    first: Run | Campaign, other: Run | Campaign, differences: Sequence[str]
) -> None:
    """Refuses to merge runs that differ.

    Raises:
        InvalidInputError: there are differences; the message names them all.
    """
    if differences:
        raise InvalidInputError(
            f"{first.path} and {other.path} are different runs ({'; '.join(differences)});"
            " only shards or copies of the same run can be merged"
        )


def merge_documents(documents: Sequence[OneRunDocument], shard: str) -> OneRunDocument:
    """First document with the sessions of all, sorted by start, and the first hints found."""
    sessions = dict.fromkeys(session for one in documents for session in one.stretches)
    return replace(
        documents[0],
        shard=shard,
        stretches=tuple(sorted(sessions, key=lambda session: session.started)),
        hints=next((one.hints for one in documents if one.hints), ()),
    )


def copy_documents(run: Run, staging: Path, folder: Path) -> None:
    """Copies scene and station of a run, with references that are valid in another folder."""
    for name in (SCENE_FILE, STATION_FILE):
        shutil.copyfile(run.path / name, staging / name)
    scene = load_document(run.path / SCENE_FILE, SceneDocument)
    if not scene.library.startswith(PACKAGE_URI):
        with suppress(BurgError):  # if the library is gone, run.yaml still records its path
            root = resolve_reference(scene.library, "models", run.path)
            library = portable_reference(root, folder)
            save_scene(replace(scene, library=library), staging / SCENE_FILE)
    station = load_document(run.path / STATION_FILE, StationDocument)
    arm = [station.arm.model] if station.arm else []
    references = [station.hand, *arm, *station.packages.values()]
    if not all(reference.startswith(PACKAGE_URI) for reference in references):
        with suppress(BurgError):
            save_document(portable_station(run.station(), folder), staging / STATION_FILE)


def common_shard(runs: Sequence[Run | Campaign]) -> str:
    """Common shard of all runs; empty if they differ, or are not shards."""
    shards = {run.document.shard for run in runs}
    return shards.pop() if len(shards) == 1 else ""


def missing_shards(runs: Sequence[Run | Campaign]) -> tuple[str, ...]:
    """Shards that are missing among runs; empty if a run has all grasps or the counts differ."""
    shards = [run.document.shard for run in runs]
    if not all(shards):
        return ()
    counts = {Shard.parse(shard).count for shard in shards}
    return tuple(
        f"{k}/{count}"
        for count in (counts if len(counts) == 1 else ())
        for k in range(1, count + 1)
        if f"{k}/{count}" not in shards
    )
