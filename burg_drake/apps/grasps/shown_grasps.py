"""Which grasps `burg-drake grasps show` draws: the options, and the choice."""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING

from burg_drake.apps.options import Parser, add_only, positive_int
from burg_drake.core import InvalidInputError, nearest
from burg_drake.core.grasps import Outcome

if TYPE_CHECKING:
    from burg_drake.core.grasps import GraspSet
    from burg_drake.evaluation.results import RankedGrasps

DEFAULT_MOST = 20


def add_choice(show: Parser) -> None:
    """Adds the options."""
    add_only(show, "grasps")
    show.add_argument(
        "--outcome",
        metavar="A,B",
        type=_outcomes,
        help="only grasps with these outcomes, such as lifted,slipped,no_ik",
    )
    count = show.add_mutually_exclusive_group()
    count.add_argument(
        "--most",
        metavar="N",
        type=positive_int,
        default=DEFAULT_MOST,
        help="show the best N grasps of each object (default: %(default)s)",
    )
    count.add_argument("--all", action="store_true", help="show all grasps")
    show.add_argument("--select", metavar="ID", help="show the gripper at this grasp first")


def choose(
    grasps: GraspSet, ranking: RankedGrasps, column: str | None, arguments: argparse.Namespace
) -> tuple[list[int], int | None, str]:
    """Indices of the grasps to be drawn, which of these has the gripper, and what people are told
    about the choice. Of each object those with the highest number in `column` come first; where it
    has no numbers, the best."""
    import numpy as np

    from burg_drake.evaluation.candidates import are_of
    from burg_drake.evaluation.results import best_of_each, index_of

    instances = grasps.columns.get("instance")
    keep = are_of(arguments.only, arguments.file, grasps.object, instances)
    if arguments.outcome is not None:
        keep &= np.isin(grasps.column("outcome"), [o.value for o in arguments.outcome])
    if not keep.any():
        raise InvalidInputError(f"{arguments.file} has no such grasps; choose other outcomes")
    most = None if arguments.all else arguments.most
    holder = np.array(holders(grasps))
    chosen = best_of_each(holder, keep, ranking, most)
    caption = f"{len(chosen):,} of {len(grasps):,} grasps shown"
    if len(chosen) < keep.sum():
        by = ranking.by
        how = f"the best {most} of each object by {by}" if by else f"{most} of each object, evenly"
        caption += f": {how}; --most N or --all shows more"
    index = None
    if arguments.select is not None:
        index = index_of(grasps, arguments.select, arguments.file)
        if index not in chosen:
            same = [k for k, other in enumerate(chosen) if holder[other] == holder[index]]
            chosen.insert(same[-1] + 1 if same else len(chosen), index)
    values = None if column is None else grasps.column(column)
    if values is not None and values.dtype.kind in "fiu":
        objects = list(dict.fromkeys(holder[chosen].tolist()))
        chosen.sort(key=lambda k: (objects.index(holder[k]), *_highest_first(float(values[k]))))
    return chosen, None if index is None else chosen.index(index), caption


def _highest_first(value: float) -> tuple[bool, float]:
    """Sorts numbers down, NaN last."""
    return value != value, 0.0 if value != value else -value


def holders(grasps: GraspSet) -> list[str]:
    """The instance of each grasp, or without a scene the object."""
    return list(grasps.column("instance" if "instance" in grasps.columns else "object").tolist())


def _outcomes(text: str) -> set[Outcome]:
    names = [name.strip() for name in text.split(",") if name.strip()]
    known = [outcome.value for outcome in Outcome]
    unknown = [name for name in names if name not in known]
    if unknown or not names:
        given = unknown[0] if unknown else text
        raise argparse.ArgumentTypeError(f"{given!r} is not an outcome; {nearest(given, known)}")
    return {Outcome(name) for name in names}
