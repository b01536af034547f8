"""What the hand carries, moved from its place inside a collision checker.

Drake's checker demands exact interpolation, so objects have no joints that turn: each stands on one
vertical joint, whose position is its height. The other two directions move the frame that the joint
stands on, a parameter of the context; where nothing moves sideways it is never touched.
"""

from __future__ import annotations

from typing import cast

import numpy as np
from numpy.typing import ArrayLike
from pydrake.math import RigidTransform
from pydrake.multibody.tree import FixedOffsetFrame
from pydrake.planning import CollisionCheckerContext, RobotDiagram, SceneGraphCollisionChecker

from burg_drake.core import Array, UnknownNameError, nearest
from burg_drake.station.diagram import StationDiagram
from burg_drake.station.world import PLACE, RISE


class Carried:
    """Moves the free instances of a diagram that was built with `weld_objects=True`; there are none
    where they are free bodies."""

    def __init__(self, station_diagram: StationDiagram) -> None:
        plant = station_diagram.plant
        self._height: dict[str, int] = {}
        self._place: dict[str, FixedOffsetFrame] = {}
        for name, body in station_diagram.free.items():
            model = plant.get_body(body).model_instance()
            if plant.HasJointNamed(RISE, model):
                self._height[name] = plant.GetJointByName(RISE, model).position_start()
                self._place[name] = cast(FixedOffsetFrame, plant.GetFrameByName(PLACE, model))

    def height(self, name: str) -> int:
        """Where in the plant's positions an instance's height over its place is.

        Raises:
            UnknownNameError: there is no such instance.
        """
        if name not in self._height:
            known = tuple(self._height)
            raise UnknownNameError(
                f"{name!r} is not an instance that can be carried; {nearest(name, known)}"
            )
        return self._height[name]

    def shifted(self, checker: SceneGraphCollisionChecker) -> Shifts:
        """Shifts in a checker of the diagram, where all stand at their places."""
        return Shifts(checker, self._place)


class Shifts:
    """How far instances stand beside their places in one checker."""

    def __init__(
        self, checker: SceneGraphCollisionChecker, place: dict[str, FixedOffsetFrame]
    ) -> None:
        self._checker, self._place = checker, place
        self._moved: tuple[str, Array] | None = None

    def put(self, name: str, p_W: ArrayLike) -> None:
        """Shifts one instance, and puts all others at their places.

        Args:
            name: the instance; "" for none.
            p_W: (2,) along x and y of the world [m].
        """
        p = np.asarray(p_W, dtype=float)
        before = self._moved
        if before is not None and (before[0] != name or not np.array_equal(before[1], p)):
            self._set(before[0], np.zeros(2))
            self._moved = before = None
        if before is None and p.any():
            self._set(name, p)
            self._moved = name, p

    def _set(self, name: str, p: Array) -> None:
        place = self._place[name]
        X_WO = place.GetFixedPoseInBodyFrame()  # as the diagram was built
        moved = RigidTransform(X_WO.rotation(), X_WO.translation() + np.append(p, 0.0))

        def shift(_: RobotDiagram, context: CollisionCheckerContext) -> None:
            place.SetPoseInParentFrame(context.plant_context(), moved)

        self._checker.PerformOperationAgainstAllModelContexts(shift)
