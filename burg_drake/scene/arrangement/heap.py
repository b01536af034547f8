"""Where objects start that are to be dropped on a heap.

In random orientations, one after the other, each is let down above a spot until its hull is almost
in contact with those below. They start low and apart, whatever the number, and physics does the
rest.
"""

from __future__ import annotations

import numpy as np

from burg_drake.core import Array, make_pose, rot_z, rotation_from_quaternion
from burg_drake.scene.arrangement.object_shapes import ObjectShape
from burg_drake.scene.arrangement.occupancy import OccupiedBoard, free_distance

START_GAP = 0.004
"""Between the hulls of what is dropped, and below the lowest [m]."""
DRAWS = 6
"""Places of which the lowest is taken."""
LOW_DRAWS = 30
"""Places and stable poses of which the lowest is taken, of what is dropped once more."""
MARGIN = 0.012
"""From the board's edge, of what is dropped once more [m]."""
LAYERS = 3.0
"""So many times the spot's area would the objects cover, if they lay as balls do that have their
size."""


class Heap:
    """A spot of a board, and what hangs above it."""

    def __init__(self, occupied: OccupiedBoard, shapes: list[ObjectShape]) -> None:
        """Args:
        occupied: the board, and what stands there.
        shapes: of all objects that are to come.
        """
        self._size = occupied.size
        self._below = [*occupied.obstacles]
        for one in occupied.standing:
            self._below.append(one.shape.hull.moved(one.X_SO))
        covered = sum(np.pi * np.ptp(s.corners, axis=0).mean() ** 2 / 4.0 for s in shapes)
        self._radius = np.sqrt(covered / np.pi / LAYERS)

    def place_above(self, shape: ObjectShape, rng: np.random.Generator) -> Array | None:
        """Hangs an object above the spot, in a random orientation, as low as it goes.

        Returns:
            Its pose (4, 4) in S; None if at none of the places it is within the board.
        """
        wxyz = rng.normal(size=4)
        R_SO = rotation_from_quaternion(wxyz / np.linalg.norm(wxyz))
        corners = shape.corners @ R_SO.T
        lower, upper = corners.min(axis=0), corners.max(axis=0)
        middle = (lower + upper)[:2] / 2.0
        best: Array | None = None
        for _ in range(DRAWS):
            radius, angle = self._radius * np.sqrt(rng.uniform()), rng.uniform(0.0, 2.0 * np.pi)
            xy = self._size / 2.0 + radius * np.array([np.cos(angle), np.sin(angle)]) - middle
            if (xy + lower[:2] < 0.0).any() or (xy + upper[:2] > self._size).any():
                continue
            X_SO = self._lowered(shape, R_SO, xy, float(lower[2]))
            if best is None or X_SO[2, 3] < best[2, 3]:
                best = X_SO
        if best is not None:
            self._below.append(shape.hull.moved(best))
        return best

    def add(self, shape: ObjectShape, X_SO: Array) -> None:
        """An object is there, at a pose (4, 4) in S."""
        self._below.append(shape.hull.moved(X_SO))

    def place_low(self, shape: ObjectShape, rng: np.random.Generator) -> Array | None:
        """Hangs an object where its centre of mass gets lowest, anywhere on the board, in one of
        its stable poses: so it finds what room there is beside a heap.

        Returns:
            Its pose (4, 4) in S; None if it is larger than the board.
        """
        entry, best, lowest = shape.library.entry(shape.name), None, np.inf
        for _ in range(LOW_DRAWS):
            pose = int(rng.integers(len(entry.stable_poses)))
            R_SO = rot_z(rng.uniform(0.0, 2.0 * np.pi)) @ entry.X_SO(pose)[:3, :3]
            corners = shape.corners @ R_SO.T
            lower, upper = corners.min(axis=0), corners.max(axis=0)
            least, most = MARGIN - lower[:2], self._size - MARGIN - upper[:2]
            if (least > most).any():
                continue
            X_SO = self._lowered(shape, R_SO, rng.uniform(least, most), float(lower[2]))
            height = float((X_SO @ (*entry.mass_properties.center_of_mass, 1.0))[2])
            if height < lowest:
                best, lowest = X_SO, height
        if best is not None:
            self.add(shape, best)
        return best

    def _lowered(self, shape: ObjectShape, R_SO: Array, xy: Array, lowest: float) -> Array:
        """The pose of an object that is let down on what is below."""
        top = max((float(body.points[..., 2].max()) for body in self._below), default=0.0)
        start = max(top, 0.0) + START_GAP - lowest
        X_SO = make_pose(R_SO, (*xy, start))
        distance = free_distance(
            shape.hull.moved(X_SO), self._below, np.array([0.0, 0.0, -1.0]), start + lowest
        )
        X_SO[2, 3] -= max(0.0, distance - START_GAP)
        return X_SO
