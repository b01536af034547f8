"""What a choice of grasps lacks, in words: a line for all objects that lack the same."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from burg_drake.experiment.trials import Stratum

MOST = 20
"""Lines, and objects in a line; more than these are counted."""


@dataclass(frozen=True)
class Shortfall:
    """What an object of a run lacks.

    Attributes:
        run, object: key of the run, and name in the library.
        kind: what is lacking; objects with the same share a line.
        counts: how much there is of it, such as `3 of 5`.
        description: kind and counts together, where all objects of a line have the same; the
            kind if empty.
    """

    run: str
    object: str
    kind: str
    counts: str = ""
    description: str = ""


def shortfall(strata: Sequence[Stratum], wanted: int) -> list[Shortfall]:
    """What one object lacks that has too few grasps of a stratum, or in all; none if nothing.

    Args:
        strata: of the object.
        wanted: grasps in all.
    """
    missing = [s for s in strata if s.selected < s.wanted]
    if not missing:
        return []
    total = sum(stratum.selected for stratum in strata)
    labels = " and ".join(s.label for s in missing)
    counts = ", ".join(f"{s.selected} of {s.wanted}" for s in missing)
    description = ", ".join(f"{s.selected} of {s.wanted} with {s.label}" for s in missing)
    first = strata[0]
    if total == wanted:
        rest = "; others make up for it"
        return [
            Shortfall(
                first.run, first.object, f"too few with {labels}{rest}", counts, description + rest
            )
        ]
    kind = f"too few with {labels}, and in all"
    in_all = f"{total} of {wanted} in all"
    return [
        Shortfall(first.run, first.object, kind, f"{counts}; {in_all}", f"{description}; {in_all}")
    ]


def shortfall_notes(found: Iterable[Shortfall]) -> list[str]:
    """A line for each kind, with the objects; figures by object where they differ."""
    kinds: defaultdict[str, list[Shortfall]] = defaultdict(list)
    for one in found:
        kinds[one.kind].append(one)
    lines = [_line(kind, members) for kind, members in kinds.items()]
    more = len(lines) - MOST
    return lines if more <= 0 else [*lines[:MOST], f"and {more} more such shortfalls"]


def _line(kind: str, members: Sequence[Shortfall]) -> str:
    alike = len({one.description for one in members}) == 1
    by_run: defaultdict[str, list[str]] = defaultdict(list)
    for one in members[:MOST]:
        by_run[one.run].append(one.object if alike else f"{one.object} ({one.counts})")
    where = "; ".join(f"{', '.join(objects)} of run {run}" for run, objects in by_run.items())
    more = len(members) - MOST
    where += f" and {more} others" if more > 0 else ""
    return f"{where}: {members[0].description or kind}" if alike else f"{where}: {kind}"
