"""How deep a hand that moves along a straight segment gets into a body, and where."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from burg_drake.core import Array
from burg_drake.geometry import HandScreen

GRIDS = (0.02, 0.002)
"""Steps at which overlaps are looked for, the second one where the first finds none [m]."""

FINEST = 0.5e-3
"""Step to which the place of the deepest overlap is narrowed down [m]."""


def deepest_along_path(
    screen: HandScreen, X_WG: Array, names: NDArray[np.object_], u_W: Array, length: float
) -> tuple[Array, Array]:
    """The deepest overlap of each hand with the one body that is known to be in its way.

    Along the way the depth in a convex piece rises to one maximum and falls; a body of several may
    have several, of which the one about the deepest place of the grid is found.

    Args:
        screen: the hand, not swept.
        X_WG: (N, 4, 4) grasps in the world, from which the ways start.
        names: (N,) of the bodies.
        u_W: (N, 3) unit vectors along the ways.
        length: of the ways [m].

    Returns:
        Depths (N,) and their distances from the start (N,) [m]; depth 0 and NaN where the overlap
        is so short that no place of the finest grid has it.
    """
    depth, at = np.zeros(len(X_WG)), np.full(len(X_WG), np.nan)
    for step in GRIDS:
        left = np.flatnonzero(depth == 0.0)
        places = np.linspace(0.0, length, int(np.ceil(length / step)) + 1)
        s = np.broadcast_to(places, (len(left), len(places)))
        found = _depths(screen, X_WG[left], names[left], u_W[left], s)
        depth[left], at[left] = found.max(axis=1), places[found.argmax(axis=1)]
    step = GRIDS[0] / 2
    found_any = np.flatnonzero(depth > 0.0)
    while step > FINEST and len(found_any):
        i = found_any
        s = np.clip(at[i, None] + np.array((-step, step)), 0.0, length)
        found = _depths(screen, X_WG[i], names[i], u_W[i], s)
        best, row = found.argmax(axis=1), np.arange(len(i))
        better = found[row, best] > depth[i]
        depth[i] = np.where(better, found[row, best], depth[i])
        at[i] = np.where(better, s[row, best], at[i])
        step /= 2
    at[depth == 0.0] = np.nan
    return depth, at


def _depths(
    screen: HandScreen, X_WG: Array, names: NDArray[np.object_], u_W: Array, s: Array
) -> Array:
    """Depths (N, S) in the named bodies (N,) at distances (N, S) along the ways [m]."""
    X = np.repeat(X_WG[:, None], s.shape[1], axis=1)
    X[..., :3, 3] += s[..., None] * u_W[:, None]
    depth = np.zeros(s.shape)
    for name in np.unique(names):
        rows = np.flatnonzero(names == name)
        _, found = screen.deepest(X[rows].reshape(-1, 4, 4), [str(name)])
        depth[rows] = found.reshape(len(rows), -1)
    return depth
