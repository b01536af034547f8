"""One Drake diagram with a simulated camera, the pose estimator and the overlay."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from pydrake.math import RigidTransform
from pydrake.systems.framework import Context, Diagram, DiagramBuilder, OutputPort
from pydrake.systems.primitives import ZeroOrderHold
from pydrake.systems.sensors import RgbdSensor

from burg_drake.cameras.image_systems import SceneOverlay
from burg_drake.cameras.intrinsics import Intrinsics, camera_intrinsics
from burg_drake.cameras.overlay import OverlayStyle
from burg_drake.cameras.pose_systems import BoardPoseEstimator
from burg_drake.core import Array, InvalidInputError, UnknownNameError, inverse, suggest_names
from burg_drake.scene import SceneLike, as_scene
from burg_drake.station import (
    ENGINES,
    Engine,
    Robot,
    StationDiagram,
    StationLike,
    as_station,
    build_station_diagram,
)

if TYPE_CHECKING:
    from pydrake.geometry import Meshcat

    from burg_drake.cameras.pose_systems import PoseFilter


@dataclass(frozen=True, kw_only=True)
class LoopCamera:
    """The simulated camera of a loop.

    Attributes:
        name: name in the station.
        samples: rays along each side of a pixel of the colour image, see `Camera.samples`.
        depth: whether the estimator gets the depth image, too, to measure the scale of the board.
        period: time between images [s]; images are continuous if None.

    Raises:
        InvalidInputError: the period is not above 0.
    """

    name: str = "board"
    samples: int = 2
    depth: bool = False
    period: float | None = None

    def __post_init__(self) -> None:
        if self.period is not None and self.period <= 0.0:
            raise InvalidInputError(
                f"the period of a camera is {self.period:g} s; give more than 0"
            )


@dataclass(frozen=True, eq=False)
class BoardLoop:
    """A diagram of camera, estimator and overlay.

    Attributes:
        diagram: the whole diagram; keep it alive while its parts are used.
        built: the station in it.
        sensor: the camera.
        intrinsics: of the camera.
    """

    diagram: Diagram
    built: StationDiagram
    sensor: RgbdSensor
    intrinsics: Intrinsics

    def X_SC(self, context: Context) -> Array:
        """(4, 4) true pose of the camera; `context` is the whole diagram's."""
        X_WC = self.sensor.GetX_PB(self.sensor.GetMyContextFromRoot(context)).GetAsMatrix4()
        X_SC: Array = inverse(self.built.station.document.X_WS.matrix()) @ X_WC
        return X_SC

    def place_camera(self, context: Context, X_SC: Array) -> None:
        """Moves the camera over the board."""
        mine = self.sensor.GetMyMutableContextFromRoot(context)
        self.sensor.SetX_PB(mine, self._in_world(X_SC))

    def place_object(self, context: Context, instance: str, X_SO: Array) -> None:
        """Moves an object, in the simulation only: the overlay shows its target.

        Raises:
            UnknownNameError: the scene has no such free instance.
        """
        free = self.built.free
        if instance not in free:
            raise UnknownNameError(
                f"{instance!r} is not a free instance; {suggest_names(instance, free)}"
            )
        plant = self.built.plant
        mine = plant.GetMyMutableContextFromRoot(context)
        plant.SetFreeBodyPose(mine, plant.get_body(free[instance]), self._in_world(X_SO))

    def _in_world(self, X_SF: Array) -> RigidTransform:
        return RigidTransform(self.built.station.document.X_WS.matrix() @ X_SF)


def build_board_loop(
    scene: SceneLike,
    station: StationLike,
    camera: str | LoopCamera = "board",
    *,
    robot: Robot = "none",
    engine: Engine = ENGINES["standard"],
    style: OverlayStyle | None = None,
    filter: PoseFilter | None = None,
    meshcat: Meshcat | None = None,
) -> BoardLoop:
    """Builds the diagram of a station whose camera looks at the board.

    Example::

        loop = burg.cameras.build_board_loop("tabletop_six", "panda_tabletop", camera="board")
        context = loop.diagram.CreateDefaultContext()
        estimate = loop.diagram.GetOutputPort("board.estimate").Eval(context)
        overlay = loop.diagram.GetOutputPort("overlay_image").Eval(context).data

    Args:
        scene: objects on the board, which the overlay draws at their targets.
        station: station with the camera.
        camera: name of the camera, or a `LoopCamera` with its settings.
        robot, engine, meshcat: see `build_station_diagram`.
        style: of the overlay, if not the default.
        filter: filter between estimate and overlay; none if not given.

    Raises:
        UnknownNameError: there is no such camera.
        InvalidInputError: `samples` is out of range, or the board's markers do not fit on it; and
            as `build_station_diagram`.
        MissingDependencyError: a system library of the renderer is missing.
    """
    scene, station = as_scene(scene), as_station(station)
    camera = LoopCamera(name=camera) if isinstance(camera, str) else camera
    simulated = replace(station.camera(camera.name), samples=camera.samples)
    cameras = {**station.document.cameras, camera.name: simulated}
    station = replace(station, document=replace(station.document, cameras=cameras))
    intrinsics = camera_intrinsics(simulated)
    built = build_station_diagram(
        scene, station, robot=robot, engine=engine, meshcat=meshcat, cameras=True
    )
    builder = DiagramBuilder()
    builder.AddSystem(built.diagram)
    color_image = _camera_images_port(builder, built, camera, "color_image")
    estimator = builder.AddNamedSystem(
        "board_pose_estimator", BoardPoseEstimator(scene.board, intrinsics)
    )
    builder.Connect(color_image, estimator.GetInputPort("color_image"))
    if camera.depth:
        depth_image = _camera_images_port(builder, built, camera, "depth_image")
        builder.Connect(depth_image, estimator.GetInputPort("depth_image"))
    X_SC, valid = estimator.GetOutputPort("X_SC"), estimator.GetOutputPort("valid")
    if filter is not None:
        builder.AddNamedSystem("pose_filter", filter)
        builder.Connect(estimator.GetOutputPort("estimate"), filter.GetInputPort("estimate"))
        X_SC, valid = filter.GetOutputPort("X_SC"), filter.GetOutputPort("valid")
    overlay = SceneOverlay(scene, intrinsics, style or OverlayStyle())
    builder.AddNamedSystem("scene_overlay", overlay)
    builder.Connect(color_image, overlay.GetInputPort("color_image"))
    builder.Connect(X_SC, overlay.GetInputPort("X_SC"))
    builder.Connect(valid, overlay.GetInputPort("valid"))
    builder.Connect(estimator.GetOutputPort("estimate"), overlay.GetInputPort("estimate"))

    _export_station(builder, built.diagram)
    _export_board(builder, estimator, filter, overlay)
    sensor = built.diagram.GetSubsystemByName(f"camera.{camera.name}")
    return BoardLoop(builder.Build(), built, sensor, intrinsics)


def _camera_images_port(
    builder: DiagramBuilder, built: StationDiagram, camera: LoopCamera, kind: str
) -> OutputPort:
    """Port of a camera's images, held for its period if there is one."""
    port = f"camera.{camera.name}.{kind}"
    images = built.diagram.GetOutputPort(port)
    if camera.period is None:
        return images
    hold = builder.AddNamedSystem(f"{port}.hold", ZeroOrderHold(camera.period, images.Allocate()))
    builder.Connect(images, hold.get_input_port())
    return hold.get_output_port()


def _export_board(
    builder: DiagramBuilder,
    estimator: BoardPoseEstimator,
    pose_filter: PoseFilter | None,
    overlay: SceneOverlay,
) -> None:
    for name in ("X_SC", "valid", "reprojection_error", "covariance", "estimate"):
        builder.ExportOutput(estimator.GetOutputPort(name), f"board.{name}")
    if pose_filter is not None:
        builder.ExportOutput(pose_filter.GetOutputPort("X_SC"), "board.X_SC_filtered")
    builder.ExportInput(overlay.GetInputPort("placement"), "placement")
    builder.ExportOutput(overlay.GetOutputPort("overlay_image"), "overlay_image")


def _export_station(builder: DiagramBuilder, station: Diagram) -> None:
    for i in range(station.num_input_ports()):
        builder.ExportInput(station.get_input_port(i), station.get_input_port(i).get_name())
    for i in range(station.num_output_ports()):
        builder.ExportOutput(station.get_output_port(i), station.get_output_port(i).get_name())
