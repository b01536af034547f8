"""Renderers of trial pictures: Drake's VTK renderer, and ray casting where VTK cannot run.

A painter gets placed bodies and a viewpoint. It returns colours and the body at each pixel.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Protocol

import cv2
import numpy as np
from numpy.typing import NDArray
from pydrake.geometry import (
    Box,
    ClippingRange,
    ColorRenderCamera,
    FrameId,
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

from burg_drake.cameras import FieldOfView, Intrinsics, camera_info
from burg_drake.core import (
    CATEGORY_COLORS,
    Array,
    Indices,
    InvalidInputError,
    MissingDependencyError,
    Rgb,
    distinct_colors,
    inverse,
    make_pose,
    transform_points,
)
from burg_drake.geometry import RayCaster
from burg_drake.scene import Scene
from burg_drake.station import (
    DEFAULT_LIGHTS,
    Station,
    SurroundingsProperties,
    Triangles,
    board_meshes,
    shape_triangles,
)
from burg_drake.system_libraries import describe_missing, missing_render_libraries
from burg_drake.visualization import HandVisual, hand_visuals

GROUND_BODY = "ground"  # Name of table, board and obstacles in pictures.
HAND_BODY = "hand"  # Name of the hand in pictures.


@dataclass(frozen=True, eq=False)
class DrawnBody:
    """A shape that a picture may show several times.

    Attributes:
        key: unique key of the body.
        shape: visual shape.
        color: colour; None for the colour of the shape's file.
    """

    key: str
    shape: Shape
    color: Rgb | None = None


@dataclass(frozen=True, eq=False)
class PlacedBody:
    """A body with a pose.

    Attributes:
        name: name of its instance, `hand`, or `ground`.
        body: the body.
        X_SB: (4, 4) pose of the body in the scene frame.
    """

    name: str
    body: DrawnBody
    X_SB: Array


class SceneBodies:
    """Bodies of a scene on a station, including the hand.

    Args:
        scene: the scene.
        station: the station.

    Attributes:
        scene, station: as given.
        standing: all bodies except the hand.

    Raises:
        UnknownNameError: a mesh file of the library is missing.
        InvalidInputError: the hand's model cannot be loaded.
    """

    def __init__(self, scene: Scene, station: Station) -> None:
        self.scene, self.station = scene, station
        self.standing = (*_ground_bodies(scene, station), *_object_bodies(scene))
        self._visuals = hand_visuals(station.hand, station.hand_model, packages=station.packages)
        self._hand = [_hand_body(station, k, visual) for k, visual in enumerate(self._visuals)]

    def hand(self, X_SG: Array, width: float) -> list[PlacedBody]:
        """The hand at a grasp.

        Args:
            X_SG: (4, 4) the grasp.
            width: distance between the pads [m]; NaN for the open hand.
        """
        hand = self.station.hand
        low, high = hand.opening
        closed = 0.0 if np.isnan(width) else high - float(np.clip(width, low, high))
        X_SH = hand.X_AH(X_SG)
        return [
            PlacedBody(HAND_BODY, body, X_SH @ make_pose(p_AB=closed * visual.slide) @ visual.X_HV)
            for body, visual in zip(self._hand, self._visuals, strict=True)
        ]

    def corners(self, X_SG: Array) -> Array:
        """(N, 3) points around the open hand at a grasp, in S [m]."""
        X_SH = self.station.hand.X_AH(X_SG)
        parts = [(X_SH @ v.X_HV, v.corners) for v in self._visuals if len(v.corners)]
        return np.vstack([c @ X[:3, :3].T + X[:3, 3] for X, c in parts])


def _ground_bodies(scene: Scene, station: Station) -> list[PlacedBody]:
    paper_color = (0.95, 0.95, 0.93)  # RGB from 0 to 1.
    # Pale, so that objects stand out from the board, in print as well.
    marker_color = (0.62, 0.62, 0.61)
    table_offset = 1e-3  # Metres below the board at which the table is drawn.
    document = station.document
    X_SW, table = inverse(document.X_WS.matrix()), document.table
    X_WT = make_pose(p_AB=(*table.center, -table.size[2] / 2 - table_offset))
    top = DrawnBody(f"table {table.size}", Box(*table.size), SurroundingsProperties.table_color[:3])
    placed = [PlacedBody(GROUND_BODY, top, X_SW @ X_WT)]
    for part, mesh in board_meshes(scene.board).items():
        color = paper_color if part == "paper" else marker_color
        placed.append(
            PlacedBody(GROUND_BODY, DrawnBody(f"{part} {scene.board}", mesh, color), np.eye(4))
        )
    for box in document.background.values():
        body = DrawnBody(
            f"box {box.size}", Box(*box.size), SurroundingsProperties.obstacle_color[:3]
        )
        placed.append(PlacedBody(GROUND_BODY, body, X_SW @ box.X_WB.matrix()))
    return placed


def _object_bodies(scene: Scene) -> list[PlacedBody]:
    placed = []
    for name in (*scene.instances, *scene.background):
        path = scene.library.path(scene.entry(name).mesh)
        placed.append(
            PlacedBody(name, DrawnBody(f"mesh {path}", Mesh(str(path))), scene.X_SO(name))
        )
    return placed


def _hand_body(station: Station, number: int, visual: HandVisual) -> DrawnBody:
    color = (visual.color.r(), visual.color.g(), visual.color.b())
    has_color = isinstance(visual.model, Mesh)
    key = f"hand {station.hand_model} {number}"
    return DrawnBody(key, visual.model, None if has_color else color)


def count_bodies(pictures: Sequence[Sequence[PlacedBody]]) -> dict[str, tuple[DrawnBody, int]]:
    """Bodies of some pictures, with the maximum number of each in a single picture."""
    found: dict[str, tuple[DrawnBody, int]] = {}
    for picture in pictures:
        counts: dict[str, int] = {}
        for placed in picture:
            key = placed.body.key
            counts[key] = counts.get(key, 0) + 1
            most = found[key][1] if key in found else 0
            found[key] = (placed.body, max(most, counts[key]))
    return found


NO_BODY = -1  # Owner of pixels that show no body.
PICTURE_BACKGROUND = (0.953, 0.961, 0.969)  # RGB from 0 to 1.


@dataclass(frozen=True, eq=False)
class Viewpoint:
    """Camera of a picture.

    Attributes:
        X_SC: (4, 4) pose of the camera's optical frame in the scene frame.
        intrinsics: intrinsics without distortion.
    """

    X_SC: Array
    intrinsics: Intrinsics

    def project(self, p_SQ: Array) -> Array:
        """(..., 2) pixels of points (..., 3) in S [m] in front of the camera."""
        return self.intrinsics.project(transform_points(inverse(self.X_SC), p_SQ))


@dataclass(frozen=True, eq=False)
class Painting:
    """A picture.

    Attributes:
        color: (H, W, 3) RGB.
        owner: (H, W) index of the placed body at each pixel, `NO_BODY` if there is none.
    """

    color: NDArray[np.uint8]
    owner: NDArray[np.int32]

    def visible_pixels(self, placed: Sequence[PlacedBody], name: str) -> NDArray[np.bool_]:
        """(H, W) mask of the pixels that show a body of this name."""
        indices = [i for i, one in enumerate(placed) if one.name == name]
        return np.isin(self.owner, indices)


class Painter(Protocol):
    """Paints pictures of bodies."""

    def paint(self, placed: Sequence[PlacedBody], view: Viewpoint) -> Painting:
        """Renders bodies from a viewpoint."""
        ...


def supersampled_intrinsics(intrinsics: Intrinsics, times: int) -> Intrinsics:
    """The same camera with `times` times as many pixels in each direction; pixel centres are at
    integers.
    """
    (fx, fy), (cx, cy) = intrinsics.focal, intrinsics.center
    return Intrinsics(
        width=times * intrinsics.width,
        height=times * intrinsics.height,
        focal=(times * fx, times * fy),
        center=(times * (cx + 0.5) - 0.5, times * (cy + 0.5) - 0.5),
    )


class RayPainter:
    """Paints any bodies by ray casting."""

    def __init__(self) -> None:
        self._triangles: dict[str, Triangles] = {}

    def paint(self, placed: Sequence[PlacedBody], view: Viewpoint) -> Painting:
        """See `Painter.paint`."""
        to_light = np.array([0.35, -0.45, 0.82])  # Direction of the light in S.
        ambient = 0.45  # Brightness of surfaces in shadow.
        vertices, faces, owner = self.joined(placed)
        directions = FieldOfView(view.intrinsics).directions
        rays = (directions / np.linalg.norm(directions, axis=-1, keepdims=True)).reshape(-1, 3)
        rays = rays @ view.X_SC[:3, :3].T
        start = np.broadcast_to(view.X_SC[:3, 3], rays.shape)
        face, _ = RayCaster(vertices, faces).first_hits(start, rays)
        colors = np.array(_body_colors(placed))[owner]
        corners = vertices[faces]
        normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-30)
        lit = np.abs(normals @ (to_light / np.linalg.norm(to_light)))
        colors = colors * (ambient + (1.0 - ambient) * lit)[:, None]
        image = np.where((face >= 0)[:, None], colors[face], PICTURE_BACKGROUND)
        shape = directions.shape[:2]
        return Painting(
            np.round(255.0 * image.reshape(*shape, 3)).astype(np.uint8),
            np.where(face >= 0, owner[face], NO_BODY).reshape(shape).astype(np.int32),
        )

    def joined(self, placed: Sequence[PlacedBody]) -> tuple[Array, Indices, Indices]:
        """Bodies as one mesh.

        Returns:
            (V, 3) vertices in S [m], (F, 3) faces, (F,) index of the body that a face belongs to.
        """
        vertices, faces, owner, first = [], [], [], 0
        for index, one in enumerate(placed):
            if one.body.key not in self._triangles:
                self._triangles[one.body.key] = shape_triangles(one.body.shape)
            corners, triangles = self._triangles[one.body.key]
            vertices.append(transform_points(one.X_SB, corners))
            faces.append(triangles + first)
            owner.append(np.full(len(triangles), index))
            first += len(corners)
        return np.concatenate(vertices), np.concatenate(faces), np.concatenate(owner)


def _body_colors(placed: Sequence[PlacedBody]) -> list[tuple[float, float, float]]:
    hand_color = (0.86, 0.87, 0.88)  # RGB from 0 to 1.
    names = list(
        dict.fromkeys(one.name for one in placed if one.name not in (GROUND_BODY, HAND_BODY))
    )
    further = distinct_colors(len(names))
    colors = {
        name: CATEGORY_COLORS[i][:3] if i < len(CATEGORY_COLORS) else further[i]
        for i, name in enumerate(names)
    }
    return [colors.get(one.name, one.body.color or hand_color) for one in placed]


class VtkPainter:
    """Paints bodies of a fixed stock by VTK.

    Args:
        stock: each body and its maximum number in one picture, by key of the body.

    Raises:
        MissingDependencyError: a system library of the renderer is missing (it would crash).
        InvalidInputError: Drake cannot load a mesh.
    """

    def __init__(self, stock: Mapping[str, tuple[DrawnBody, int]]) -> None:
        missing = missing_render_libraries()
        if missing:
            raise MissingDependencyError(describe_missing(missing))
        self._graph = SceneGraph()
        self._source = self._graph.RegisterSource("trials")
        parameters = RenderEngineVtkParams(
            lights=DEFAULT_LIGHTS,
            default_clear_color=np.array(PICTURE_BACKGROUND),
            cast_shadows=False,
        )
        self._graph.AddRenderer("trials", MakeRenderEngineVtk(parameters))
        self._frames: dict[tuple[str, int], FrameId] = {}
        self._labels: dict[tuple[str, int], int] = {}
        for key, (body, count) in stock.items():
            for number in range(count):
                self._add_body(key, number, body)
        self._context = self._graph.CreateDefaultContext()

    def paint(self, placed: Sequence[PlacedBody], view: Viewpoint) -> Painting:
        """See `Painter.paint`."""
        supersampling = 2  # Rendered pixels for each pixel of the picture, in each direction.
        clipping = ClippingRange(0.02, 20.0)  # Metres.
        used = self._place_bodies(placed)
        query = self._graph.get_query_output_port().Eval(self._context)
        info = camera_info(supersampled_intrinsics(view.intrinsics, supersampling))
        camera = ColorRenderCamera(
            RenderCameraCore("trials", info, clipping, RigidTransform()), False
        )
        world, X_PC = self._graph.world_frame_id(), RigidTransform(view.X_SC)
        color = query.RenderColorImage(camera, world, X_PC).data[..., :3]
        label = query.RenderLabelImage(camera, world, X_PC).data[..., 0]
        size = (view.intrinsics.width, view.intrinsics.height)
        owner = np.full(int(RenderLabel.kMaxUnreserved) + 1, NO_BODY, np.int32)
        for index, one in enumerate(used):
            owner[self._labels[one]] = index
        shown = label[::supersampling, ::supersampling]
        known = shown <= int(RenderLabel.kMaxUnreserved)
        return Painting(
            cv2.resize(color, size, interpolation=cv2.INTER_AREA),
            np.where(known, owner[np.where(known, shown, 0)], NO_BODY),
        )

    def _add_body(self, key: str, number: int, body: DrawnBody) -> None:
        frame = GeometryFrame(f"{len(self._frames)}")
        self._frames[key, number] = self._graph.RegisterFrame(self._source, frame)
        self._labels[key, number] = label = len(self._frames)
        geometry = GeometryInstance(RigidTransform(), body.shape, "visual")
        perception = PerceptionProperties()
        perception.AddProperty("label", "id", RenderLabel(label))
        if body.color is not None:
            perception.AddProperty("phong", "diffuse", Rgba(*body.color, 1.0))
        geometry.set_perception_properties(perception)
        try:
            self._graph.RegisterGeometry(self._source, frame.id(), geometry)
        except RuntimeError as error:
            raise InvalidInputError(
                f"{key} cannot be shown: {' '.join(str(error).split())}"
            ) from error

    def _place_bodies(self, placed: Sequence[PlacedBody]) -> list[tuple[str, int]]:
        """Sets the poses of all bodies; returns the key and number of each placed body."""
        # Pose of hidden bodies, beyond the camera's range.
        hidden_pose = RigidTransform([0.0, 0.0, -1e4])
        poses, used, counts = FramePoseVector(), [], dict[str, int]()
        for one in placed:
            key = one.body.key
            used.append((key, counts.get(key, 0)))
            counts[key] = counts.get(key, 0) + 1
            poses.set_value(self._frames[used[-1]], RigidTransform(one.X_SB))
        for name in self._frames.keys() - set(used):
            poses.set_value(self._frames[name], hidden_pose)
        self._graph.get_source_pose_port(self._source).FixValue(self._context, poses)
        return used
