"""Small pictures of a library's objects, rendered by Drake without a display."""

from __future__ import annotations

import io
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray
from PIL import Image
from pydrake.geometry import (
    ClippingRange,
    ColorRenderCamera,
    Convex,
    FrameId,
    FramePoseVector,
    GeometryFrame,
    GeometryInstance,
    LightParameter,
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

from burg_drake.core import (
    Array,
    InvalidInputError,
    MissingDependencyError,
    Rgb,
    distinct_colors,
    make_pose,
    rot_z,
    transform_points,
)
from burg_drake.geometry import hull_mesh
from burg_drake.objects import ObjectLibrary
from burg_drake.system_libraries import describe_missing, missing_render_libraries
from burg_drake.visualization.object_drawing import (
    best_yaw,
    camera_rotation,
    fit_camera,
    painted_shadow,
    upright_rotation,
)

THUMBNAIL_BACKGROUND = (0.953, 0.961, 0.969)  # Colour behind the objects.

HALF_VIEW_TANGENT = 0.22
"""Tangent of half the vertical angle of view: little perspective."""
MAX_FILLED_SHARE = 0.82
"""Share of the picture's width and height that an object may fill."""
THUMBNAIL_EXPLOSION = 0.10
"""Share of each piece's distance from the middle by which it is moved outward."""

THUMBNAIL_LIGHTS = [
    LightParameter(type="directional", frame=frame, direction=np.array(direction), intensity=power)
    for frame, direction, power in (
        ("world", (0.45, 0.55, -1.0), 0.68),
        ("camera", (-0.25, 0.1, 1.0), 0.44),
        ("world", (-1.0, 0.2, -0.2), 0.16),
    )
]
"""Light from the upper left, a weaker one at the camera, a faint one from the right."""
OBJECT_LABEL = 1  # Render label of the object that is in the picture.


@dataclass(frozen=True)
class Thumbnail:
    """A rendered object.

    Attributes:
        pixels: (H, W, 3) colours as bytes.
        coverage: (H, W) share of each pixel that the object covers, in [0, 1].
    """

    pixels: NDArray[np.uint8]
    coverage: Array

    def png(self) -> bytes:
        """The picture as a PNG file with few colours."""
        palette_size = 96  # Makes the PNG a third of the size.
        data = io.BytesIO()
        Image.fromarray(self.pixels).quantize(palette_size, dither=Image.Dither.NONE).save(
            data, format="PNG", optimize=True
        )
        return data.getvalue()


class ObjectRenderer:
    """Renders the objects of a library, all with one renderer.

    Args:
        library: library of the objects.
        names: names of the objects to render; all if None.

    Raises:
        UnknownNameError: no such object, or one of its files is missing.
        InvalidInputError: Drake cannot load a mesh.
        MissingDependencyError: a system library of the renderer is missing (it would crash).
    """

    def __init__(self, library: ObjectLibrary, names: Iterable[str] | None = None) -> None:
        missing = missing_render_libraries()
        if missing:
            raise MissingDependencyError(describe_missing(missing))
        self._library = library
        self._scene_graph = SceneGraph()
        self._source = self._scene_graph.RegisterSource("objects")
        parameters = RenderEngineVtkParams(
            lights=THUMBNAIL_LIGHTS,
            default_clear_color=np.array(THUMBNAIL_BACKGROUND),
            cast_shadows=False,
        )
        self._scene_graph.AddRenderer("thumbnails", MakeRenderEngineVtk(parameters))
        self._frames: dict[tuple[str, bool], FrameId] = {}
        self._hulls: dict[str, tuple[Array, ...]] = {}
        self._corners: dict[str, Array] = {}
        for name in library.objects if names is None else names:
            self._add(name)
        self._context = self._scene_graph.CreateDefaultContext()

    def portrait(
        self, name: str, size: tuple[int, int] = (320, 240), *, stable_pose: int | None = None
    ) -> Thumbnail:
        """Renders the visual mesh of an object.

        Args:
            name: name of the object.
            size: width and height [pixel].
            stable_pose: index of its stable pose; if None, its own frame if stable, else the first.
        """
        entry = self._library.entry(name)
        R_WO = upright_rotation(entry) if stable_pose is None else entry.X_SO(stable_pose)[:3, :3]
        return self._render(name, False, R_WO, size)

    def pieces(self, name: str, size: tuple[int, int] = (320, 240)) -> Thumbnail:
        """Renders the convex pieces of an object, coloured and slightly apart, seen as in
        `portrait`."""
        return self._render(name, True, upright_rotation(self._library.entry(name)), size)

    def _add(self, name: str) -> None:
        entry = self._library.entry(name)
        paths = [self._library.path(piece) for piece in entry.pieces]
        self._hulls[name] = tuple(
            np.asarray(self._library.mesh(piece).vertices) for piece in entry.pieces
        )
        self._corners[name] = hull_mesh(self._library.surface(name).vertices).vertices
        visual = self._library.path(entry.mesh)
        try:
            self._register(name, False, [(Mesh(str(visual)), np.zeros(3), None)])
            colors = distinct_colors(len(paths))
            offsets = explosion_offsets(self._hulls[name], THUMBNAIL_EXPLOSION)
            shapes = [Convex(str(path)) for path in paths]
            self._register(name, True, list(zip(shapes, offsets, colors, strict=True)))
        except RuntimeError as error:
            raise InvalidInputError(
                f"object {name!r} cannot be shown ({' '.join(str(error).split())}); build the"
                f" library {self._library.name!r} again"
            ) from error

    def _register(
        self, name: str, pieces: bool, shapes: Sequence[tuple[Shape, Array, Rgb | None]]
    ) -> None:
        frame = GeometryFrame(f"{name}/{'pieces' if pieces else 'visual'}")
        self._frames[name, pieces] = self._scene_graph.RegisterFrame(self._source, frame)
        for i, (shape, offset, color) in enumerate(shapes):
            geometry = GeometryInstance(RigidTransform(offset), shape, f"{i}")
            properties = PerceptionProperties()
            properties.AddProperty("label", "id", RenderLabel(OBJECT_LABEL))
            if color is not None:
                properties.AddProperty("phong", "diffuse", Rgba(*color, 1.0))
            geometry.set_perception_properties(properties)
            self._scene_graph.RegisterGeometry(self._source, frame.id(), geometry)

    def _render(self, name: str, pieces: bool, R_WO: Array, size: tuple[int, int]) -> Thumbnail:
        supersampling = 2  # Rendered pixels per pixel, each way, against jagged edges.
        elevation = np.deg2rad(32.0)  # Radians. Shows both the inside and the side of a mug.
        hulls = self._hulls[name]
        if pieces:
            offsets = explosion_offsets(hulls, THUMBNAIL_EXPLOSION)
            hulls = tuple(h + o for h, o in zip(hulls, offsets, strict=True))
            points = np.vstack(hulls)
        else:
            points = np.vstack([*hulls, self._corners[name]])
        R_WC = camera_rotation(elevation)
        yaw = best_yaw(np.vstack(self._hulls[name]) @ R_WO.T, R_WC)
        X_WO = make_pose(rot_z(yaw) @ R_WO)
        X_WO[2, 3] = -transform_points(X_WO, points)[:, 2].min()
        scale = supersampling * np.array(size)
        half = HALF_VIEW_TANGENT * scale / scale[1]
        p_WC = fit_camera(transform_points(X_WO, points), R_WC, MAX_FILLED_SHARE * half)
        X_WC = make_pose(R_WC, p_WC)
        color, label = self._images((name, pieces), X_WO, X_WC, scale)
        cover = (label == OBJECT_LABEL).astype(np.float64)
        focal = scale[1] / 2.0 / HALF_VIEW_TANGENT
        standing = [transform_points(X_WO, hull) for hull in hulls]
        shade = painted_shadow(standing, X_WC, focal, scale)
        shade = 1.0 - (1.0 - shade) * (1.0 - cover)
        image = cv2.resize(color * shade[..., None], size, interpolation=cv2.INTER_AREA)
        cover = cv2.resize(cover, size, interpolation=cv2.INTER_AREA)
        return Thumbnail(np.clip(np.round(image), 0, 255).astype(np.uint8), cover)

    def _images(
        self, shown: tuple[str, bool], X_WO: Array, X_WC: Array, scale: Array
    ) -> tuple[Array, NDArray[np.int16]]:
        """Renders colours (H, W, 3) and labels (H, W) of one object."""
        hidden_pose = RigidTransform([0.0, 0.0, -1e4])  # Beyond the camera's range.
        poses = FramePoseVector()
        for key, frame in self._frames.items():
            poses.set_value(frame, RigidTransform(X_WO) if key == shown else hidden_pose)
        self._scene_graph.get_source_pose_port(self._source).FixValue(self._context, poses)
        query = self._scene_graph.get_query_output_port().Eval(self._context)
        width, height = (int(n) for n in scale)
        focal = height / 2.0 / HALF_VIEW_TANGENT
        info = CameraInfo(width, height, focal, focal, width / 2.0, height / 2.0)
        far = 10.0 * float(np.linalg.norm(X_WC[:3, 3]))
        core = RenderCameraCore("thumbnails", info, ClippingRange(far / 1e3, far), RigidTransform())
        camera = ColorRenderCamera(core, False)
        world, X_PC = self._scene_graph.world_frame_id(), RigidTransform(X_WC)
        color = query.RenderColorImage(camera, world, X_PC).data
        label = query.RenderLabelImage(camera, world, X_PC).data
        return color[..., :3].astype(np.float64), label[..., 0].copy()


def explosion_offsets(hulls: Sequence[Array], share: float) -> list[Array]:
    """Displacements (3,) of convex pieces that open gaps between them.

    Args:
        hulls: (N, 3) corners of each piece [m].
        share: displacement as a share of a piece's distance from the middle of all.
    """
    if len(hulls) < 2:
        return [np.zeros(3) for _ in hulls]
    everything = np.vstack(hulls)
    middle = (everything.min(axis=0) + everything.max(axis=0)) / 2.0
    return [share * (hull.mean(axis=0) - middle) for hull in hulls]
