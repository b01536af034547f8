"""A grasp trial on PyBullet, as a peer of this project's: the way BURG-Toolkit describes it.

Rudorfer et al., "BURG-Toolkit" (2022): a free Panda hand is held by a constraint to the world; the
open hand must not overlap anything; the fingers close for 2 s, the second one follows the first;
the constraint lifts the hand by 0.30 m; both fingers must still touch the object then. Steps are
1/240 s with 100 iterations of the solver, the collision shapes of objects are convex pieces, the
fingers have friction against spinning and friction anchors, and weigh 50 g. All that is as in
BURG-Toolkit; the force of 40 N and the geometry, mass and friction of hand and objects are as in
Drake. Unlike BURG-Toolkit's the world is not loaded anew for every grasp, which would take longer
than the trial. PyBullet is not a dependency of burg_drake; without it `Peer` cannot be made.
"""

from __future__ import annotations

import importlib.util
import tempfile
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
from numpy.typing import NDArray

from burg_drake.core import Array, InvalidInputError, Outcome, make_pose, quaternion_from_rotation
from burg_drake.scene import Scene
from burg_drake.station import Station

STEP = 1.0 / 240.0
FORCE = 40.0
LIFT_HEIGHT, LIFT_TIME = 0.30, 1.25
CLOSE_TIME, HOLD_TIME = 2.0, 0.5
"""Durations of the phases [s]."""
CLOSING_SPEED = 0.1
ITERATIONS = 100
SPINNING, ROLLING = 1.0, 0.0001
"""Coefficients of the fingers [m]."""
BASE_MASS, FINGER_MASS = 0.4, 0.05
"""Of the hand [kg]."""
CARRYING = 1000.0
"""Force by which the constraint holds the hand [N]."""
TOUCHING = 1e-4
"""Closer than this is an overlap of the open hand, less Bullet's collision margin [m]."""


def is_installed() -> bool:
    """Whether `Peer` can be made."""
    return importlib.util.find_spec("pybullet") is not None


class Peer:
    """Executes grasps of one scene on PyBullet.

    Args:
        scene: the scene.
        station: table and hand; its obstacles are left out.

    Raises:
        ImportError: PyBullet is not installed.
        InvalidInputError: the hand is not the Panda's, whose pads are written down here.
    """

    def __init__(self, scene: Scene, station: Station) -> None:
        import pybullet

        if station.hand.name != HAND:
            raise InvalidInputError(
                f"station {station.name!r} has the hand {station.hand.name!r}; PyBullet runs beside"
                f" {HAND!r} alone (without PyBullet installed, every hand is measured)"
            )
        from pybullet_utils.bullet_client import BulletClient

        self._p: Any = BulletClient(pybullet.DIRECT)
        self._constants = pybullet
        self._scene, self._station = scene, station
        self._fingers = (0, 1)
        self._p.setGravity(0.0, 0.0, -9.81)
        self._p.setPhysicsEngineParameter(fixedTimeStep=STEP, numSolverIterations=ITERATIONS)
        self._table = self._add_table()
        with tempfile.TemporaryDirectory() as scratch:
            self._hand = self._add_hand(Path(scratch))
            self._objects = {name: self._add_object(name) for name in scene.instances}

    def run(self, instance: str, X_OG: Array, friction: float | None = None) -> Outcome:
        """Executes a grasp (4, 4) on an instance.

        Args:
            instance: the target.
            X_OG: grasp in its frame.
            friction: the target's coefficient, in place of the library's.
        """
        mu = self._scene.entry(instance).friction if friction is None else friction
        X_WG = self._X_WO(instance) @ X_OG
        target = self._place(instance, X_WG, mu)
        blocked = self._overlap(target)
        if blocked is not None:
            return blocked
        constraint = self._hold_hand()
        try:
            return self._execute(target, constraint)
        finally:
            self._p.removeConstraint(constraint)

    def _execute(self, target: int, constraint: int) -> Outcome:
        self._close()
        left, right = self._touched(target)
        if not (left and right):
            return Outcome.ONE_FINGER if left or right else Outcome.NO_CONTACT
        start, _ = self._p.getBasePositionAndOrientation(self._hand)
        steps = round(LIFT_TIME / STEP)
        for i in range(steps + round(HOLD_TIME / STEP)):
            share = min(1.0, (i + 1) / steps)
            rise = LIFT_HEIGHT * (2 * share**2 if share < 0.5 else 1 - 2 * (1 - share) ** 2)
            pivot = (start[0], start[1], start[2] + rise)
            self._p.changeConstraint(constraint, pivot, self._orientation, maxForce=CARRYING)
            self._step()
            if not any(self._touched(target)):
                return Outcome.SLIPPED if i < steps else Outcome.DROPPED
        return Outcome.LIFTED if all(self._touched(target)) else Outcome.DROPPED

    def _close(self) -> None:
        """One finger is driven, the other one follows it."""
        self._p.setJointMotorControl2(
            self._hand, self._fingers[0], self._constants.VELOCITY_CONTROL,
            targetVelocity=-CLOSING_SPEED, force=FORCE,
        )  # fmt: skip
        for _ in range(round(CLOSE_TIME / STEP)):
            self._step()

    def _step(self) -> None:
        first, second = self._fingers
        self._p.setJointMotorControl2(
            self._hand, second, self._constants.POSITION_CONTROL,
            targetPosition=self._p.getJointState(self._hand, first)[0],
            targetVelocity=2 * CLOSING_SPEED, positionGain=1.8, force=FORCE,
        )  # fmt: skip
        self._p.stepSimulation()

    def _touched(self, target: int) -> tuple[bool, bool]:
        left, right = (
            len(self._p.getContactPoints(self._hand, target, finger)) > 0
            for finger in self._fingers
        )
        return left, right

    def _overlap(self, target: int) -> Outcome | None:
        """What the open hand overlaps."""
        self._p.performCollisionDetection()
        bodies = {target: Outcome.COLLISION_TARGET, self._table: Outcome.COLLISION_TABLE}
        others = dict.fromkeys(self._objects.values(), Outcome.COLLISION_CLUTTER)
        for body, outcome in {**bodies, **{b: o for b, o in others.items() if b != target}}.items():
            points = self._p.getClosestPoints(self._hand, body, 0.0)
            if any(point[8] < -TOUCHING for point in points):
                return outcome
        return None

    def _place(self, instance: str, X_WG: Array, friction: float) -> int:
        """Brings everything to the start of a trial."""
        p = self._p
        for name, body in self._objects.items():
            X_WO = self._X_WO(name)
            p_OOcm = np.array(self._scene.entry(name).mass_properties.center_of_mass)
            p.resetBasePositionAndOrientation(
                body, X_WO[:3, :3] @ p_OOcm + X_WO[:3, 3], quaternion_xyzw(X_WO)
            )
            p.resetBaseVelocity(body, (0, 0, 0), (0, 0, 0))
            # Bullet multiplies two coefficients
            mu = friction if name == instance else self._scene.entry(name).friction
            p.changeDynamics(body, -1, lateralFriction=mu)
        target = self._objects[instance]
        X_WH = self._station.hand.X_AH(X_WG)
        hand_center = X_WH @ make_pose(p_AB=self._hand_center)
        p.resetBasePositionAndOrientation(
            self._hand, hand_center[:3, 3], quaternion_xyzw(hand_center)
        )
        p.resetBaseVelocity(self._hand, (0, 0, 0), (0, 0, 0))
        for finger in self._fingers:
            p.resetJointState(self._hand, finger, self._station.hand.opening[1] / 2, 0.0)
        return target

    def _hold_hand(self) -> int:
        position, self._orientation = self._p.getBasePositionAndOrientation(self._hand)
        constraint = self._p.createConstraint(
            self._hand, -1, -1, -1, self._constants.JOINT_FIXED, (0, 0, 0), (0, 0, 0), position,
            (0, 0, 0, 1), self._orientation,
        )  # fmt: skip
        self._p.changeConstraint(constraint, position, self._orientation, maxForce=CARRYING)
        return int(constraint)

    def _X_WO(self, name: str) -> Array:
        return self._station.document.X_WS.matrix() @ self._scene.X_SO(name)

    def _add_table(self) -> int:
        table = self._station.document.table
        half = np.array(table.size) / 2
        shape = self._p.createCollisionShape(self._constants.GEOM_BOX, halfExtents=half)
        center = (*table.center, -half[2])
        body = self._p.createMultiBody(0.0, shape, basePosition=center)
        self._p.changeDynamics(body, -1, lateralFriction=table.friction)
        return int(body)

    def _add_object(self, name: str) -> int:
        library, entry = self._scene.library, self._scene.entry(name)
        mass, p_OOcm = entry.mass_properties.mass, entry.mass_properties.center_of_mass
        files = [str(library.path(piece)) for piece in entry.pieces]
        shape = self._p.createCollisionShapeArray(
            shapeTypes=[self._constants.GEOM_MESH] * len(files),
            fileNames=files,
            collisionFramePositions=[[-c for c in p_OOcm]] * len(files),
        )
        body = self._p.createMultiBody(mass, shape)
        inertia = np.array(entry.mass_properties.inertia[:3])
        self._p.changeDynamics(
            body, -1, lateralFriction=entry.friction, localInertiaDiagonal=inertia
        )
        return int(body)

    def _add_hand(self, scratch: Path) -> int:
        """The project's own hand model, whose boxes are the same in a URDF."""
        path = scratch / "hand.urdf"
        text, self._hand_center = hand_urdf(self._station)
        path.write_text(text)
        hand = self._p.loadURDF(str(path), flags=self._constants.URDF_USE_INERTIA_FROM_FILE)
        self._p.changeDynamics(hand, -1, mass=BASE_MASS, lateralFriction=1.0)
        for finger in self._fingers:
            self._p.changeDynamics(
                hand, finger, mass=FINGER_MASS, lateralFriction=1.0, spinningFriction=SPINNING,
                rollingFriction=ROLLING, frictionAnchor=True,
            )  # fmt: skip
        for one, other in ((-1, 0), (-1, 1), (0, 1)):
            self._p.setCollisionFilterPair(hand, hand, one, other, 0)
        return int(hand)


def quaternion_xyzw(X_AB: Array) -> NDArray[np.float64]:
    """Orientation of a pose as Bullet wants it."""
    return np.roll(quaternion_from_rotation(X_AB[:3, :3]), -1)


def hand_urdf(station: Station) -> tuple[str, Array]:
    """The hand as a URDF of boxes, and its base's centre of mass (3,) in H [m]."""
    sdf = ElementTree.parse(station.hand_model).getroot()
    links = {link.get("name"): link for link in sdf.iter("link")}
    joints = {joint.get("name"): joint for joint in sdf.iter("joint")}
    body = links[station.hand.body]
    lines = ['<robot name="hand">', link_urdf(body)]
    for finger in station.hand.fingers:
        joint = joints[finger.joint]
        pose = numbers(joint.findtext("pose", "0 0 0 0 0 0"))
        axis = joint.findtext("axis/xyz", "0 1 0")
        lines.append(link_urdf(links[finger.body]))
        lines.append(
            f'<joint name="{finger.joint}" type="prismatic"><parent link="{station.hand.body}"/>'
            f'<child link="{finger.body}"/>{origin(pose)}<axis xyz="{axis}"/>'
            f'<limit lower="{finger.closed}" upper="{finger.open}" effort="100" velocity="1"/>'
            "</joint>"
        )
    lines.append("</robot>")
    return "\n".join(lines), np.array(numbers(body.findtext("inertial/pose", "0 0 0 0 0 0"))[:3])


def link_urdf(link: ElementTree.Element) -> str:
    """A link with its inertia and its collision boxes; a mesh stands for the box about it."""
    pose = numbers(link.findtext("inertial/pose", "0 0 0 0 0 0"))
    moments = {
        key: link.findtext(f"inertial/inertia/{key}", "0")
        for key in ("ixx", "iyy", "izz", "ixy", "ixz", "iyz")
    }
    inertia = " ".join(f'{key}="{value}"' for key, value in moments.items())
    lines = [
        f'<link name="{link.get("name")}"><inertial>{origin(pose)}'
        f'<mass value="{link.findtext("inertial/mass")}"/><inertia {inertia}/></inertial>'
    ]
    for collision in link.iter("collision"):
        size = collision.findtext("geometry/box/size") or PAD_SIZE
        pose = numbers(collision.findtext("pose", "0 0 0 0 0 0"))
        lines.append(
            f'<collision>{origin(pose)}<geometry><box size="{size}"/></geometry></collision>'
        )
    return "".join([*lines, "</link>"])


HAND = "panda_hand"
PAD_SIZE = "0.0175 0.0152 0.0185"
"""Extents of the Panda hand's pads [m], which are meshes in Drake."""


def origin(pose: list[float]) -> str:
    """URDF's element of a pose as SDF writes it."""
    x, y, z, roll, pitch, yaw = pose
    return f'<origin xyz="{x} {y} {z}" rpy="{roll} {pitch} {yaw}"/>'


def numbers(text: str | None) -> list[float]:
    """Numbers of an element's text."""
    return [float(word) for word in (text or "").split()]
