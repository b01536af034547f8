"""Paints with Drake's VTK renderer, one engine for all pictures; a painter belongs to the thread
that made it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import cv2
import numpy as np
from pydrake.geometry import (
    ClippingRange,
    ColorRenderCamera,
    FrameId,
    FramePoseVector,
    GeometryFrame,
    GeometryInstance,
    MakeRenderEngineVtk,
    PerceptionProperties,
    RenderCameraCore,
    RenderEngineVtkParams,
    RenderLabel,
    Rgba,
    SceneGraph,
)
from pydrake.math import RigidTransform

from burg_drake.cameras.optics import camera_info
from burg_drake.core import InvalidInputError, MissingDependencyError
from burg_drake.experiment.pages.painting import (
    BACKGROUND,
    NOTHING,
    Painting,
    Viewpoint,
    finer,
)
from burg_drake.experiment.pages.scene_bodies import DrawnBody, PlacedBody
from burg_drake.station.world import LIGHTS
from burg_drake.system_libraries import describe_missing, missing_render_libraries

RENDERER = "trials"
SUPERSAMPLING = 2
"""Pixels rendered for each of a picture, each way, against jagged edges."""
RANGE = ClippingRange(0.02, 20.0)
HIDDEN_POSE = RigidTransform([0.0, 0.0, -1e4])
"""Pose of bodies that a picture does not show, beyond the camera's range."""


class VtkPainter:
    """Paints any of the bodies that it was made for.

    Args:
        stock: by key, each body and how often it may be in one picture.

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
            lights=LIGHTS, default_clear_color=np.array(BACKGROUND), cast_shadows=False
        )
        self._graph.AddRenderer(RENDERER, MakeRenderEngineVtk(parameters))
        self._frames: dict[tuple[str, int], FrameId] = {}
        self._labels: dict[tuple[str, int], int] = {}
        for key, (body, count) in stock.items():
            for number in range(count):
                self._add(key, number, body)
        self._context = self._graph.CreateDefaultContext()

    def paint(self, placed: Sequence[PlacedBody], view: Viewpoint) -> Painting:
        """See `Painter.paint`."""
        used = self._put(placed)
        query = self._graph.get_query_output_port().Eval(self._context)
        info = camera_info(finer(view.intrinsics, SUPERSAMPLING))
        camera = ColorRenderCamera(RenderCameraCore(RENDERER, info, RANGE, RigidTransform()), False)
        world, X_PC = self._graph.world_frame_id(), RigidTransform(view.X_SC)
        color = query.RenderColorImage(camera, world, X_PC).data[..., :3]
        label = query.RenderLabelImage(camera, world, X_PC).data[..., 0]
        size = (view.intrinsics.width, view.intrinsics.height)
        owner = np.full(int(RenderLabel.kMaxUnreserved) + 1, NOTHING, np.int32)
        for index, one in enumerate(used):
            owner[self._labels[one]] = index
        shown = label[::SUPERSAMPLING, ::SUPERSAMPLING]
        known = shown <= int(RenderLabel.kMaxUnreserved)
        return Painting(
            cv2.resize(color, size, interpolation=cv2.INTER_AREA),
            np.where(known, owner[np.where(known, shown, 0)], NOTHING),
        )

    def _add(self, key: str, number: int, body: DrawnBody) -> None:
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

    def _put(self, placed: Sequence[PlacedBody]) -> list[tuple[str, int]]:
        """Poses everything; which frame each placed body has."""
        poses, used, counts = FramePoseVector(), [], dict[str, int]()
        for one in placed:
            key = one.body.key
            used.append((key, counts.get(key, 0)))
            counts[key] = counts.get(key, 0) + 1
            poses.set_value(self._frames[used[-1]], RigidTransform(one.X_SB))
        for name in self._frames.keys() - set(used):
            poses.set_value(self._frames[name], HIDDEN_POSE)
        self._graph.get_source_pose_port(self._source).FixValue(self._context, poses)
        return used
