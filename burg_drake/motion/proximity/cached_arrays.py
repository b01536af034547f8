"""Balls and distances of a robot as arrays, as they go into the cache and come out of it."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pydrake.multibody.tree import BodyIndex

from burg_drake.core import Arrays
from burg_drake.motion.proximity.ball_tree import BallTrees, BodyBalls
from burg_drake.motion.proximity.cover import Balls
from burg_drake.motion.proximity.pair_table import JointGrid, PairTable
from burg_drake.motion.proximity.self_clearance import ClearanceTable, Pair, SelfClearance


def to_arrays(trees: BallTrees, itself: SelfClearance) -> Arrays:
    """All that `from_arrays` needs but for the numbers that the bodies have in a diagram."""
    bodies = trees.bodies
    balls = Balls.joined([body.balls for body in bodies])
    arrays: dict[str, NDArray[Any]] = {
        "body_frame": np.array([body.frame for body in bodies]),
        "body_center": np.array([body.center for body in bodies]),
        "body_radius": np.array([body.radius for body in bodies]),
        "body_root": np.array([body.root for body in bodies]),
        "body_end": np.cumsum([len(body.balls.outer) for body in bodies]),
        "ball_center": balls.center,
        "ball_outer": balls.outer,
        "ball_inner": balls.inner,
        "node_frame": trees.frame,
        "node_centers": trees.centers,
        "node_outer": trees.outer,
        "node_inner": trees.inner,
        "node_child": trees.child,
        "pairs": _numbers(itself.pairs),
        "apart": _numbers(itself.apart),
    }
    for k, (table, pairs) in enumerate(itself.tables):
        grid = table.grid
        arrays |= {
            f"table{k}_pairs": _numbers(pairs),
            f"table{k}_joints": np.array(grid.joints, dtype=np.intp),
            f"table{k}_low": grid.low,
            f"table{k}_step": grid.step,
            f"table{k}_count": grid.count,
            f"table{k}_whole": np.array(grid.whole, dtype=bool),
            f"table{k}_lever": grid.lever,
            f"table{k}_lower": table.lower,
            f"table{k}_upper": table.upper,
        }
    return arrays


def from_arrays(arrays: Arrays) -> tuple[BallTrees, SelfClearance]:
    """The same again; the bodies are numbered from 0."""
    ends = arrays["body_end"].tolist()
    bodies = tuple(
        BodyBalls(
            BodyIndex(k),
            int(arrays["body_frame"][k]),
            arrays["body_center"][k],
            float(arrays["body_radius"][k]),
            Balls(*(arrays[f"ball_{name}"][first:end] for name in ("center", "outer", "inner"))),
            int(arrays["body_root"][k]),
        )
        for k, (first, end) in enumerate(zip([0, *ends], ends, strict=False))
    )
    nodes = (arrays[f"node_{name}"] for name in ("frame", "centers", "outer", "inner", "child"))
    trees = BallTrees(bodies, *nodes)
    count = sum(name.endswith("_joints") for name in arrays)
    tables = [_table(arrays, f"table{k}_") for k in range(count)]
    return trees, SelfClearance(trees, _pairs(arrays["pairs"]), tables, _pairs(arrays["apart"]))


def _table(arrays: Arrays, prefix: str) -> ClearanceTable:
    grid = JointGrid(
        tuple(arrays[f"{prefix}joints"].tolist()),
        arrays[f"{prefix}low"],
        arrays[f"{prefix}step"],
        arrays[f"{prefix}count"],
        tuple(arrays[f"{prefix}whole"].tolist()),
        arrays[f"{prefix}lever"],
    )
    table = PairTable(grid, arrays[f"{prefix}lower"], arrays[f"{prefix}upper"])
    return table, _pairs(arrays[f"{prefix}pairs"])


def _numbers(pairs: Sequence[Pair]) -> NDArray[np.intp]:
    return np.array(pairs, dtype=np.intp).reshape(-1, 2)


def _pairs(numbers: NDArray[Any]) -> tuple[Pair, ...]:
    return tuple((int(i), int(j)) for i, j in numbers.tolist())
