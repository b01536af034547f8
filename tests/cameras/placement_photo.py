"""Photos of a scene whose objects stand off their targets, by Drake's renderer: truth for tests of
the placement check, and of one's own.

Colours are rendered finer than asked for and averaged as light, so that a pixel has those of all
that it covers, as in a camera. Depth is that of the pixel's middle.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray
from pydrake.geometry import (
    Box,
    ClippingRange,
    ColorRenderCamera,
    DepthRange,
    DepthRenderCamera,
    FramePoseVector,
    GeometryFrame,
    GeometryInstance,
    MakeRenderEngineVtk,
    Mesh,
    PerceptionProperties,
    RenderCameraCore,
    RenderEngineVtkParams,
    RenderLabel,
    Rgba,
    SceneGraph,
    Shape,
)
from pydrake.math import RigidTransform
from pydrake.systems.sensors import CameraInfo

from burg_drake.cameras import Intrinsics, camera_info
from burg_drake.core import Array, MissingDependencyError
from burg_drake.scene import Scene
from burg_drake.station import DEFAULT_LIGHTS, board_meshes
from burg_drake.system_libraries import describe_missing, missing_render_libraries

RENDERER = "photo"
SURROUNDINGS = 1000
"""Label of board and table; objects are numbered from 0 in the scene's order."""
COLORS = {"paper": (0.95, 0.95, 0.93, 1.0), "markers": (0.06, 0.06, 0.06, 1.0)}
TABLE_COLOR = (0.82, 0.79, 0.74, 1.0)
TABLE_SIZE = (2.0, 2.0, 0.1)
AWAY = RigidTransform([0.0, 0.0, -1e3])
"""Where what is not in the photo is, beyond the camera's range."""


@dataclass(frozen=True, eq=False)
class Photo:
    """What a simulated camera sees.

    Attributes:
        color: (H, W, 3) RGB.
        depth: (H, W) distance along the optical axis [m]; 0 where there is nothing.
        label: (H, W) number of the instance in the scene's order (free, then background), at the
            pixel's middle; -1 elsewhere.
    """

    color: NDArray[np.uint8]
    depth: NDArray[np.float32]
    label: NDArray[np.int16]


class ScenePhotographer:
    """Takes photos of a scene's objects on the board, all with one renderer.

    Args:
        scene: what may stand there.

    Raises:
        MissingDependencyError: a system library of the renderer is missing (it would crash).
    """

    def __init__(self, scene: Scene) -> None:
        missing = missing_render_libraries()
        if missing:
            raise MissingDependencyError(describe_missing(missing))
        self._targets = {n: scene.X_SO(n) for n in (*scene.instances, *scene.background)}
        self._graph = SceneGraph()
        self._source = self._graph.RegisterSource("photo")
        parameters = RenderEngineVtkParams(lights=DEFAULT_LIGHTS)
        self._graph.AddRenderer(RENDERER, MakeRenderEngineVtk(parameters))
        below = RigidTransform([*np.array(scene.board.size) / 2, -TABLE_SIZE[2] / 2 - 5e-4])
        self._show("table", below, Box(*TABLE_SIZE), TABLE_COLOR)
        for part, mesh in board_meshes(scene.board).items():
            self._show(part, RigidTransform(), mesh, COLORS[part])
        self._frames = {}
        for number, name in enumerate(self._targets):
            frame = GeometryFrame(name)
            self._frames[name] = self._graph.RegisterFrame(self._source, frame)
            shape = Mesh(str(scene.library.path(scene.entry(name).mesh)))
            geometry = GeometryInstance(RigidTransform(), shape, name)
            geometry.set_perception_properties(_look(number))
            self._graph.RegisterGeometry(self._source, frame.id(), geometry)
        self._context = self._graph.CreateDefaultContext()

    def take(
        self,
        X_SC: Array,
        intrinsics: Intrinsics,
        X_SO: Mapping[str, Array | None] | None = None,
        supersampling: int = 3,
    ) -> Photo:
        """Takes a photo.

        Args:
            X_SC: (4, 4) where the camera is.
            intrinsics: of a camera without distortion.
            X_SO: (4, 4) where objects stand that do not stand on their targets; None for those
                that are not there.
            supersampling: pixels rendered for each of the photo, each way.
        """
        placed = {**self._targets, **(X_SO or {})}
        poses = FramePoseVector()
        for name, frame in self._frames.items():
            X = placed[name]
            poses.set_value(frame, AWAY if X is None else RigidTransform(X))
        self._graph.get_source_pose_port(self._source).FixValue(self._context, poses)
        query = self._graph.get_query_output_port().Eval(self._context)
        s = supersampling
        fine, _ = _cameras(camera_info(_finer(intrinsics, s)))
        color_camera, depth_camera = _cameras(camera_info(intrinsics))
        world, X_PC = self._graph.world_frame_id(), RigidTransform(X_SC)
        color = query.RenderColorImage(fine, world, X_PC).data[..., :3]
        depth = query.RenderDepthImage(depth_camera, world, X_PC).data
        label = query.RenderLabelImage(color_camera, world, X_PC).data[..., 0].copy()
        label[label >= SURROUNDINGS] = -1
        size = (intrinsics.width, intrinsics.height)
        return Photo(
            _averaged(color, size),
            np.where(np.isfinite(depth[..., 0]), depth[..., 0], np.float32(0.0)),
            label,
        )

    def _show(
        self, name: str, X_SB: RigidTransform, shape: Shape, color: tuple[float, ...]
    ) -> None:
        geometry = GeometryInstance(X_SB, shape, name)
        look = _look(SURROUNDINGS)
        look.AddProperty("phong", "diffuse", Rgba(*color))
        geometry.set_perception_properties(look)
        self._graph.RegisterAnchoredGeometry(self._source, geometry)


def _averaged(levels: NDArray[np.uint8], size: tuple[int, int]) -> NDArray[np.uint8]:
    """A finer image's mean light in each pixel; levels are sRGB (IEC 61966-2-1)."""
    share = levels / 255.0
    light = np.where(share <= 0.04045, share / 12.92, ((share + 0.055) / 1.055) ** 2.4)
    light = cv2.resize(light, size, interpolation=cv2.INTER_AREA)
    share = np.where(light <= 0.0031308, 12.92 * light, 1.055 * light ** (1 / 2.4) - 0.055)
    return np.round(255.0 * share).astype(np.uint8)


def _look(label: int) -> PerceptionProperties:
    look = PerceptionProperties()
    look.AddProperty("label", "id", RenderLabel(label))
    return look


def _finer(intrinsics: Intrinsics, s: int) -> Intrinsics:
    """The same camera with `s` times `s` pixels for each; pixel centres at integers."""
    (fx, fy), (cx, cy) = intrinsics.focal, intrinsics.center
    return Intrinsics(
        width=s * intrinsics.width,
        height=s * intrinsics.height,
        focal=(s * fx, s * fy),
        center=(s * (cx + 0.5) - 0.5, s * (cy + 0.5) - 0.5),
        distortion=intrinsics.distortion,
    )


def _cameras(info: CameraInfo) -> tuple[ColorRenderCamera, DepthRenderCamera]:
    core = RenderCameraCore(RENDERER, info, ClippingRange(0.02, 10.0), RigidTransform())
    return ColorRenderCamera(core, False), DepthRenderCamera(core, DepthRange(0.05, 8.0))
