"""What happens in MuJoCo, shown in Meshcat by a station diagram that is put where things are."""

from __future__ import annotations

from pydrake.geometry import Meshcat
from pydrake.math import RigidTransform

from burg_drake.scene.document import Scene
from burg_drake.simulation.mujoco.mujoco_world import MujocoWorld
from burg_drake.station.diagram import FloatingHand, build_station_diagram
from burg_drake.station.document import Station


class WorldPicture:
    """Shows worlds of one scene.

    Args:
        scene, station: of the worlds.
        meshcat: where they are shown.

    Attributes:
        diagram: the one that shows them.
    """

    def __init__(self, scene: Scene, station: Station, meshcat: Meshcat) -> None:
        self.diagram = build_station_diagram(scene, station, robot="hand", meshcat=meshcat)
        self._hand = FloatingHand(self.diagram)
        self._context = self.diagram.diagram.CreateDefaultContext()

    def show(self, world: MujocoWorld) -> None:
        """Publishes a world at its time."""
        plant = self.diagram.plant
        plant_context = plant.GetMyMutableContextFromRoot(self._context)
        self._hand.place(plant_context, world.X_WG())
        fingers = world.robot_positions("hand")
        plant.SetPositions(plant_context, plant.GetModelInstanceByName("hand"), fingers)
        for name, index in self.diagram.free.items():
            moved = world.free.get(name)
            X_WO = self.diagram.X_WO(name) if moved is None else world.X_WB(moved)
            plant.SetFloatingBaseBodyPoseInWorldFrame(
                plant_context, plant.get_body(index), RigidTransform(X_WO)
            )
        self._context.SetTime(world.time)
        self.diagram.diagram.ForcedPublish(self._context)
