"""Builds the Drake diagram of a scene on a station, with a hand, an arm or no robot."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from typing import TYPE_CHECKING, get_args

from pydrake.geometry import HydroelasticContactRepresentation, MeshcatVisualizer
from pydrake.math import RigidTransform
from pydrake.multibody.plant import ContactModel, DiscreteContactApproximation, MultibodyPlant
from pydrake.planning import RobotDiagramBuilder

from burg_drake.core import InvalidInputError, UnknownNameError, suggest_names
from burg_drake.scene import SceneLike, as_scene
from burg_drake.station.camera_sensors import add_cameras
from burg_drake.station.contact_parts import ContactParts, add_contact_parts, needs_no_pieces
from burg_drake.station.engine import ENGINES, Engine, as_drake_engine
from burg_drake.station.model_file import set_packages
from burg_drake.station.object_bodies import add_fixed_instance, add_instance, add_vertical_joint
from burg_drake.station.object_contact import filter_contact_pairs, make_touching_compliant
from burg_drake.station.ports import export_driven_ports, export_ports
from burg_drake.station.robot import Robot, add_robot, set_default_posture
from burg_drake.station.station_diagram import StationDiagram, instance_pose
from burg_drake.station.station_document import StationLike, as_station
from burg_drake.station.surroundings import add_board, add_obstacles, add_table

if TYPE_CHECKING:
    from pydrake.geometry import Meshcat


def build_station_diagram(
    scene: SceneLike,
    station: StationLike,
    *,
    robot: Robot = "arm",
    engine: Engine | str = ENGINES["standard"],
    meshcat: Meshcat | None = None,
    drivers: bool = False,
    cameras: bool | str | Sequence[str] = False,
    weld_objects: bool = False,
    for_trials: bool | str = False,
) -> StationDiagram:
    """Builds the diagram of a scene on a station.

    Objects are rigid, except those that touch other objects, which are compliant.

    Example::

        built = burg.build_station_diagram("tabletop_six", "panda_tabletop", robot="none")
        simulator = Simulator(built.diagram)  # of pydrake.systems.analysis
        simulator.AdvanceTo(0.5)

    Args:
        scene: the scene.
        station: robot, table, board pose and cameras.
        robot: `arm` mounts the hand on the station's arm. `hand` attaches it to one prismatic joint
            `lift` along world z between the frames `lift_base` (in the world) and `lift_mount` (on
            the hand), which are set per grasp through the Context; before that the hand is above
            the board, pointing down. `none` leaves the robot out.
        engine: time step and contact settings, or the name of a preset.
        meshcat: where to show the diagram live, if anywhere.
        drivers: add drivers that follow positions, widths or a plan, and force measurements; see
            the ports above. Needs an arm.
        cameras: add all or the named cameras of the station; needs the renderer's system libraries.
            The board's markers are drawn with `meshcat`, or if names are given, even an empty
            tuple; otherwise the board is plain.
        weld_objects: for collision queries without simulation: free objects are fixed at their
            poses, can be raised by a joint `rise` of their model along world z, and moved sideways
            with their frame `place`; rigid meshes are replaced by pieces.
        for_trials: add surface meshes for the hand, and feet for the table, to the objects (see
            `add_contact_parts`). With the name of an instance only that instance can move, and its
            hull meets all but the hand and the table; the other objects are only hulls.

    Returns:
        The diagram. In its default context objects are at their poses in the documents, the hand is
        open, and the arm is in its home posture.

    Raises:
        UnknownNameError: no such `robot`, engine or camera, or no such instance in `for_trials`.
        InvalidInputError: options that contradict each other; an engine that is not Drake; an
            object's model cannot be loaded, `arm` without an arm in the station, a home posture
            that does not fit the arm, or two things of the same name.
        MissingDependencyError: cameras without the renderer's system libraries.
    """
    scene, station, engine = as_scene(scene), as_station(station), as_drake_engine(engine)
    if drivers and (robot != "arm" or weld_objects):
        raise InvalidInputError("drivers need robot='arm' and objects that are free (not welded)")
    if for_trials and weld_objects:
        raise InvalidInputError("welded objects are not simulated; leave out for_trials")
    if robot not in get_args(Robot):
        raise UnknownNameError(
            f"robot {robot!r} does not exist; {suggest_names(robot, get_args(Robot))}"
        )
    builder = RobotDiagramBuilder(time_step=engine.time_step)
    plant = builder.plant()
    set_packages(builder.parser(), {})
    builder.parser().SetAutoRenaming(True)
    _set_engine(plant, engine)

    table = add_table(plant, station)
    add_board(plant, scene.board, station, markers=cameras is not False or meshcat is not None)
    add = partial(add_instance, builder, scene, station.packages, by_pieces=weld_objects)
    alone = for_trials if isinstance(for_trials, str) else None
    if alone is not None and alone not in scene.instances:
        known = suggest_names(alone, tuple(scene.instances))
        raise UnknownNameError(f"{alone!r} is not a free instance of scene {scene.name!r}; {known}")
    on_patches = engine.contact_model != "point"
    if alone is not None:
        free = {alone: add(alone, bare=on_patches and needs_no_pieces(scene, station, alone))}
    else:
        free = {name: add(name) for name in scene.instances}
    standing = {
        name: add_fixed_instance(plant, scene, name, instance_pose(scene, station, name))
        for name in scene.instances
        if name not in free
    }
    fixed = {name: add(name) for name in scene.background}
    for name, body in fixed.items():
        X_WO = instance_pose(scene, station, name)
        plant.WeldFrames(plant.world_frame(), body.body_frame(), RigidTransform(X_WO))
    for name, body in (free if weld_objects else {}).items():
        add_vertical_joint(plant, body, RigidTransform(instance_pose(scene, station, name)))
    fixed |= add_obstacles(plant, station)
    models = add_robot(builder, station, robot, simulated=not weld_objects)
    parts = ContactParts()
    if for_trials:
        parts = add_contact_parts(
            plant, scene, station, free, fixed, own_surfaces=on_patches, hulls=alone is not None
        )

    plant.Finalize()
    for name, body in ({} if weld_objects else free).items():
        X_WO = instance_pose(scene, station, name)
        plant.SetDefaultFloatingBaseBodyPose(body, RigidTransform(X_WO))
    set_default_posture(plant, station, models)

    if drivers:
        export_driven_ports(builder, scene, station, models)
    else:
        export_ports(builder, station, models, controlled=not weld_objects)
    if cameras:
        named = (cameras,) if isinstance(cameras, str) else cameras
        add_cameras(builder, station, None if named is True else named)
    if meshcat is not None:
        MeshcatVisualizer.AddToBuilder(builder.builder(), builder.scene_graph(), meshcat)
    built = StationDiagram(
        diagram=builder.Build(),
        scene=scene,
        station=station,
        robot=robot,
        engine=engine,
        free={name: body.index() for name, body in free.items()},
        standing={name: body.index() for name, body in standing.items()},
        fixed={name: body.index() for name, body in fixed.items()},
        parts=parts,
        table=table.index(),
        robot_bodies=tuple(i for m in models.values() for i in plant.GetBodyIndices(m)),
    )
    if not weld_objects:
        filter_contact_pairs(built)
        make_touching_compliant(built)
    return built


def _set_engine(plant: MultibodyPlant, engine: Engine) -> None:
    models = {
        "hydroelastic_with_fallback": ContactModel.kHydroelasticWithFallback,
        "point": ContactModel.kPoint,
    }
    approximations = {
        "lagged": DiscreteContactApproximation.kLagged,
        "similar": DiscreteContactApproximation.kSimilar,
        "sap": DiscreteContactApproximation.kSap,
    }
    surfaces = {
        "polygon": HydroelasticContactRepresentation.kPolygon,
        "triangle": HydroelasticContactRepresentation.kTriangle,
    }
    plant.set_contact_model(models[engine.contact_model])
    plant.set_discrete_contact_approximation(approximations[engine.contact_approximation])
    plant.set_stiction_tolerance(engine.stiction_tolerance)
    plant.set_contact_surface_representation(surfaces[engine.contact_surface])
