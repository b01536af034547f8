"""What grasps are of: only grasps of the same object, and on the same instance of it, compare.

Instances count where a set has the column `instance`, and between two sets where both have it.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from burg_drake.core import Indices
from burg_drake.core.grasps import GraspSet

INSTANCE = "instance"


def by_target(grasps: GraspSet) -> list[Indices]:
    """Indices of the grasps of each object and instance, rising, by object and instance."""
    return [rows for rows, _ in by_shared_target(grasps, grasps)]


def by_shared_target(grasps: GraspSet, others: GraspSet) -> Iterator[tuple[Indices, Indices]]:
    """Indices of the grasps of both sets for each object and instance that both have."""
    instances = INSTANCE in grasps.columns and INSTANCE in others.columns
    keys = [_keys(grasps, instances), _keys(others, instances)]
    _, labels = np.unique(np.concatenate(keys), return_inverse=True)
    mine, theirs = (_by_label(part) for part in np.split(labels, [len(grasps)]))
    for label in sorted(mine.keys() & theirs.keys()):
        yield mine[label], theirs[label]


def _keys(grasps: GraspSet, instances: bool) -> NDArray[np.str_]:
    if not instances:
        return grasps.object
    pairs = zip(grasps.object, grasps.columns[INSTANCE], strict=True)
    return np.array([f"{object}\n{instance}" for object, instance in pairs], dtype=np.str_)


def _by_label(labels: Indices) -> dict[int, Indices]:
    if not len(labels):
        return {}
    order = np.argsort(labels, kind="stable")
    unique, start = np.unique(labels[order], return_index=True)
    return dict(zip(unique.tolist(), np.split(order, start[1:]), strict=True))
