"""Merges the journals of runs of the same grasps, a line at a time."""

from __future__ import annotations

import hashlib
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from burg_drake.core import InvalidInputError
from burg_drake.core.files import open_regular
from burg_drake.core.grasps import Outcome, Verdict
from burg_drake.evaluation.records import LONGEST_LINE, encode, journal_lines

INTERRUPTED, FAILED, JUDGED = 1, 2, 3
"""How much a verdict is worth: one whose worker was ended from outside gives way to one about a
failure, and this to one of a trial that came to an end."""


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
        return int(((self.worth == FAILED) | (self.worth == INTERRUPTED)).sum())

    @property
    def interrupted(self) -> int:
        """Those of them whose worker was ended from outside."""
        return int((self.worth == INTERRUPTED).sum())


def choose(journals: Sequence[Path], ids: Sequence[str]) -> JournalChoice:
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
                own.worth[k], own.place[k], seen[k] = _worth(verdict), line, _digest(verdict)
        both = (own.worth == JUDGED) & (chosen.worth == JUDGED) & (seen != digest)
        if both.any():
            k = int(np.flatnonzero(both)[0])
            first = (journals[chosen.source[k]], int(chosen.place[k]))
            raise _conflict(ids[k], first, (journal, int(own.place[k])))
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
            yield stream.readline(LONGEST_LINE)
    finally:
        for stream in streams:
            if stream is not None:
                stream.close()


def _worth(verdict: Verdict) -> int:
    if verdict.outcome is not Outcome.SIMULATION_FAILED:
        return JUDGED
    return INTERRUPTED if verdict.interrupted else FAILED


def _digest(verdict: Verdict) -> int:
    """Of all but the time."""
    data = encode("", replace(verdict, cpu={}))
    return int.from_bytes(hashlib.blake2b(data, digest_size=8).digest(), "little")


def _conflict(id: str, first: tuple[Path, int], second: tuple[Path, int]) -> InvalidInputError:
    texts = []
    values = []
    for journal, place in (first, second):
        _, _, verdict = next(journal_lines(journal, place))
        values.append(vars(replace(verdict, cpu={})))
        texts.append(f"{verdict.outcome.value} in {journal.parent}")
    names = [name for name in values[0] if str(values[0][name]) != str(values[1][name])]
    how = texts[0] + " and " + texts[1]
    if "outcome" not in names:
        how += f", with other values of {', '.join(names)}"
    return InvalidInputError(
        f"grasp {id} ended as {how}; the same run gives the same verdict on every"
        " machine, so one of them was judged in another way: leave it out"
    )
