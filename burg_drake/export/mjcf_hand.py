"""A hand in MJCF: its links on a carrier, servos as in Drake, and soft pads.

Each pad's front is a grid of soft spheres. They bear load over an area, and their friction
resists torque about the normal. A rigid backing behind them has the shape of the pad. The
constants were tuned against a contact oracle (benchmarks/contact_oracle.py): 68 of its 72 grasps
come out right; with half of the pads' damping 67, with a fifth of it 63, with twice as much 68.
With spheres of equal size it was 69, and 64 at a time step of 2 ms. Spheres of 2 to 6 mm, and 8 x 8
instead of 6 x 6 on the Panda's pads, give as many. At a friction impedance ratio of 1000 an object
of 1.5 kg creeps by 35 um/s; at 10 a third of the grasps that hold are lost.

MuJoCo solves contact before it makes the servos implicit. Without the inertia of a drive, a servo
would make a finger of 15 g unstable.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from xml.etree.ElementTree import Element, SubElement

import numpy as np
from scipy.spatial import ConvexHull

from burg_drake.core import Array, make_pose
from burg_drake.export.mjcf_objects import (
    add_body,
    box_attributes,
    format_numbers,
    inertia_attributes,
    pose_attributes,
    round_shape_attributes,
)
from burg_drake.station import STALL_FORCE_RATIO, HandDescription, HandLink, HandShape, PadFront

MUJOCO_TIME_STEP = 0.001
"""Seconds; with 2 ms, grasps that pivot between the pads are lost."""
RIGID_CONTACT_SOLREF = "0.005 1"
"""Time constant in seconds, and damping ratio, of contacts without a pad."""
FINGER_DRIVE_INERTIA = 1.0
"""Kilograms; without it the velocity servos of light fingers are unstable."""

HAND_CARRIER_BODY = "hand carrier"  # Name of the body that carries the hand.
HAND_PREFIX = "hand"  # First word of all other names of the hand.
PAD_SPHERE_PREFIX = f"{HAND_PREFIX} sphere"
"""Start of the names of pad spheres; the link and a number follow."""
PAD_BACKING_PREFIX = f"{HAND_PREFIX} back"
"""Start of the names of pad backings; the link and a number follow."""
HAND_SHAPE_PREFIX = f"{HAND_PREFIX} shape"
"""Start of the names of other geoms; the link and a number follow."""


OBJECT_BIT, HAND_BIT, TABLE_BIT = 1, 2, 4
"""Bits of `contype` and `conaffinity`; the hand does not collide with itself."""


@dataclass(frozen=True)
class CarrierJoint:
    """A joint of the carrier and its servos, which share its name.

    Attributes:
        name: name of the joint and of its position servo.
        axis: (3,) axis in the world at the carrier's start pose.
        speed: name of the velocity servo.
        inertia: inertia of the drive [kg].
        rate: rate of the critically damped servos [1/s]. As contact is solved before servos are
            made implicit, a held object is ahead of the hand while the hand accelerates, and
            creeps, faster at higher rates: at 50 by 2 mm/s in a usual lift.
    """

    name: str
    axis: tuple[float, float, float]
    speed: str
    inertia: float
    rate: float


def link_name(link: str) -> str:
    """Name of the body of a link; names of finger joints and servos are made likewise."""
    return f"{HAND_PREFIX} {link}"


def add_trial_options(root: Element, step: float = MUJOCO_TIME_STEP) -> None:
    """Adds the time step and solver options for which the hand is tuned."""
    SubElement(
        root, "option", timestep=repr(step), integrator="implicitfast", cone="elliptic",
        # Friction creep is inversely proportional to the impedance ratio. The tolerance is relative
        # to the mean inertia, which is that of the carrier: tons.
        impratio="1000.0", tolerance="1e-14",
        # So that scenes of any size are solved alike: MuJoCo would use sparse factors from
        # 60 degrees of freedom on. In MuJoCo 4.0.0 these give the same accelerations
        # (within 2e-11, in 6,000 steps of trials and in piles of 20) and save 9 % in a
        # scene of twelve objects.
        jacobian="dense",
    )  # fmt: skip


def add_moved_hand(
    root: Element,
    world: Element,
    asset: Element,
    parts: HandDescription,
    mobilities: Sequence[float],
) -> str:
    """Adds the open hand at its pose in the diagram, with three actuators that move it.

    Args:
        root, world, asset: elements of the model.
        parts: the hand.
        mobilities: inverse masses of the objects to grasp, by mass [1/kg].

    Returns:
        A sentence on how to move it.
    """
    # 1/kg, mean over the three directions in which the hand moves.
    finger_mobility = (1.0 / FINGER_DRIVE_INERTIA + 3.0 / 100.0) / 3.0
    axes = {"hand x": (1.0, 0.0, 0.0), "hand y": (0.0, 1.0, 0.0), "hand z": (0.0, 0.0, 1.0)}
    joints = [CarrierJoint(name, axis, f"{name} speed", 100.0, 50.0) for name, axis in axes.items()]
    add_hand(root, world, asset, parts, joints)
    mobility = (float(np.mean(mobilities)) if mobilities else 1.0) + finger_mobility
    for finger in parts.fingers:
        solref, solimp = pad_contact(finger.front, mobility, MUJOCO_TIME_STEP)
        for geom in root.iter("geom"):
            if geom.get("name", "").startswith(f"{PAD_SPHERE_PREFIX} {finger.name} "):
                geom.set("solref", format_numbers(solref))
                geom.set("solimp", f"{format_numbers((solimp, solimp))} 0.001")
    first, second = parts.document.fingers
    towards = [math.copysign(1.0, f.closed - f.open) for f in (first, second)]
    speeds = " and ".join(f"{sign * parts.document.closing_speed:g}" for sign in towards)
    return (
        "actuators 'hand x', 'hand y' and 'hand z' place the hand, in metres from where it hangs,"
        " and 'hand x speed', 'hand y speed' and 'hand z speed' say how fast it shall go meanwhile,"
        " in m/s (0 damps);"
        f" {link_name(first.joint)!r} and {link_name(second.joint)!r} give its fingers a speed,"
        f" {speeds} m/s to close with {parts.document.force:g} N each"
    )


def add_hand(
    root: Element,
    world: Element,
    asset: Element,
    parts: HandDescription,
    joints: Sequence[CarrierJoint],
) -> None:
    """Adds the hand on a carrier, with its servos, without gravity.

    Args:
        root, world, asset: elements of the model.
        parts: the hand; it starts open, at its pose in the diagram.
        joints: joints of the carrier.
    """
    X_WH = parts.X_WH
    carrier = add_body(world, HAND_CARRIER_BODY, make_pose(p_AB=X_WH[:3, 3]))
    carrier.set("gravcomp", "1")
    for joint in joints:
        SubElement(
            carrier, "joint", name=joint.name, type="slide", axis=format_numbers(joint.axis),
            armature=repr(joint.inertia),
        )  # fmt: skip
    SubElement(
        carrier, "inertial", inertia_attributes(1e-3, (0, 0, 0), (1e-6, 1e-6, 1e-6, 0, 0, 0))
    )
    hand = _add_link(carrier, asset, parts.body, make_pose(X_WH[:3, :3]))
    for finger in parts.fingers:
        opened = make_pose(p_AB=finger.finger.open * finger.axis_B)
        body = _add_link(hand, asset, finger, finger.X_HB @ opened)
        low, high = sorted((finger.finger.closed, finger.finger.open))
        SubElement(
            body, "joint", name=link_name(finger.finger.joint), type="slide",
            axis=format_numbers(finger.axis_B), range=format_numbers((low, high)),
            ref=repr(finger.finger.open), armature=repr(FINGER_DRIVE_INERTIA),
        )  # fmt: skip
        _add_pad(body, asset, finger.name, finger.pad, finger.front)
    _add_servos(root, parts, joints)


def pad_spheres(front: PadFront) -> tuple[Array, Array]:
    """Spheres of a pad: one at the centre of each grid cell of the front, touching its plane from
    behind.

    Spheres at the rim are smaller, so that none sticks out of the pad: the collision check of the
    open hand uses the pad itself, and poses that it calls free must be free here.

    Returns:
        Centers (N, 3) of the spheres in the pad's frame P and radii (N,) [m].
    """
    max_radius = 0.002  # Metres; spheres are smaller where the pad ends.
    min_radius = 1e-5  # Metres.
    x, y = (
        ((np.arange(n) + 0.5) / n - 0.5) * side
        for side in front.size
        for n in (min(max(6, math.ceil(side / 0.0035 - 1e-9)), 12),)
    )
    grid = np.stack(np.meshgrid(x, y, indexing="ij"), axis=-1).reshape(-1, 2)
    # A sphere of radius r that touches z = 0 at (x, y) fits if n (x, y, -r) + d <= -r.
    planes = ConvexHull(front.corners).equations
    sides = planes[planes[:, 2] < 1 - 1e-6]
    room = -(grid @ sides[:, :2].T + sides[:, 3]) / (1 - sides[:, 2])
    radii = np.minimum(room.min(axis=1), max_radius)
    grid, radii = grid[radii > min_radius], radii[radii > min_radius]
    return np.column_stack([grid, -radii]), radii


def pad_contact(front: PadFront, mobility: float, step: float) -> tuple[tuple[float, float], float]:
    """Contact parameters with which a sphere bears its share of the load on the pad's front.

    MuJoCo's stiffness is one of acceleration: the force is that acceleration over a regularization
    R, which follows from the impedance d and the combined inverse mass of the two bodies. With a
    constant impedance MuJoCo divides stiffness and damping by it.

    Args:
        front: front of the pad.
        mobility: combined inverse mass of finger and object [1/kg].
        step: time step [s].

    Returns:
        Stiffness and damping of `solref`, and the impedance of `solimp`.
    """
    damping_time = 1e-3  # seconds: damping over stiffness, as Drake's 5 s/m at a depth of 0.2 mm
    rate = 0.8 / step  # angular frequency of the contact
    share = front.area / len(pad_spheres(front)[1])
    regularization = rate**2 / (front.stiffness * share)
    d = mobility / (mobility + regularization)
    return (-d * rate**2, -d * damping_time * rate**2), d


def _add_link(parent: Element, asset: Element, link: HandLink, X_PB: Array) -> Element:
    body = add_body(parent, link_name(link.name), X_PB)
    body.set("gravcomp", "1")
    moments = link.I_BCm[(0, 1, 2, 0, 0, 1), (0, 1, 2, 1, 2, 2)].copy()
    moments[:3] = np.maximum(moments[:3], 1e-8)  # kg m^2; MuJoCo refuses links without inertia
    inertia = inertia_attributes(max(link.mass, 1e-4), link.p_BCm, moments)
    SubElement(body, "inertial", inertia)
    for k, shape in enumerate(link.shapes):
        _add_shape(body, asset, f"{HAND_SHAPE_PREFIX} {link.name} {k}", shape)
    return body


def _add_pad(body: Element, asset: Element, link: str, pad: HandShape, front: PadFront) -> None:
    """Adds soft spheres along the front, and a rigid backing."""
    backing_depth = 0.002  # Metres behind the pad's front; closer, it stops objects from pivoting.
    for k, (center, radius) in enumerate(zip(*pad_spheres(front), strict=True)):
        X_BS = front.X_BP @ make_pose(p_AB=center)
        _add_geom(
            body, f"{PAD_SPHERE_PREFIX} {link} {k}", X_BS, type="sphere", size=repr(float(radius))
        )
    if front.thickness > 2.0 * backing_depth:
        corners = front.corners.copy()
        corners[:, 2] = np.minimum(corners[:, 2], -backing_depth)
        _add_mesh(body, asset, f"{PAD_BACKING_PREFIX} {link} 0", front.X_BP, corners)


def _add_shape(body: Element, asset: Element, name: str, shape: HandShape) -> None:
    if shape.kind == "mesh":
        _add_mesh(body, asset, name, shape.X_BC, shape.points)
    elif shape.kind == "box":
        _add_geom(body, name, shape.X_BC, **box_attributes(shape.size))
    else:
        _add_geom(body, name, shape.X_BC, **round_shape_attributes(shape.kind, shape.size))


def _add_mesh(body: Element, asset: Element, name: str, X_BG: Array, points: Array) -> None:
    SubElement(asset, "mesh", name=name, vertex=format_numbers(points), inertia="convex")
    _add_geom(body, name, X_BG, type="mesh", mesh=name)


def _add_geom(body: Element, name: str, X_BG: Array, **shape: str) -> None:
    """Adds a geom of the hand. It determines contact parameters (`solmix`) and has no friction
    itself, as MuJoCo takes the higher of two coefficients."""
    touching = {
        "contype": f"{HAND_BIT}",
        "conaffinity": f"{OBJECT_BIT}",
        "condim": "3",
        "friction": "0 0 0",
        "solref": RIGID_CONTACT_SOLREF,
        "solmix": "1e6",
        "group": "2",
        "rgba": "0.9 0.9 0.88 1",
    }
    SubElement(body, "geom", {"name": name, **touching, **pose_attributes(X_BG), **shape})


def _add_servos(root: Element, parts: HandDescription, joints: Sequence[CarrierJoint]) -> None:
    """Adds velocity servos with limited force for the fingers, position and velocity servos for the
    carrier, and the coupling of the fingers."""
    actuator, hand = SubElement(root, "actuator"), parts.document
    for joint in joints:
        stiffness = joint.inertia * joint.rate**2
        damping = 2.0 * joint.inertia * joint.rate
        SubElement(actuator, "position", name=joint.name, joint=joint.name, kp=repr(stiffness))
        SubElement(actuator, "velocity", name=joint.speed, joint=joint.name, kv=repr(damping))
    gain = STALL_FORCE_RATIO * hand.force / hand.closing_speed
    for finger in hand.fingers:
        name = link_name(finger.joint)
        SubElement(
            actuator, "velocity", name=name, joint=name, kv=repr(gain),
            forcerange=format_numbers((-hand.force, hand.force)),
        )  # fmt: skip
    if hand.coupled:
        first, second = (link_name(finger.joint) for finger in hand.fingers)
        # Relative to the open position of both, see `ref`.
        SubElement(
            SubElement(root, "equality"), "joint", joint1=second, joint2=first,
            polycoef=format_numbers((0, parts.coupling, 0, 0, 0)),
            solref=RIGID_CONTACT_SOLREF, solimp="0.99 0.99 0.001",
        )  # fmt: skip
