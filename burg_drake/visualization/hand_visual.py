"""The visual geometry of an open hand, and a gripper in Meshcat that moves from grasp to grasp."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from pydrake.geometry import CalcObb, Convex, Mesh, Meshcat, Rgba, Shape
from pydrake.math import RigidTransform
from pydrake.planning import RobotDiagramBuilder

from burg_drake.core import NO_PACKAGES, Array, Packages, make_pose, transform_points
from burg_drake.station import Hand, add_hand, hull_vertices
from burg_drake.visualization.gltf import gltf_mesh
from burg_drake.visualization.object_drawing import box_corners


@dataclass(frozen=True, eq=False)
class HandVisual:
    """A visual geometry of a hand.

    Attributes:
        shape: shape for Meshcat.
        model: shape of the hand's model, for renderers.
        color: colour, for shapes without colours of their own.
        X_HV: (4, 4) pose on the open hand.
        slide: (3,) displacement in H per metre of closing.
        corners: (N, 3) points with the same bounds, in the shape's frame V [m].
    """

    shape: Shape
    model: Shape
    color: Rgba
    X_HV: Array
    slide: Array
    corners: Array


def hand_visuals(
    hand: Hand, model: Path, *, opacity: float = 1.0, packages: Packages = NO_PACKAGES
) -> tuple[HandVisual, ...]:
    """The visual geometries of an open hand.

    Args:
        hand: the document.
        model: the model file.
        opacity: 0 to 1.
        packages: what a station says of packages.

    Raises:
        InvalidInputError: the model cannot be loaded.
    """
    default_color = Rgba(0.8, 0.8, 0.8, 1.0)
    builder = RobotDiagramBuilder()
    plant = builder.plant()
    added = add_hand(builder, hand, model, packages)
    plant.WeldFrames(plant.world_frame(), added.body.body_frame(), RigidTransform())
    plant.Finalize()
    for finger, joint in zip(hand.fingers, added.joints, strict=True):
        joint.set_default_translation(finger.open)
    diagram = builder.Build()
    context, closed = (
        plant.GetMyMutableContextFromRoot(diagram.CreateDefaultContext()) for _ in range(2)
    )
    for finger, joint in zip(hand.fingers, added.joints, strict=True):
        joint.set_translation(closed, finger.closed)
    stroke = hand.opening[1] - hand.opening[0]
    inspector = diagram.scene_graph().model_inspector()
    visuals = []
    for index in plant.GetBodyIndices(added.instance):
        body = plant.get_body(index)
        X_HB = plant.EvalBodyPoseInWorld(context, body).GetAsMatrix4()
        p_HB_closed = plant.EvalBodyPoseInWorld(closed, body).translation()
        slide = np.round((p_HB_closed - X_HB[:3, 3]) / stroke, 9)
        for geometry in plant.GetVisualGeometriesForBody(body):
            shape = inspector.GetShape(geometry)
            given = inspector.GetIllustrationProperties(geometry).GetPropertyOrDefault(
                "phong", "diffuse", default_color
            )
            color = Rgba(given.r(), given.g(), given.b(), opacity * given.a())
            X_HV = X_HB @ inspector.GetPoseInFrame(geometry).GetAsMatrix4()
            drawn = _meshcat_shape(shape, opacity)
            visuals.append(HandVisual(drawn, shape, color, X_HV, slide, _shape_corners(shape)))
    return tuple(visuals)


def _meshcat_shape(shape: Shape, opacity: float) -> Shape:
    """Converts a shape for Meshcat. Of meshes, only .obj files get the opacity."""
    if isinstance(shape, Mesh) and shape.source().is_path():
        path = Path(shape.source().path())
        if path.suffix.lower() == ".obj" and np.array_equal(shape.scale3(), np.ones(3)):
            return gltf_mesh(path, opacity=opacity)
    return shape


def _shape_corners(shape: Shape) -> Array:
    """Points (N, 3) with the bounds of a shape [m]."""
    if isinstance(shape, Mesh | Convex):
        return hull_vertices(shape)
    box = CalcObb(shape)
    if box is None:  # a half space
        return np.zeros((1, 3))
    half = np.asarray(box.half_width())
    return transform_points(box.pose().GetAsMatrix4(), box_corners(-half, half))


GRIPPER_PATH = "/drake/gripper"


class GripperView:
    """A gripper in Meshcat, hidden until it is placed at a grasp.

    Args:
        meshcat: Meshcat to draw in.
        hand: the document.
        model: the model file.
        packages: what a station says of packages.

    Attributes:
        hand: the document.
        slides: displacement (3,) in H per metre of closing, by Meshcat path of the parts.
        shown: whether the gripper is visible.

    Raises:
        InvalidInputError: the model cannot be loaded.
    """

    def __init__(
        self, meshcat: Meshcat, hand: Hand, model: Path, packages: Packages = NO_PACKAGES
    ) -> None:
        self.hand = hand
        self.slides: dict[str, Array] = {}
        self._meshcat = meshcat
        paths: dict[tuple[float, ...], str] = {}
        for k, visual in enumerate(hand_visuals(hand, model, packages=packages)):
            part = paths.setdefault(tuple(visual.slide), f"{GRIPPER_PATH}/{len(paths)}")
            self.slides[part] = visual.slide
            meshcat.SetObject(f"{part}/{k}", visual.shape, visual.color)
            meshcat.SetTransform(f"{part}/{k}", RigidTransform(visual.X_HV))
        self.hide()

    def hide(self) -> None:
        """Hides the gripper."""
        self._meshcat.SetProperty(GRIPPER_PATH, "visible", False)
        self.shown = False

    def place(self, X_WG: Array, width: float) -> None:
        """Shows the gripper at a grasp (4, 4), closed to a width [m] as far as it can."""
        self._meshcat.SetTransform(GRIPPER_PATH, RigidTransform(self.hand.X_AH(X_WG)))
        for path, slide in self.slides.items():
            shift = self.closing_distance(width) * slide
            self._meshcat.SetTransform(path, RigidTransform(make_pose(p_AB=shift)))
        self._meshcat.SetProperty(GRIPPER_PATH, "visible", True)
        self.shown = True

    def closing_distance(self, width: float) -> float:
        """Closing distance from the open hand to a width [m]."""
        low, high = self.hand.opening
        return high - float(np.clip(width, low, high))
