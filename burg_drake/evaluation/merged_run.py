"""Journal and documents of the run that several runs of the same grasps are merged into."""

from __future__ import annotations

import hashlib
import os
import shutil
from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from burg_drake.core import (
    PACKAGE_URI,
    BurgError,
    InvalidInputError,
    Outcome,
    Verdict,
    load_document,
    open_regular,
    portable_reference,
    resolve_reference,
    save_document,
)
from burg_drake.evaluation.campaign_folder import Campaign
from burg_drake.evaluation.journal import (
    JOURNAL_FILE,
    MAX_JOURNAL_LINE,
    encode_verdict,
    journal_lines,
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
from burg_drake.evaluation.settings import Shard, select_share
from burg_drake.scene import SceneDocument, save_scene
from burg_drake.station import StationDocument


class VerdictRank:
    """Ranks of verdicts, of which the highest is taken; 0 stands for none."""

    interrupted = 1  # The worker was ended from outside.
    failed = 2  # The trial failed.
    judged = 3  # The trial came to an end.


@dataclass(frozen=True, eq=False)
class JournalChoice:
    """Which line of which journal is taken for each of N grasps.

    Attributes:
        worth: (N,) of its verdict; 0 where there is none.
        source: (N,) which journal.
        place: (N,) where its line begins there.
    """

    worth: NDArray[np.int8]
    source: NDArray[np.int32]
    place: NDArray[np.int64]

    @property
    def missing(self) -> int:
        """Grasps without a verdict."""
        return int((self.worth == 0).sum())

    @property
    def failed(self) -> int:
        """Grasps that could not be simulated."""
        return int(np.isin(self.worth, (VerdictRank.failed, VerdictRank.interrupted)).sum())

    @property
    def interrupted(self) -> int:
        """Those of them whose worker was ended from outside."""
        return int((self.worth == VerdictRank.interrupted).sum())


def choose_verdicts(journals: Sequence[Path], ids: Sequence[str]) -> JournalChoice:
    """Chooses a verdict for each grasp: of equal ones the first.

    Args:
        journals: of the runs; in each the last verdict about a grasp counts.
        ids: (N,) of the grasps.

    Raises:
        InvalidInputError: two runs have judged a grasp and disagree, other than in time.
    """
    places = {id: place for place, id in enumerate(ids)}
    chosen = JournalChoice(
        np.zeros(len(ids), np.int8), np.zeros(len(ids), np.int32), np.zeros(len(ids), np.int64)
    )
    digest = np.zeros(len(ids), np.uint64)
    for source, journal in enumerate(journals):
        own = JournalChoice(np.zeros_like(chosen.worth), chosen.source, np.zeros_like(chosen.place))
        seen = np.zeros_like(digest)
        for line, id, verdict in journal_lines(journal):
            if (k := places.get(id)) is not None:
                own.worth[k], own.place[k] = _verdict_rank(verdict), line
                seen[k] = _verdict_digest(verdict)
        both = np.minimum(own.worth, chosen.worth) == VerdictRank.judged
        for k in np.flatnonzero(both & (seen != digest))[:1].tolist():
            first = (journals[chosen.source[k]], int(chosen.place[k]))
            raise _conflict_error(ids[k], first, (journal, int(own.place[k])))
        better = own.worth > chosen.worth
        chosen.worth[better] = own.worth[better]
        chosen.place[better] = own.place[better]
        chosen.source[better] = source
        digest[better] = seen[better]
    return chosen


def chosen_lines(journals: Sequence[Path], choice: JournalChoice) -> Iterator[bytes]:
    """The lines that were chosen, in the order of the grasps."""
    streams = [open_regular(journal) if journal.exists() else None for journal in journals]
    try:
        for k in np.flatnonzero(choice.worth).tolist():
            stream = streams[choice.source[k]]
            assert stream is not None
            stream.seek(int(choice.place[k]))
            yield stream.readline(MAX_JOURNAL_LINE)
    finally:
        for stream in streams:
            if stream is not None:
                stream.close()


def _verdict_rank(verdict: Verdict) -> int:
    if verdict.outcome is not Outcome.SIMULATION_FAILED:
        return VerdictRank.judged
    return VerdictRank.interrupted if verdict.interrupted else VerdictRank.failed


def _verdict_digest(verdict: Verdict) -> int:
    """Of all but the time."""
    data = encode_verdict("", replace(verdict, cpu={}))
    return int.from_bytes(hashlib.blake2b(data, digest_size=8).digest(), "little")


def _conflict_error(
    id: str, first: tuple[Path, int], second: tuple[Path, int]
) -> InvalidInputError:
    a, b = (next(journal_lines(journal, place))[2] for journal, place in (first, second))
    there, here = (vars(replace(verdict, cpu={})) for verdict in (a, b))
    names = [name for name in there if str(there[name]) != str(here[name])]
    how = f"{a.outcome.value} in {first[0].parent} and {b.outcome.value} in {second[0].parent}"
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
    ids = select_share(first.candidates.id, shard)
    journals = [run.path / JOURNAL_FILE for run in runs]
    choice = choose_verdicts(journals, ids)
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
