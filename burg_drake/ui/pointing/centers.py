"""The middles of objects: what pointers and handles take hold of."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from burg_drake.compose.editing import SessionView
from burg_drake.core import Array, make_pose


def center(view: SessionView, name: str) -> Array:
    """(3,) middle of an instance's bounding box in S [m]; its origin if its object is unknown."""
    X_SO = view.X_SO(name)
    entry = view.library.objects.get(view.instances[name].object)
    if entry is None:
        return X_SO[:3, 3]
    p_OM = (np.array(entry.lower) + np.array(entry.upper)) / 2.0
    return np.asarray(X_SO[:3, :3] @ p_OM + X_SO[:3, 3])


def mean_center(view: SessionView, names: Iterable[str]) -> Array:
    """(3,) mean of the middles of one or more instances in S [m]."""
    return np.asarray(np.mean([center(view, name) for name in names], axis=0))


def motion_about(p_SM: Array, R: Array, offset: Array) -> Array:
    """(4, 4) motion in S: a rotation (3, 3) about a point (3,), then an offset (3,) [m]."""
    return make_pose(R, p_SM + offset - R @ p_SM)
