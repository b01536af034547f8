"""The hand of a station diagram as numbers: links, joints, collision shapes and soft pads."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Literal

import numpy as np
from pydrake.geometry import Box, Convex, Cylinder, GeometryId, Mesh, Sphere, VolumeMesh
from pydrake.multibody.tree import BodyIndex, RigidBody
from scipy.spatial import ConvexHull, QhullError

from burg_drake.core import Array, InvalidInputError, transform_points
from burg_drake.scene import convex_polygon, polygon_area
from burg_drake.station.hand_document import Finger, Hand
from burg_drake.station.hand_model import front_stiffness
from burg_drake.station.station_diagram import FloatingHand, StationDiagram
from burg_drake.station.visible_triangles import hull_vertices


@dataclass(frozen=True, eq=False)
class PadFront:
    """The front of a pad on a link B: the plane of contact with objects.

    Attributes:
        X_BP: (4, 4) frame P in the middle of the smallest bounding rectangle of the front, with x
            and y along its sides and z out of the pad.
        size: extents of the rectangle along x and y [m].
        area: area of the front [m^2].
        stiffness: pressure over depth [N/m^3].
        thickness: thickness of the pad behind the front [m].
        corners: (M, 3) corners of the whole pad's convex hull, in P [m].
    """

    X_BP: Array
    size: tuple[float, float]
    area: float
    stiffness: float
    thickness: float
    corners: Array


def find_pad_front(
    X_BC: Array, volume: VolumeMesh, modulus: float, closing_B: Array, side_B: Array
) -> PadFront:
    """Finds the front of a pad, and its stiffness, see `front_stiffness`.

    Args:
        X_BC: (4, 4) pose of the volume in the link.
        volume: volume mesh of the pad, in C.
        modulus: hydroelastic modulus [Pa].
        closing_B: (3,) unit vector in which the finger closes.
        side_B: (3,) unit vector across it, for the order of the axes of P.

    Raises:
        ValueError: there is no flat front, or the pad is not convex; with the reason.
    """
    flat_tolerance = 1e-5  # Metres behind the foremost point that belong to the front.
    min_area_share = 0.5  # Share of the pad's outline; a smaller front is an edge, or curved.
    max_hull_ratio = 1.01  # Largest ratio of the volumes of the pad's hull and the pad.
    vertices = [volume.vertex(i) for i in range(int(volume.num_vertices()))]
    p_BV = transform_points(X_BC, np.array(vertices))
    hull = ConvexHull(p_BV)
    if hull.volume > max_hull_ratio * volume.CalcVolume():
        raise ValueError("cannot be modelled by springs, as the pad is not convex")
    heights = p_BV @ closing_B
    other_B = np.cross(closing_B, side_B)
    projected = p_BV @ np.stack([side_B, other_B], axis=1)
    front = projected[heights > heights.max() - flat_tolerance]
    outline = _convex_outline(front)
    area, pad_area = (
        0.0 if polygon is None else polygon_area(polygon)
        for polygon in (outline, _convex_outline(projected))
    )
    if outline is None or area < min_area_share * pad_area:
        raise ValueError(
            f"has only {1e6 * area:.0f} mm2 of the pad's {1e6 * pad_area:.0f} mm2 facing the"
            " closing direction; the pad needs a flat front: use a box or a convex mesh"
        )
    R, low, high = _smallest_rectangle(outline)
    middle = (low + high) / 2 @ R
    X_BP = np.eye(4)
    X_BP[:3, 0], X_BP[:3, 1] = (
        np.stack([side_B, other_B]).T @ R[0],
        (np.stack([side_B, other_B]).T @ R[1]),
    )
    X_BP[:3, 2] = closing_B
    X_BP[:3, 3] = middle[0] * side_B + middle[1] * other_B + heights.max() * closing_B
    corners = p_BV[hull.vertices]
    return PadFront(
        X_BP=X_BP,
        size=(float(high[0] - low[0]), float(high[1] - low[1])),
        area=float(area),
        stiffness=front_stiffness(p_BV, closing_B, modulus),
        thickness=float(heights.max() - heights.min()),
        corners=np.asarray((corners - X_BP[:3, 3]) @ X_BP[:3, :3]),
    )


def _convex_outline(points: Array) -> Array | None:
    """Convex outline (N, 2) of points (M, 2), counter-clockwise; None if they are collinear."""
    if len(points) < 3:
        return None
    try:
        return convex_polygon(points)
    except QhullError:
        return None


def _smallest_rectangle(outline: Array) -> tuple[Array, Array, Array]:
    """Axes (2, 2; rows) of the smallest bounding rectangle of an outline, and its lower and upper
    corners (2,) along them; among equal ones the rectangle with the smallest rotation."""
    found = []
    for edge in np.roll(outline, -1, axis=0) - outline:
        angle = np.arctan2(edge[1], edge[0]) % (np.pi / 2)
        angle = angle - np.pi / 2 if angle > np.pi / 4 else angle
        R = np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])
        along = outline @ R.T
        low, high = along.min(axis=0), along.max(axis=0)
        found.append((round(float((high - low).prod()), 12), abs(angle), (R, low, high)))
    return min(found, key=lambda one: one[:2])[2]


HandShapeKind = Literal["box", "sphere", "cylinder", "mesh"]


@dataclass(frozen=True, eq=False)
class HandShape:
    """A convex collision shape of a link B.

    Attributes:
        name: name in the hand's model.
        kind: kind of shape.
        X_BC: (4, 4) pose of the shape.
        size: extents of a box, radius of a sphere, radius and length of a cylinder along z [m].
        points: (N, 3) corners of a mesh in C [m]; empty for other shapes.
        friction: Coulomb coefficient in the model.
    """

    name: str
    kind: HandShapeKind
    X_BC: Array
    size: tuple[float, ...]
    points: Array
    friction: float


@dataclass(frozen=True, eq=False)
class HandLink:
    """A rigid part of a hand, with the frame B.

    Attributes:
        name: name of the link in the model.
        X_HB: (4, 4) pose in the hand's body, with the joint at 0.
        shapes: collision shapes; for a finger, without its pad.
        mass: [kg].
        p_BCm: (3,) centre of mass [m].
        I_BCm: (3, 3) rotational inertia about it, in the axes of B [kg m^2].
    """

    name: str
    X_HB: Array
    shapes: tuple[HandShape, ...]
    mass: float
    p_BCm: Array
    I_BCm: Array


@dataclass(frozen=True, eq=False)
class FingerLink(HandLink):
    """A finger.

    Attributes:
        finger: the finger in the hand's document.
        axis_B: (3,) direction in which the joint moves it.
        pad: the collision shape that touches objects.
        front: front of the pad, if the pad is soft.
    """

    finger: Finger
    axis_B: Array
    pad: HandShape
    front: PadFront


@dataclass(frozen=True, eq=False)
class HandDescription:
    """Links, joints and shapes of a hand.

    Attributes:
        document: the hand's document.
        body: link that the arm carries; its frame is H.
        fingers: both, in the document's order.
        X_WH: (4, 4) pose of the hand in the diagram's default context.
        plant_order: indices of the fingers in the order of the hand's positions in the diagram.
    """

    document: Hand
    body: HandLink
    fingers: tuple[FingerLink, FingerLink]
    X_WH: Array
    plant_order: tuple[int, int]

    @property
    def coupling(self) -> float:
        """Ratio of the second joint's travel to the first one's, for coupled fingers."""
        first, second = self.document.fingers
        return (second.open - second.closed) / (first.open - first.closed)


def read_hand(station_diagram: StationDiagram) -> HandDescription:
    """Reads the hand of a diagram built with `robot="hand"`.

    Raises:
        InvalidInputError: the hand has other moving parts than its two fingers, a shape is unknown
            or not convex, or a pad's front is not flat.
    """
    reader = _HandReader(station_diagram)
    starts = [joint.position_start() for joint in reader.hand.joints]
    return HandDescription(
        reader.hand.document,
        reader.body(),
        (reader.finger(0), reader.finger(1)),
        reader.hand.X_WH(reader.plant_context),
        (0, 1) if starts[0] < starts[1] else (1, 0),
    )


class _HandReader:
    """Reads the hand of a diagram, with both finger joints at 0."""

    def __init__(self, station_diagram: StationDiagram) -> None:
        self.hand = FloatingHand(station_diagram)
        self.plant = plant = station_diagram.plant
        self._inspector = station_diagram.scene_graph.model_inspector()
        self._context = station_diagram.diagram.CreateDefaultContext()
        self.plant_context = plant.GetMyMutableContextFromRoot(self._context)
        for joint in self.hand.joints:
            joint.set_translation(self.plant_context, 0.0)
        robot = set(station_diagram.robot_bodies)
        leads = [self.hand.body, *map(plant.get_body, self.hand.fingers)]
        self._groups = [
            sorted({b.index() for b in plant.GetBodiesWeldedTo(lead)} & robot) for lead in leads
        ]
        self._require_two_joints(robot)

    def body(self) -> HandLink:
        return self._link(self.hand.body, self._groups[0])

    def finger(self, index: int) -> FingerLink:
        finger, pad = self.hand.document.fingers[index], self.hand.pads[index]
        lead = self.plant.get_body(self.hand.fingers[index])
        link = self._link(lead, self._groups[index + 1], (pad,))
        R_BG = link.X_HB[:3, :3].T @ self.hand.document.X_HG.matrix()[:3, :3]
        closing_B = (-1.0, 1.0)[index] * R_BG[:, 0]
        shape = self._shape(lead, pad)
        volume = self._inspector.maybe_get_hydroelastic_mesh(pad)
        modulus = self._modulus(finger, pad)
        try:
            front = find_pad_front(shape.X_BC, volume, modulus, closing_B, R_BG[:, 1])
        except ValueError as error:
            raise self._error(
                f"the front of pad {finger.pad!r} of {link.name!r} {error}"
            ) from error
        return FingerLink(
            **vars(link), finger=finger, axis_B=self._axis(index, lead), pad=shape, front=front
        )

    def _require_two_joints(self, robot: set[BodyIndex]) -> None:
        """Rejects a hand with moving parts besides its two fingers."""
        left = robot.difference(*self._groups)
        chained = any(
            lead in self.plant.GetBodiesKinematicallyAffectedBy([joint.index()])
            for joint, lead in zip(self.hand.joints, reversed(self.hand.fingers), strict=True)
        )
        if left or chained:
            names = ", ".join(sorted(self.plant.get_body(i).name() for i in left))
            raise self._error(
                (
                    f"links {names} have joints of their own besides the two fingers; only"
                    " two fingers may move"
                )
                if left
                else (
                    "one finger is mounted on the other; both must be mounted on the body of"
                    " the hand"
                )
            )

    def _link(
        self, lead: RigidBody, group: list[BodyIndex], without: Iterable[GeometryId] = ()
    ) -> HandLink:
        frame, plant, context = lead.body_frame(), self.plant, self.plant_context
        X_HB = plant.CalcRelativeTransform(context, self.hand.body.body_frame(), frame)
        M_B = plant.CalcSpatialInertia(context, frame, group)
        p_BCm, mass = np.asarray(M_B.get_com()), float(M_B.get_mass())
        I_BCm = M_B.Shift(p_BCm).CalcRotationalInertia().CopyToFullMatrix3()
        shapes = tuple(
            self._shape(lead, geometry)
            for index in group
            for geometry in plant.GetCollisionGeometriesForBody(plant.get_body(index))
            if geometry not in without
        )
        return HandLink(lead.name(), X_HB.GetAsMatrix4(), shapes, mass, p_BCm, np.asarray(I_BCm))

    def _shape(self, lead: RigidBody, geometry: GeometryId) -> HandShape:
        inspector = self._inspector
        body = self.plant.GetBodyFromFrameId(inspector.GetFrameId(geometry))
        X_BL = self.plant.CalcRelativeTransform(
            self.plant_context, lead.body_frame(), body.body_frame()
        )
        X_BC = X_BL.multiply(inspector.GetPoseInFrame(geometry)).GetAsMatrix4()
        shape, name = inspector.GetShape(geometry), inspector.GetName(geometry).split("::")[-1]
        properties = inspector.GetProximityProperties(geometry)
        friction = properties.GetProperty("material", "coulomb_friction").static_friction()
        none = np.zeros((0, 3))
        match shape:
            case Box():
                size = tuple(float(v) for v in shape.size())
                return HandShape(name, "box", X_BC, size, none, friction)
            case Sphere():
                return HandShape(name, "sphere", X_BC, (shape.radius(),), none, friction)
            case Cylinder():
                size = (shape.radius(), shape.length())
                return HandShape(name, "cylinder", X_BC, size, none, friction)
            case Convex() | Mesh():
                return HandShape(name, "mesh", X_BC, (), hull_vertices(shape), friction)
        raise self._error(
            f"collision geometry {name!r} is a {type(shape).__name__}; supported are"
            " boxes, spheres, cylinders and meshes (as their convex hulls)"
        )

    def _axis(self, index: int, lead: RigidBody) -> Array:
        """Direction of a finger's joint, measured by moving the joint."""
        origins = []
        for q in (0.0, 1.0):
            self.hand.joints[index].set_translation(self.plant_context, q)
            X_HB = self.plant.CalcRelativeTransform(
                self.plant_context, self.hand.body.body_frame(), lead.body_frame()
            ).GetAsMatrix4()
            origins.append(X_HB[:3, 3])
        self.hand.joints[index].set_translation(self.plant_context, 0.0)
        return np.asarray(X_HB[:3, :3].T @ (origins[1] - origins[0]))

    def _modulus(self, finger: Finger, pad: GeometryId) -> float:
        properties = self._inspector.GetProximityProperties(pad)
        if not properties.HasProperty("hydroelastic", "hydroelastic_modulus"):
            raise self._error(f"pad {finger.pad!r} has no drake:hydroelastic_modulus")
        return float(properties.GetProperty("hydroelastic", "hydroelastic_modulus"))

    def _error(self, message: str) -> InvalidInputError:
        document = self.hand.document
        return InvalidInputError(f"hand {document.name!r}: {message} ({document.model})")
