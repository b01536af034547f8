"""Which grasps of each object are worth looking at first."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from burg_drake.core import UnknownNameError, nearest
from burg_drake.core.grasps import GraspSet, Outcome
from burg_drake.evaluation.store import Run
from burg_drake.visualization.style import GROUPS, group_of


@dataclass(frozen=True, eq=False)
class RankedGrasps:
    """Grasps, best first.

    Attributes:
        order: (N,) their indices.
        by: what they are ranked by, for people; empty if nothing tells them apart.
    """

    order: NDArray[np.int64]
    by: str


def ranked_run(run: Run, grasps: GraspSet) -> RankedGrasps:
    """Those of a run: lifted ones as `Run.best` has them, then by the groups of their outcomes, as
    legends list them: held ones before lost ones, and those before what was not executed.

    Args:
        run: the run.
        grasps: of the run, as a set.
    """
    row = {id: i for i, id in enumerate(run.candidates.id)}
    best = [row[id] for id in run.best(len(row))]
    outcomes = grasps.column("outcome").tolist()
    groups = [group_of(Outcome(text) if text else None) for text in outcomes]
    places = [GROUPS.index(group) if group in GROUPS else len(GROUPS) for group in groups]
    rest = np.argsort(places, kind="stable")
    order = np.concatenate([np.array(best, dtype=np.int64), rest[~np.isin(rest, best)]])
    return RankedGrasps(order, "outcome, lifted ones by the room around the hand")


def ranked_set(grasps: GraspSet) -> RankedGrasps:
    """Those of a set, by score; unknown scores last."""
    if not np.isfinite(grasps.score).any():
        return RankedGrasps(np.arange(len(grasps)), "")
    order = np.argsort(-np.where(np.isfinite(grasps.score), grasps.score, -np.inf), kind="stable")
    quality = grasps.provenance.get("quality")
    by = quality.get("by") if isinstance(quality, dict) else None
    return RankedGrasps(order, f"score ({by})" if by else "score")


def best_of_each(
    holder: NDArray[np.str_], among: NDArray[np.bool_], ranking: RankedGrasps, most: int | None
) -> list[int]:
    """The best grasps of each object, best first; taken evenly where nothing tells them apart.

    Args:
        holder: (N,) object or instance of each grasp.
        among: (N,) which grasps there are to choose from.
        ranking: of all N.
        most: of each object; all if None.

    Returns:
        Their indices, object by object in the order of the set.
    """
    chosen: list[int] = []
    for name in dict.fromkeys(holder[among].tolist()):
        members = ranking.order[(among & (holder == name))[ranking.order]]
        count = len(members) if most is None else min(len(members), most)
        places = range(count) if ranking.by else (k * len(members) // count for k in range(count))
        chosen += [int(members[k]) for k in places]
    return chosen


def index_of(grasps: GraspSet, id: str, where: str) -> int:
    """The grasp of an identifier, with or without its instance in front.

    Raises:
        UnknownNameError: there is none, or one for each of several instances.
    """
    names = shown_ids(grasps)
    if id in names:
        return names.index(id)
    same = [k for k, own in enumerate(grasps.id.tolist()) if own == id]
    if len(same) == 1:
        return same[0]
    known = [names[k] for k in same] or names
    raise UnknownNameError(f"{where} has no grasp {id!r}; {nearest(id, known)}")


def shown_ids(grasps: GraspSet) -> list[str]:
    """Identifiers as tables of results have them, with the instance in front where there is one."""
    if "instance" not in grasps.columns:
        return [str(id) for id in grasps.id]
    instances = grasps.column("instance").tolist()
    return [f"{name}-{id}" for name, id in zip(instances, grasps.id.tolist(), strict=True)]
