"""Journal and documents of the run that several runs of the same grasps are merged into."""

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
    JOURNAL_FILE,
    JUDGED,
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
    """Which journal has the verdict that is taken for each of N grasps.

    Attributes:
        index: of the verdicts that are taken.
        source: (N,) which journal each is in.
    """

    index: JournalIndex
    source: NDArray[np.int32]


def choose_verdicts(
    journals: Sequence[Path], candidates: Candidates, chosen: NDArray[np.int64]
) -> JournalChoice:
    """Chooses a verdict for each grasp: one of a trial goes before one that failed, and that before
    one whose worker was ended from outside; of equal ones the first is taken.

    Args:
        journals: of the runs; in each the last verdict about a grasp counts.
        candidates: their grasps.
        chosen: (N,) rows of those that are merged.

    Raises:
        InvalidInputError: two runs have judged a grasp and disagree, other than in time.
    """
    taken: JournalIndex | None = None
    source = np.zeros(len(chosen), np.int32)
    for number, journal in enumerate(journals):
        own = index_journal(journal, len(candidates), candidates.rows).select(chosen)
        if taken is None:
            taken = own
            continue
        both = (own.rank == JUDGED) & (taken.rank == JUDGED)
        for known in np.unique(source[both]).tolist():
            rows = np.flatnonzero(both & (source == known))
            ids = [candidates.id[row] for row in chosen[rows].tolist()]
            there = (journals[known], taken.place[rows].tolist())
            _require_same_verdicts(ids, there, (journal, own.place[rows].tolist()))
        better = own.rank > taken.rank
        source[better] = number
        taken.replace_rows(better, own)
    assert taken is not None
    return JournalChoice(taken, source)


def chosen_lines(journals: Sequence[Path], choice: JournalChoice) -> Iterator[bytes]:
    """The lines that were chosen, in the order of the grasps."""
    with ExitStack() as stack:
        streams = [stack.enter_context(open_regular(j)) if j.exists() else None for j in journals]
        for k in np.flatnonzero(choice.index.judged).tolist():
            stream = streams[choice.source[k]]
            assert stream is not None
            stream.seek(int(choice.index.place[k]))
            yield stream.readline(MAX_JOURNAL_LINE)


def _require_same_verdicts(
    ids: Sequence[str], first: tuple[Path, list[int]], second: tuple[Path, list[int]]
) -> None:
    """Refuses lines of two journals that say other things about a grasp, but for the time.

    Args:
        ids: (N,) of the grasps.
        first, second: journals, and where the N lines begin in each.

    Raises:
        InvalidInputError: names the first such grasp, and how it ended.
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
    """Writes a merged run, but for what is made from its journal.

    Args:
        runs: of one scene.
        staging: an empty folder to write it to.
        folder: where it is to be, which references have to fit.
        shard: that the merged run is; what all of them are if None.

    Returns:
        Which verdicts were taken.

    Raises:
        InvalidInputError: the runs are not of the same, or disagree.
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
        InvalidInputError: names every difference.
    """
    if differences:
        raise InvalidInputError(
            f"{first.path} and {other.path} are different runs ({'; '.join(differences)});"
            " only shards or copies of the same run can be merged"
        )


def merge_documents(documents: Sequence[OneRunDocument], shard: str) -> OneRunDocument:
    """The first document with all sessions, by their beginning, and the first hints of any."""
    sessions = dict.fromkeys(session for one in documents for session in one.stretches)
    return replace(
        documents[0],
        shard=shard,
        stretches=tuple(sorted(sessions, key=lambda session: session.started)),
        hints=next((one.hints for one in documents if one.hints), ()),
    )


def copy_documents(run: Run, staging: Path, folder: Path) -> None:
    """Copies scene and station of a run, with references that hold in another folder."""
    for name in (SCENE_FILE, STATION_FILE):
        shutil.copyfile(run.path / name, staging / name)
    scene = load_document(run.path / SCENE_FILE, SceneDocument)
    if not scene.library.startswith(PACKAGE_URI):
        with suppress(BurgError):  # it is gone: the run's document knows where it was
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
    """The shard that all of them are; empty if they are several, or none."""
    shards = {run.document.shard for run in runs}
    return shards.pop() if len(shards) == 1 else ""


def missing_shards(runs: Sequence[Run | Campaign]) -> tuple[str, ...]:
    """Shards of the same number that are not among runs; none if one of them is of everything."""
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
