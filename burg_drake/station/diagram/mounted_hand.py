"""Places the arm of a station diagram, and the hand on it, in a Context."""

from __future__ import annotations

from pydrake.multibody.tree import BodyIndex
from pydrake.systems.framework import Context

from burg_drake.core import Array, InvalidInputError
from burg_drake.station.diagram.hand_handle import HandHandle
from burg_drake.station.diagram.station_diagram import StationDiagram


class MountedHand(HandHandle):
    """Handle on the hand of a diagram built with `robot="arm"`, and on the arm that carries it.

    Args:
        station_diagram: the diagram.

    Attributes:
        document, body, fingers, joints, pads: see `HandHandle`.
        arm: the arm's model instance; n joints in the order of the station's home posture.
        links: bodies of the arm without the hand.

    Raises:
        InvalidInputError: the diagram has no arm.
    """

    def __init__(self, station_diagram: StationDiagram) -> None:
        if station_diagram.robot != "arm":
            raise InvalidInputError(
                f"the diagram was built with robot={station_diagram.robot!r}; build it with 'arm'"
            )
        super().__init__(station_diagram)
        self.arm = self._plant.GetModelInstanceByName("arm")
        self.links: frozenset[BodyIndex] = frozenset(self._plant.GetBodyIndices(self.arm))
        self._positions = [joint.position_start() for joint in station_diagram.arm_joints]
        self._velocities = [joint.velocity_start() for joint in station_diagram.arm_joints]

    def place(self, plant_context: Context, q: Array, closed: float = 0.0) -> None:
        """Puts the arm at `q` (n,), all at rest.

        Args:
            plant_context: the plant's part of the Context.
            q: joint positions [rad].
            closed: how far the fingers are closed, from 0 (open) to 1 (pads together).
        """
        self.set_arm(plant_context, q)
        velocities = self._plant.GetVelocities(plant_context)
        velocities[self._velocities] = 0.0
        self._plant.SetVelocities(plant_context, velocities)
        self.set_fingers(plant_context, closed)

    def set_arm(self, plant_context: Context, q: Array) -> None:
        """Puts the arm at `q` (n,) [rad]; nothing else changes."""
        positions = self._plant.GetPositions(plant_context)
        positions[self._positions] = q
        self._plant.SetPositions(plant_context, positions)

    def q(self, plant_context: Context) -> Array:
        """(n,) current joint positions [rad]."""
        positions: Array = self._plant.GetPositions(plant_context)[self._positions]
        return positions
