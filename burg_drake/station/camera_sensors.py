"""The station's cameras as Drake sensors, optionally with pixels averaged over their area."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

import numpy as np
from pydrake.common.value import AbstractValue, Value
from pydrake.geometry import (
    ClippingRange,
    ColorRenderCamera,
    DepthRange,
    DepthRenderCamera,
    FrameId,
    LightParameter,
    MakeRenderEngineVtk,
    QueryObject,
    RenderCameraCore,
    RenderEngineVtkParams,
    SceneGraph,
)
from pydrake.math import RigidTransform
from pydrake.perception import BaseField, DepthImageToPointCloud
from pydrake.planning import RobotDiagramBuilder
from pydrake.systems.framework import Context, LeafSystem
from pydrake.systems.sensors import CameraInfo, ImageRgba8U, PixelType, RgbdSensor

from burg_drake.core import (
    InvalidInputError,
    MissingDependencyError,
    linear_to_srgb,
    srgb_to_linear,
)
from burg_drake.station.station_document import HALF_PIXEL, Camera, Station
from burg_drake.system_libraries import apt_command, missing_render_libraries


def supersampled_camera(camera: Camera) -> Camera:
    """The camera with `samples` times as many pixels along each side, one ray per pixel."""
    n = camera.samples
    (fx, fy), (cx, cy) = camera.focal, camera.principal_point
    return replace(
        camera,
        width=n * camera.width,
        height=n * camera.height,
        focal=(n * fx, n * fy),
        center=(n * (cx + HALF_PIXEL) - HALF_PIXEL, n * (cy + HALF_PIXEL) - HALF_PIXEL),
        samples=1,
    )


class AreaCamera(LeafSystem):
    """Renders at a higher resolution and averages blocks of pixels.

    Ports:
        geometry_query: query port of the scene graph.
        X_WC: pose of the camera's optical frame in the world.
        color_image: averaged image (output).
    """

    def __init__(self, rendered: ColorRenderCamera, samples: int, world: FrameId) -> None:
        """Declares the ports.

        Args:
            rendered: Drake's camera of `supersampled_camera(camera)`.
            samples: rays per pixel along each side.
            world: the scene graph's world frame.
        """
        super().__init__()
        self._rendered, self._world = rendered, world
        info = rendered.core().intrinsics()
        self._size = info.width() // samples, info.height() // samples
        self._query = self.DeclareAbstractInputPort("geometry_query", Value[QueryObject]())
        self._X_WC = self.DeclareAbstractInputPort("X_WC", Value[RigidTransform]())
        blank = ImageRgba8U(*self._size)
        self.DeclareAbstractOutputPort("color_image", lambda: Value(blank), self._calc)

    def _calc(self, context: Context, output: AbstractValue) -> None:
        import cv2

        query = self._query.Eval(context)
        fine = query.RenderColorImage(self._rendered, self._world, self._X_WC.Eval(context))
        image = ImageRgba8U(*self._size)
        light = srgb_to_linear(np.asarray(fine.data))
        image.mutable_data[:] = linear_to_srgb(
            cv2.resize(light, self._size, interpolation=cv2.INTER_AREA)
        )
        output.set_value(image)


RENDERER_NAME = "burg_drake"  # Name of the renderer in the scene graph.
DEFAULT_LIGHTS = [
    LightParameter(
        type="directional", frame=frame, direction=np.array(direction), intensity=intensity
    )
    for frame, direction, intensity in (
        ("world", (-0.3, 0.3, -1.0), 0.6),
        ("camera", (0.2, 0.1, 1.0), 0.65),
    )
]
"""Light from above and a weaker light on the camera; shadows triple the rendering time."""


def render_cameras(camera: Camera) -> tuple[ColorRenderCamera, DepthRenderCamera]:
    """Drake's render cameras of a station camera.

    Raises:
        InvalidInputError: its principal point lies outside of the image, which Drake does not
            support.
    """
    (fx, fy), (cx, cy) = camera.focal, camera.principal_point
    if not 0 < cx + HALF_PIXEL < camera.width or not 0 < cy + HALF_PIXEL < camera.height:
        raise InvalidInputError(
            f"center {cx:g}, {cy:g} of a camera is outside the image of {camera.width} x "
            f"{camera.height} pixels; take center, focal, width and height from the same"
            " calibration"
        )
    info = CameraInfo(camera.width, camera.height, fx, fy, cx + HALF_PIXEL, cy + HALF_PIXEL)
    near, far = camera.depth_range
    core = RenderCameraCore(RENDERER_NAME, info, ClippingRange(near / 2, far * 2), RigidTransform())
    return ColorRenderCamera(core, False), DepthRenderCamera(core, DepthRange(near, far))


def add_cameras(
    builder: RobotDiagramBuilder, station: Station, names: Iterable[str] | None = None
) -> None:
    """Adds a renderer and one `RgbdSensor` per camera; exports their ports as `camera.NAME.*`.

    Args:
        builder: builder of the diagram.
        station: station with the cameras.
        names: names of the cameras to add; all if not given.

    Raises:
        UnknownNameError: the station has no such camera.
        MissingDependencyError, InvalidInputError: see `add_renderer`.
    """
    names = station.document.cameras if names is None else names
    cameras = {name: station.camera(name) for name in names}
    scene_graph, system = builder.scene_graph(), builder.builder()
    add_renderer(scene_graph, RENDERER_NAME, RenderEngineVtkParams(lights=DEFAULT_LIGHTS))
    for name, camera in cameras.items():
        color, depth = render_cameras(camera)
        sensor = system.AddSystem(
            RgbdSensor(
                scene_graph.world_frame_id(),
                RigidTransform(np.array(camera.X_WC.matrix())),
                color,
                depth,
            )
        )
        sensor.set_name(f"camera.{name}")
        query = scene_graph.get_query_output_port()
        system.Connect(query, sensor.query_object_input_port())
        color_image = sensor.color_image_output_port()
        if camera.samples > 1:
            fine, _ = render_cameras(supersampled_camera(camera))
            area = AreaCamera(fine, camera.samples, scene_graph.world_frame_id())
            system.AddNamedSystem(f"camera.{name}.area", area)
            system.Connect(query, area.GetInputPort("geometry_query"))
            system.Connect(sensor.body_pose_in_world_output_port(), area.GetInputPort("X_WC"))
            color_image = area.GetOutputPort("color_image")
        for port, image in (
            (color_image, "color_image"),
            (sensor.depth_image_32F_output_port(), "depth_image"),
            (sensor.label_image_output_port(), "label_image"),
        ):
            system.ExportOutput(port, f"camera.{name}.{image}")
        X_WC = sensor.body_pose_in_world_output_port()
        cloud = system.AddNamedSystem(f"camera.{name}.cloud", _point_cloud(camera))
        system.Connect(sensor.depth_image_32F_output_port(), cloud.depth_image_input_port())
        system.Connect(color_image, cloud.color_image_input_port())
        system.Connect(X_WC, cloud.camera_pose_input_port())
        system.ExportOutput(X_WC, f"camera.{name}.pose")
        system.ExportOutput(cloud.point_cloud_output_port(), f"camera.{name}.point_cloud")


def add_renderer(scene_graph: SceneGraph, name: str, parameters: RenderEngineVtkParams) -> None:
    """Adds Drake's renderer for all present and future geometries.

    Args:
        scene_graph: the scene graph.
        name: name of the renderer.
        parameters: parameters such as its lights.

    Raises:
        MissingDependencyError: a system library of the renderer is missing (it would crash).
        InvalidInputError: it cannot read a visual mesh.
    """
    missing = missing_render_libraries()
    if missing:
        raise MissingDependencyError(
            f"cameras need the system libraries {', '.join(missing)}; run: {apt_command()}"
        )
    try:
        scene_graph.AddRenderer(name, MakeRenderEngineVtk(parameters))
    except RuntimeError as error:
        raise InvalidInputError(
            f"a mesh to be rendered cannot be read ({' '.join(str(error).split())});"
            " build its library again"
        ) from error


def _point_cloud(camera: Camera) -> DepthImageToPointCloud:
    """Converts the depth image to coloured points. It uses pixel indices, which are OpenCV's
    coordinates of the pixel centres; with Drake's principal point all points would be off by half a
    pixel."""
    info = CameraInfo(camera.width, camera.height, *camera.focal, *camera.principal_point)
    return DepthImageToPointCloud(
        info, PixelType.kDepth32F, fields=int(BaseField.kXYZs) | int(BaseField.kRGBs)
    )
