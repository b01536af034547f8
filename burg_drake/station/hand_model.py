"""The hand in a plant: servos, force limits, coupling, and a check of document against model."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Literal

import numpy as np
from pydrake.geometry import Convex, GeometryId, Mesh, SceneGraphInspector, VolumeMesh
from pydrake.math import RigidTransform
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import (
    JointActuator,
    ModelInstanceIndex,
    PdControllerGains,
    PrismaticJoint,
    RigidBody,
)
from pydrake.planning import RobotDiagramBuilder
from pydrake.systems.analysis import Simulator
from scipy.spatial import ConvexHull

from burg_drake.core import (
    NO_PACKAGES,
    Array,
    InvalidInputError,
    Packages,
    content_hash,
    inverse,
    referenced_files,
    referenced_packages,
    suggest_names,
    transform_points,
)
from burg_drake.formats import Gripper, GripperJoint
from burg_drake.station.hand_document import Finger, Hand
from burg_drake.station.model_file import (
    add_models,
    buffer_drake_log,
    require_free_model,
    without_hydroelastic,
)
from burg_drake.station.station_document import Station
from burg_drake.station.visible_triangles import hull_vertices

STALL_FORCE_RATIO = 1.25
"""Ratio of the servo's force at standstill to the grip force. Above 1, the grip force is the force
limit."""


@dataclass(frozen=True, eq=False)
class HandModel:
    """A hand in a plant.

    Attributes:
        instance: its model instance.
        body: the link that the arm carries.
        fingers, joints, pads: bodies, joints and pads of the two fingers, in the order of the
            document.
    """

    instance: ModelInstanceIndex
    body: RigidBody
    fingers: tuple[RigidBody, RigidBody]
    joints: tuple[PrismaticJoint, PrismaticJoint]
    pads: tuple[GeometryId, GeometryId]


def add_hand(
    builder: RobotDiagramBuilder,
    hand: Hand,
    path: Path,
    packages: Packages = NO_PACKAGES,
    *,
    simulated: bool = True,
) -> HandModel:
    """Adds a hand with its servos.

    Args:
        builder: builder whose plant is not finalized.
        hand: the document.
        path: the model file.
        packages: the station's package folders.
        simulated: whether contact will be simulated.

    Raises:
        InvalidInputError: the model cannot be loaded, is fixed in the world, lacks a name from the
            document, or is weaker or slower than the document says.
    """
    plant = builder.plant()
    constraints = plant.num_constraints()
    try:
        edit = None if simulated else without_hydroelastic
        (instance,) = add_models(builder.parser(), path, packages, edit=edit)
    except InvalidInputError:
        raise
    except (RuntimeError, ValueError) as error:
        raise InvalidInputError(
            f"hand {hand.name!r}: {path} cannot be loaded as one model"
            f" ({' '.join(str(error).split())})"
        ) from error
    require_free_model(plant, instance, path)
    found = find_hand(plant, builder.scene_graph().model_inspector(), hand, instance)
    for finger, joint in zip(hand.fingers, found.joints, strict=True):
        _add_servo(plant, hand, finger, joint)
    driven = [a.joint().name() for a in _all_actuators(plant) if a.model_instance() == instance]
    if len(driven) != 2:
        raise InvalidInputError(
            f"hand {hand.name!r}: {hand.model} has actuators for "
            f"{', '.join(sorted(driven))}; only the joints of the two fingers may have"
            " one"
        )
    if hand.coupled and plant.num_constraints() == constraints:
        first, second = hand.fingers
        ratio = (first.open - first.closed) / (second.open - second.closed)
        offset = first.closed - ratio * second.closed
        plant.AddCouplerConstraint(*found.joints, ratio, offset)
    return found


def find_hand(
    plant: MultibodyPlant, inspector: SceneGraphInspector, hand: Hand, instance: ModelInstanceIndex
) -> HandModel:
    """Finds the links, joints and pads of a hand document in a plant.

    Raises:
        InvalidInputError: the model has no such link, joint or pad.
    """
    bodies = {b.name(): b for b in map(plant.get_body, plant.GetBodyIndices(instance))}
    joints = {j.name(): j for j in map(plant.get_joint, plant.GetJointIndices(instance))}
    sliding = {name: j for name, j in joints.items() if isinstance(j, PrismaticJoint)}

    def pad(index: int, finger: Finger, body: RigidBody) -> GeometryId:
        geometries = {
            inspector.GetName(g).split("::")[-1]: g
            for g in plant.GetCollisionGeometriesForBody(body)
        }
        _require_known_name(hand, f"fingers[{index}].pad", finger.pad, geometries)
        return geometries[finger.pad]

    _require_known_name(hand, "body", hand.body, bodies)
    for i, finger in enumerate(hand.fingers):
        _require_known_name(hand, f"fingers[{i}].body", finger.body, bodies)
        if finger.joint in joints and finger.joint not in sliding:
            kind = joints[finger.joint].type_name()
            raise InvalidInputError(
                f"hand {hand.name!r}: fingers[{i}].joint {finger.joint!r} is {kind} in its model"
                f" {hand.model}; fingers have to be on prismatic joints: model a hand whose fingers"
                " turn by two that slide, with the pads of the real one"
                " (https://burg-drake.github.io/burg_drake/reference/hands.html)"
            )
        _require_known_name(hand, f"fingers[{i}].joint", finger.joint, sliding)
    one, other = hand.fingers
    return HandModel(
        instance=instance,
        body=bodies[hand.body],
        fingers=(bodies[one.body], bodies[other.body]),
        joints=(sliding[one.joint], sliding[other.joint]),
        pads=(pad(0, one, bodies[one.body]), pad(1, other, bodies[other.body])),
    )


def _require_known_name(hand: Hand, key: str, name: str, known: Iterable[str]) -> None:
    if name not in known:
        raise InvalidInputError(
            f"hand {hand.name!r}: {key} {name!r} is not in its model {hand.model};"
            f" {suggest_names(name, known)}"
        )


def _add_servo(plant: MultibodyPlant, hand: Hand, finger: Finger, joint: PrismaticJoint) -> None:
    """Adds a finger's velocity servo, and an actuator if the model has none."""
    own = (a for a in _all_actuators(plant) if a.joint().index() == joint.index())
    actuator = next(own, None) or plant.AddJointActuator(joint.name(), joint)
    if hand.force > actuator.effort_limit():
        raise InvalidInputError(
            f"hand {hand.name!r}: force is {hand.force:g} N, but the effort limit of"
            f" joint {finger.joint!r} in {hand.model} is {actuator.effort_limit():g} N"
        )
    fastest = float(joint.velocity_upper_limits()[0])
    if hand.closing_speed > fastest:
        raise InvalidInputError(
            f"hand {hand.name!r}: closing_speed is {hand.closing_speed:g} m/s, but the"
            f" velocity limit of joint {finger.joint!r} in {hand.model} is {fastest:g}"
            " m/s"
        )
    gain = STALL_FORCE_RATIO * hand.force / hand.closing_speed
    actuator.set_controller_gains(PdControllerGains(p=0.0, d=gain))
    actuator.set_effort_limit(hand.force)


def _all_actuators(plant: MultibodyPlant) -> list[JointActuator]:
    return [plant.get_joint_actuator(index) for index in plant.GetJointActuatorIndices()]


LENGTH_TOLERANCE = 5e-4  # Metres: tolerance for lengths in document and model.
TIME_STEP = 1e-3  # Seconds.
COUPLING_STEPS = 20  # Time steps in which released fingers are checked for coupling.
REST_TOLERANCE = 1e-6  # Metres that a finger at rest may move in these steps.
FINGER_DISPLACEMENT = 2e-3  # Metres by which one finger is displaced.


@dataclass(frozen=True)
class HandFigures:
    """Dimensions of a hand, and stiffness of its pads.

    Attributes:
        opening: smallest and largest distance between the pads [m].
        pad_bounds: smallest and largest coordinates of the first pad in the grasp frame G [m];
            those along x depend on how far the hand is open.
        pad_stiffness: pressure of the first pad over the depth behind its front [N/m^3].
    """

    opening: tuple[float, float]
    pad_bounds: tuple[tuple[float, float, float], tuple[float, float, float]]
    pad_stiffness: float

    @property
    def pad_size(self) -> tuple[float, float, float]:
        """Extents of the first pad in G [m]."""
        (x0, y0, z0), (x1, y1, z1) = self.pad_bounds
        return x1 - x0, y1 - y0, z1 - z0


def check_hand(
    hand: Hand, path: Path, document: Path | None = None, packages: Packages = NO_PACKAGES
) -> HandFigures:
    """Checks a hand document against its model file; valid pairs are cached.

    Args:
        hand: the document.
        path: the model file.
        document: the document's file, for messages.
        packages: the station's package folders.

    Raises:
        InvalidInputError: document and model differ; the message says where.
    """
    try:
        package_folders = tuple(sorted(referenced_packages(path, packages).items()))
        return _check_document(
            hand, path, content_hash([path, *referenced_files(path, packages)]), package_folders
        )
    except InvalidInputError as error:
        if document is None:
            raise
        raise InvalidInputError(f"{document}: {error}") from error


@lru_cache(maxsize=16)
def _check_document(
    hand: Hand, path: Path, content: str, package_folders: tuple[tuple[str, Path], ...]
) -> HandFigures:
    bench = _HandBench(hand, path, Packages(dict(package_folders)))
    bench.check_limits()
    bench.check_pads()
    bench.check_closing_direction()
    largest, smallest = bench.check_opening("open"), bench.check_opening("closed")
    bench.check_approach()
    bench.check_coupling()
    (x0, y0, z0), (x1, y1, z1) = bench.bounds(0).tolist()
    bounds = (x0, y0, z0), (x1, y1, z1)
    return HandFigures((smallest, largest), bounds, bench.pad_stiffness())


def front_stiffness(vertices: Array, closing: Array, modulus: float) -> float:
    """Pressure over the depth behind the front of a pad [N/m^3].

    The pressure of Drake's elastic volumes grows from 0 at the surface to the modulus at the vertex
    farthest inside; behind a front it grows evenly up to the first vertices inside.

    Args:
        vertices: (N, 3) vertices of the pad's volume mesh [m].
        closing: (3,) unit vector in which the finger closes.
        modulus: hydroelastic modulus [Pa].

    Raises:
        ValueError: the mesh has no inner vertex.
    """
    surface_tolerance = 1e-5  # Metres.
    planes = ConvexHull(vertices).equations
    inside = -(vertices @ planes[:, :3].T + planes[:, 3]).max(axis=1)
    within = inside > surface_tolerance
    if not within.any():
        raise ValueError("has no inner vertex of the pad's volume mesh behind it")
    heights = vertices @ closing
    depth = heights.max() - heights
    first = np.flatnonzero(within)[np.argmin(depth[within])]
    return float(modulus * inside[first] / inside.max() / depth[first])


class _HandBench:
    """Test plant with the hand alone, its body fixed, without gravity."""

    def __init__(self, hand: Hand, path: Path, packages: Packages) -> None:
        self._hand = hand
        builder = RobotDiagramBuilder(time_step=TIME_STEP)
        self._plant = plant = builder.plant()
        with buffer_drake_log():  # discarded: `add_hand` logs them in scenes
            instance = add_hand(builder, hand, path, packages).instance
        body = plant.GetBodyByName(hand.body, instance)
        plant.WeldFrames(plant.world_frame(), body.body_frame(), RigidTransform())
        plant.mutable_gravity_field().set_gravity_vector([0.0, 0.0, 0.0])
        plant.Finalize()
        self._diagram = builder.Build()
        self._inspector = self._diagram.scene_graph().model_inspector()
        self._model = find_hand(plant, self._inspector, hand, instance)
        self._simulator = Simulator(self._diagram)
        self._plant_context = plant.GetMyMutableContextFromRoot(
            self._simulator.get_mutable_context()
        )

    def check_limits(self) -> None:
        """Requires `closed` and `open` within the joints' limits."""
        for i, (finger, joint) in enumerate(
            zip(self._hand.fingers, self._model.joints, strict=True)
        ):
            low, high = joint.position_lower_limits()[0], joint.position_upper_limits()[0]
            for key in ("closed", "open"):
                q = getattr(finger, key)
                if not low - LENGTH_TOLERANCE <= q <= high + LENGTH_TOLERANCE:
                    raise self._error(
                        f"fingers[{i}].{key} is {q:g} m, but joint {finger.joint!r} goes"
                        f" from {low:g} to {high:g} m"
                    )

    def check_pads(self) -> None:
        """Requires pads with an elastic volume, as others have only point contact with rigid
        objects."""
        for i, pad in enumerate(self._model.pads):
            if not isinstance(self._inspector.maybe_get_hydroelastic_mesh(pad), VolumeMesh):
                raise self._error(
                    f"fingers[{i}].pad {self._hand.fingers[i].pad!r} is not compliant; give it"
                    " drake:compliant_hydroelastic and a drake:hydroelastic_modulus (1e7 for"
                    " rubber) in its drake:proximity_properties"
                )

    def check_closing_direction(self) -> None:
        """Requires fingers that move apart along x of G, in either order."""
        gaps = []
        for closed in (0.0, 1.0):
            self._set_positions(self._joint_positions(closed))
            one, other = (self.bounds(i).mean(axis=0) for i in (0, 1))
            gaps.append(one - other)
        gap = gaps[0] - gaps[1]
        if np.hypot(gap[1], gap[2]) > LENGTH_TOLERANCE:
            x, y, z = np.round(gap / np.linalg.norm(gap), 2) + 0.0
            raise self._error(
                "x of G is not the closing direction: the fingers open along"
                f" ({x:.2f}, {y:.2f}, {z:.2f}) of G; turn X_HG"
            )

    def check_opening(self, end: Literal["open", "closed"]) -> float:
        """Requires pads on both sides of G, as far apart as the document says, with the fingers
        open or closed; returns their distance [m]."""
        opening = self._hand.opening[1 if end == "open" else 0]
        self._set_positions(self._joint_positions(0.0 if end == "open" else 1.0))
        one, other = self.bounds(0), self.bounds(1)
        if one[:, 0].mean() < other[:, 0].mean() - LENGTH_TOLERANCE:
            raise self._error(
                "the first finger is on the side of -x of G; exchange the fingers, or turn X_HG by"
                " 180 deg about its z"
            )
        distance, middle = one[0, 0] - other[1, 0], (one[0, 0] + other[1, 0]) / 2
        if abs(distance - opening) > LENGTH_TOLERANCE:
            raise self._error(
                f"with both fingers {end} the pads are {_format_mm(distance)} apart along x of"
                f" G, but opening says {_format_mm(opening)}"
            )
        if abs(middle) > LENGTH_TOLERANCE:
            raise self._error(
                f"with both fingers {end} the middle between the pads is at x = "
                f"{_format_mm(middle)} of G; it must be at 0"
            )
        for i, bounds in enumerate((one, other)):
            for name, (low, high) in zip("yz", bounds.T[1:], strict=True):
                if not low - LENGTH_TOLERANCE <= 0.0 <= high + LENGTH_TOLERANCE:
                    raise self._error(
                        f"G is not between the pads: with both fingers {end} the pad of"
                        f" fingers[{i}] reaches from {_format_mm(low)} to {_format_mm(high)} along"
                        f" {name} of G"
                    )
        return float(distance)

    def check_approach(self) -> None:
        """Requires the hand's body behind G along +z."""
        X_GH = inverse(self._hand.X_HG.matrix())
        geometries = self._plant.GetCollisionGeometriesForBody(self._model.body)
        heights = [self._corners(X_GH, geometry)[:, 2].mean() for geometry in geometries]
        if heights and max(heights) > 0.0:
            raise self._error(
                f"+z of G, the approach direction, points towards {self._hand.body!r}; turn X_HG"
            )

    def check_coupling(self) -> None:
        """Requires that fingers stay at positions of the document, and that a coupled finger
        follows when the other one is displaced."""
        one, other = self._joint_positions(0.5)
        aside = one + FINGER_DISPLACEMENT * np.sign(
            self._hand.fingers[0].open - self._hand.fingers[0].closed
        )
        follows = self._is_second_finger_moving((aside, other))
        if follows and not self._hand.coupled:
            raise self._error(
                "coupled is false, but in the model one finger follows the other; write"
                " coupled: true"
            )
        if not follows and self._hand.coupled:
            raise self._error(
                "coupled is true, but no constraint of the model couples the fingers; write"
                " coupled: false"
            )
        for closed in (0.25, 0.75):
            if self._is_second_finger_moving(self._joint_positions(closed)):
                raise self._error(
                    "the mimic joint of the model moves the fingers in another"
                    " proportion than closed and open of the two fingers say"
                )

    def bounds(self, index: int) -> Array:
        """Smallest and largest coordinates (2, 3) of a finger's pad in G [m], at its current
        position."""
        p_GV = self._corners(self._X_GB(index), self._model.pads[index])
        return np.stack([p_GV.min(axis=0), p_GV.max(axis=0)])

    def _X_GB(self, index: int) -> Array:
        """Pose (4, 4) of a finger in G, at its current position."""
        X_HB = self._plant.CalcRelativeTransform(
            self._plant_context,
            self._model.body.body_frame(),
            self._model.fingers[index].body_frame(),
        )
        X_GB: Array = inverse(self._hand.X_HG.matrix()) @ X_HB.GetAsMatrix4()
        return X_GB

    def pad_stiffness(self) -> float:
        """Pressure of the first pad over the depth behind its front [N/m^3].

        Without a volume mesh, the pressure counts as the modulus at half of the pad's thickness.
        """
        pad, (low, high) = self._model.pads[0], self.bounds(0)
        properties = self._inspector.GetProximityProperties(pad)
        modulus = float(properties.GetProperty("hydroelastic", "hydroelastic_modulus"))
        mesh = self._inspector.maybe_get_hydroelastic_mesh(pad)
        if not isinstance(mesh, VolumeMesh):
            return modulus / (0.5 * float((high - low).min()))
        X_GC = self._X_GB(0) @ self._inspector.GetPoseInFrame(pad).GetAsMatrix4()
        vertices = np.array([mesh.vertex(k) for k in range(mesh.num_vertices())])
        # The first finger closes towards -x of G.
        return front_stiffness(transform_points(X_GC, vertices), np.array([-1.0, 0, 0]), modulus)

    def _corners(self, X_GB: Array, geometry: GeometryId) -> Array:
        """Corners (N, 3) of a geometry of body B in G [m]; of a round one, corners of its bounding
        box."""
        X_BC = self._inspector.GetPoseInFrame(geometry).GetAsMatrix4()
        shape = self._inspector.GetShape(geometry)
        if isinstance(shape, (Mesh, Convex)):
            return transform_points(X_GB @ X_BC, hull_vertices(shape))
        box = self._inspector.GetObbInGeometryFrame(geometry)
        corners = np.array(np.meshgrid(*[(-1.0, 1.0)] * 3)).reshape(3, -1).T * box.half_width()
        return transform_points(X_GB @ X_BC @ box.pose().GetAsMatrix4(), corners)

    def _joint_positions(self, closed: float) -> tuple[float, float]:
        """Joint positions [m] for a closing ratio from 0 (open) to 1 (closed)."""
        one, other = (finger.position(closed) for finger in self._hand.fingers)
        return one, other

    def _set_positions(self, positions: tuple[float, float]) -> None:
        for joint, position in zip(self._model.joints, positions, strict=True):
            joint.set_translation(self._plant_context, position)
            joint.set_translation_rate(self._plant_context, 0.0)

    def _is_second_finger_moving(self, positions: tuple[float, float]) -> bool:
        """Whether the second finger moves when both are released at positions."""
        self._simulator.get_mutable_context().SetTime(0.0)
        self._set_positions(positions)
        self._simulator.Initialize()
        self._simulator.AdvanceTo(COUPLING_STEPS * TIME_STEP)
        q = self._model.joints[1].get_translation(self._plant_context)
        return bool(abs(q - positions[1]) > REST_TOLERANCE)

    def _error(self, message: str) -> InvalidInputError:
        return InvalidInputError(f"hand {self._hand.name!r}: {message} ({self._hand.model})")


def _format_mm(length: float) -> str:
    return f"{round(1e3 * length, 1) + 0.0:.1f} mm"


def gripper_of(
    hand: Hand, path: Path, document: Path | None = None, packages: Packages = NO_PACKAGES
) -> Gripper:
    """Converts a hand to a `Gripper` of `formats`; its fingertips are the ends of the model's pads.

    Args:
        hand: the document.
        path: the model file.
        document: the document's file, for messages.
        packages: the station's package folders.

    Raises:
        InvalidInputError: the document does not fit the model.
    """
    figures = check_hand(hand, path, document, packages)
    return Gripper(
        name=hand.name,
        body=hand.body,
        X_HG=hand.X_HG.matrix(),
        tip=figures.pad_bounds[1][2],
        opening=hand.opening,
        joints=tuple(GripperJoint(f.joint, f.closed, f.open) for f in hand.fingers),
    )


def station_gripper(station: Station) -> Gripper:
    """The `Gripper` of a station's hand; see `gripper_of`."""
    return gripper_of(station.hand, station.hand_model, station.hand_path, station.packages)
