"""The one place that builds Drake diagrams: a scene on a station, with a hand, an arm or neither.

Ports of the diagram (MODEL is `hand`, `arm` or `lift`):

    inputs   MODEL.desired_state      positions and velocities for the joint servos
             MODEL.feedforward        what the servos add to it [Nm, N]; nothing if not connected
             applied_forces           list of ExternallyAppliedSpatialForce
    outputs  MODEL.actuation          what the joints got, within the model's effort limits [Nm, N]
             MODEL.state, state, contact_results, body_poses, geometry_query,
             camera.NAME.color_image, .depth_image, .label_image (with cameras=True)

Connect the `desired_state` of all models, or of none, which leaves the joints without actuation:
with some of them, Drake ends the process. The other inputs may be left out. Gravity does not pull
the robot: a real one compensates its own weight.
"""

from __future__ import annotations

import logging
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, get_args

import numpy as np
from pydrake.geometry import HydroelasticContactRepresentation, MeshcatVisualizer
from pydrake.math import RigidTransform
from pydrake.multibody.plant import ContactModel, DiscreteContactApproximation, MultibodyPlant
from pydrake.multibody.tree import (
    BodyIndex,
    FixedOffsetFrame,
    Joint,
    ModelInstanceIndex,
    PrismaticJoint,
    RigidBody,
)
from pydrake.planning import RobotDiagram, RobotDiagramBuilder

from burg_drake.core.errors import InvalidInputError, UnknownNameError, nearest
from burg_drake.core.frames import Array
from burg_drake.core.packages import Packages
from burg_drake.objects.entry import MassProperties
from burg_drake.objects.sdf import LINK
from burg_drake.scene.scene import Scene
from burg_drake.station.cameras import add_cameras
from burg_drake.station.engine import ENGINES, Engine
from burg_drake.station.hollow import is_mesh, sdf_by_pieces
from burg_drake.station.model_file import add_models, held_remarks, set_packages
from burg_drake.station.robot import (
    ROBOT_MODELS,
    Robot,
    add_robot,
    joint_actuators,
    set_default_posture,
)
from burg_drake.station.station import Station
from burg_drake.station.surroundings import add_board, add_obstacles, add_table

if TYPE_CHECKING:
    from pydrake.geometry import Meshcat, SceneGraph

SAME_INERTIA = 1e-6
"""Masses and moments may differ by this share: Drake shifts moments to the origin and back."""

RISE = "rise"
"""The joint of an object that can only be lifted off [m], see `build_station_diagram`."""


@dataclass(frozen=True, eq=False)
class StationDiagram:
    """A built diagram and the names to find things in it.

    Attributes:
        diagram: the Drake diagram; keep it alive while its plant is used.
        scene, station, robot, engine: what it was built from.
        free: body of each instance that is not background, by name.
        fixed: bodies of background instances and obstacles, by name.
        table: the table's body.
        robot_bodies: all bodies of hand and arm.
    """

    diagram: RobotDiagram
    scene: Scene
    station: Station
    robot: Robot
    engine: Engine
    free: dict[str, BodyIndex]
    fixed: dict[str, BodyIndex]
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
        names = {index: name for name, index in {**self.free, **self.fixed}.items()}
        links = {i: self.plant.get_body(i).name() for i in self.robot_bodies}
        return names | links | {self.table: "table"}

    def X_WO(self, instance: str) -> Array:
        """(4, 4) pose at which the document places an instance."""
        return instance_pose(self.scene, self.station, instance)


def instance_pose(scene: Scene, station: Station, instance: str) -> Array:
    """`X_WO` (4, 4) of an instance as the documents place it."""
    return station.document.X_WS.matrix() @ scene.X_SO(instance)


def build_station_diagram(
    scene: Scene,
    station: Station,
    *,
    robot: Robot = "arm",
    engine: Engine = ENGINES["standard"],
    meshcat: Meshcat | None = None,
    cameras: bool = False,
    weld_objects: bool = False,
) -> StationDiagram:
    """Builds the diagram of a scene on a station.

    Args:
        scene: what stands on the board.
        station: robot, table, board pose and cameras.
        robot: `arm` mounts the hand on the station's arm. `hand` lets it hang on one prismatic
            joint `lift` along world z between the frames `lift_base` (in the world) and
            `lift_mount` (on the hand), which are set per grasp through the Context; before that
            the hand is above the board, pointing down. `none` leaves the robot out.
        engine: time step and contact settings.
        meshcat: where to show the diagram live, if anywhere.
        cameras: add the station's cameras; needs the renderer's system libraries. The board's
            markers are drawn with cameras or `meshcat` only; it is plain where nobody looks.
        weld_objects: for a plant of the robot alone that is not simulated: what would be free
            stands where it is placed, and can only be lifted off, by a joint `RISE` of its model
            along world z; rigid meshes are replaced by pieces (see `station.hollow`).

    Returns:
        The diagram. In its default context all stands as the documents say, the hand is open and
        the arm is in its home posture.

    Raises:
        UnknownNameError: no such `robot`.
        InvalidInputError: an object's model cannot be loaded, `arm` without an arm in the station,
            a home posture that does not fit the arm, or two things of the same name.
        MissingDependencyError: cameras without the renderer's system libraries.
    """
    if robot not in get_args(Robot):
        raise UnknownNameError(f"robot {robot!r} does not exist; {nearest(robot, get_args(Robot))}")
    builder = RobotDiagramBuilder(time_step=engine.time_step)
    plant = builder.plant()
    set_packages(builder.parser(), {})
    builder.parser().SetAutoRenaming(True)
    _set_engine(plant, engine)

    table = add_table(plant, station)
    add_board(plant, scene.board, station, markers=cameras or meshcat is not None)
    add = partial(_add_instance, builder, scene, station.packages, by_pieces=weld_objects)
    free = {name: add(name) for name in scene.instances}
    fixed = {name: add(name) for name in scene.background}
    for name, body in fixed.items():
        X_WO = instance_pose(scene, station, name)
        plant.WeldFrames(plant.world_frame(), body.body_frame(), RigidTransform(X_WO))
    for name, body in (free if weld_objects else {}).items():
        _add_rise(plant, body, RigidTransform(instance_pose(scene, station, name)))
    fixed |= add_obstacles(plant, station)
    models = add_robot(builder, station, robot)

    plant.Finalize()
    for name, body in ({} if weld_objects else free).items():
        X_WO = instance_pose(scene, station, name)
        plant.SetDefaultFloatingBaseBodyPose(body, RigidTransform(X_WO))
    set_default_posture(plant, station, models)

    _export_ports(builder, models)
    if cameras:
        add_cameras(builder, station)
    if meshcat is not None:
        MeshcatVisualizer.AddToBuilder(builder.builder(), builder.scene_graph(), meshcat)
    return StationDiagram(
        diagram=builder.Build(),
        scene=scene,
        station=station,
        robot=robot,
        engine=engine,
        free={name: body.index() for name, body in free.items()},
        fixed={name: body.index() for name, body in fixed.items()},
        table=table.index(),
        robot_bodies=tuple(i for m in models.values() for i in plant.GetBodyIndices(m)),
    )


def _set_engine(plant: MultibodyPlant, engine: Engine) -> None:
    plant.set_contact_model(
        {
            "hydroelastic_with_fallback": ContactModel.kHydroelasticWithFallback,
            "point": ContactModel.kPoint,
        }[engine.contact_model]
    )
    plant.set_discrete_contact_approximation(
        {
            "lagged": DiscreteContactApproximation.kLagged,
            "similar": DiscreteContactApproximation.kSimilar,
            "sap": DiscreteContactApproximation.kSap,
        }[engine.contact_approximation]
    )
    plant.set_stiction_tolerance(engine.stiction_tolerance)
    plant.set_contact_surface_representation(
        {
            "polygon": HydroelasticContactRepresentation.kPolygon,
            "triangle": HydroelasticContactRepresentation.kTriangle,
        }[engine.contact_surface]
    )


def _add_instance(
    builder: RobotDiagramBuilder, scene: Scene, packages: Packages, name: str, *, by_pieces: bool
) -> RigidBody:
    """Parses the object's SDF; the model instance goes by the name of the scene's instance."""
    plant, parser = builder.plant(), builder.parser()
    if plant.HasModelInstanceNamed(name) or name in ROBOT_MODELS:
        raise InvalidInputError(
            f"{scene.path}: instance name {name!r} is taken by the station; choose another"
        )
    path = scene.library.path(scene.entry(name).sdf)
    try:
        with held_remarks() as remarks:
            if by_pieces and is_mesh(scene, name):
                (model,) = parser.AddModelsFromString(sdf_by_pieces(scene, name), "sdf")
            else:
                (model,) = add_models(parser, path, packages)
            body = plant.GetBodyByName(LINK, model)
            _require_inertia(body, scene.entry(name).mass_properties)
    except (RuntimeError, ValueError) as error:
        raise InvalidInputError(
            f"{path} cannot be loaded ({' '.join(str(error).split())}); build the library"
            f" {scene.library.name!r} again"
        ) from error
    for remark in remarks:
        logging.getLogger("drake").handle(remark)
    plant.RenameModelInstance(model, name)
    return body


def _require_inertia(body: RigidBody, listed: MassProperties) -> None:
    """Checks that a body weighs what the library says: where no body can have the mass or inertia
    of an SDF, Drake's parser warns, and takes others.

    Raises:
        ValueError: it does not.
    """
    inertia = body.default_spatial_inertia()
    about_com = inertia.Shift(inertia.get_com()).CalcRotationalInertia()
    moments = [*about_com.get_moments(), *about_com.get_products()]
    if abs(inertia.get_mass() - listed.mass) > SAME_INERTIA * listed.mass:
        raise ValueError(f"its mass is not {listed.mass:g} kg, as library.yaml says")
    if not np.allclose(moments, listed.inertia, rtol=0.0, atol=SAME_INERTIA * max(moments)):
        raise ValueError("its inertia is not what library.yaml says")


def _add_rise(plant: MultibodyPlant, body: RigidBody, X_WO: RigidTransform) -> None:
    """Hangs a body on a joint along world z, which stands at 0 where the body is placed."""
    model = body.model_instance()
    place = plant.AddFrame(FixedOffsetFrame("place", plant.world_frame(), X_WO, model))
    up_O = X_WO.rotation().matrix()[2]
    plant.AddJoint(PrismaticJoint(RISE, place, body.body_frame(), up_O))


def _export_ports(builder: RobotDiagramBuilder, models: dict[str, ModelInstanceIndex]) -> None:
    plant, system = builder.plant(), builder.builder()
    for role, model in models.items():
        system.ExportInput(plant.get_desired_state_input_port(model), f"{role}.desired_state")
        system.ExportInput(plant.get_actuation_input_port(model), f"{role}.feedforward")
        system.ExportOutput(plant.get_state_output_port(model), f"{role}.state")
        system.ExportOutput(plant.get_net_actuation_output_port(model), f"{role}.actuation")
    system.ExportInput(plant.get_applied_spatial_force_input_port(), "applied_forces")
    system.ExportOutput(plant.get_state_output_port(), "state")
    system.ExportOutput(plant.get_contact_results_output_port(), "contact_results")
    system.ExportOutput(plant.get_body_poses_output_port(), "body_poses")
    system.ExportOutput(builder.scene_graph().get_query_output_port(), "geometry_query")
