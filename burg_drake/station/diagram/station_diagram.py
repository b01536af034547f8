"""A built Drake diagram of a scene on a station, and the names to find things in it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import BodyIndex, Joint
from pydrake.planning import RobotDiagram

from burg_drake.core import Array
from burg_drake.scene.document import Scene
from burg_drake.station.document import Engine, Station
from burg_drake.station.world import ContactParts, Robot, joint_actuators

if TYPE_CHECKING:
    from pydrake.geometry import SceneGraph


@dataclass(frozen=True, eq=False)
class StationDiagram:
    """A built diagram and the names to find things in it.

    Attributes:
        diagram: the Drake diagram; keep it alive while its plant is used.
        scene, station, robot, engine: what it was built from.
        free: body of each instance that is not background, by name.
        standing: bodies of instances that could be free, but are welded where they stand, by name.
        fixed: bodies of background instances and obstacles, by name.
        parts: geometries of objects that only some bodies meet.
        table: the table's body.
        robot_bodies: all bodies of hand and arm.
    """

    diagram: RobotDiagram
    scene: Scene
    station: Station
    robot: Robot
    engine: Engine
    free: dict[str, BodyIndex]
    standing: dict[str, BodyIndex]
    fixed: dict[str, BodyIndex]
    parts: ContactParts
    table: BodyIndex
    robot_bodies: tuple[BodyIndex, ...]

    @property
    def plant(self) -> MultibodyPlant:
        """The plant, finalized."""
        return self.diagram.plant()

    @property
    def scene_graph(self) -> SceneGraph:
        """The scene graph."""
        return self.diagram.scene_graph()

    @property
    def arm_joints(self) -> tuple[Joint, ...]:
        """The arm's joints in the order of the station's home posture; none without an arm."""
        if self.robot != "arm":
            return ()
        model = self.plant.GetModelInstanceByName("arm")
        return tuple(actuator.joint() for actuator in joint_actuators(self.plant, model))

    @property
    def body_names(self) -> dict[BodyIndex, str]:
        """What people call a body: the names of instances and obstacles, `table`, robot links."""
        objects = {**self.free, **self.standing, **self.fixed}
        names = {index: name for name, index in objects.items()}
        links = {i: self.plant.get_body(i).name() for i in self.robot_bodies}
        return names | links | {self.table: "table"}

    def X_WO(self, instance: str) -> Array:
        """(4, 4) pose at which the document places an instance."""
        return instance_pose(self.scene, self.station, instance)


def instance_pose(scene: Scene, station: Station, instance: str) -> Array:
    """`X_WO` (4, 4) of an instance as the documents place it."""
    return station.document.X_WS.matrix() @ scene.X_SO(instance)
