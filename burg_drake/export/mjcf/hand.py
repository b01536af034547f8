"""A hand in MJCF: its links on a carrier, servos as in Drake, and pads that are soft.

Each pad's front is a grid of soft spheres, which bears load over an area, and with friction at each
sphere a torque about the normal as well; a rigid backing behind the fronts has the rest of the pad.
Constants were measured against an oracle of contact (benchmarks/contact_oracle.py).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from xml.etree.ElementTree import Element, SubElement

import numpy as np
from scipy.spatial import ConvexHull

from burg_drake.core import Array, make_pose
from burg_drake.export.mjcf.bodies import add_body
from burg_drake.export.mjcf.elements import box_size, full_inertia, numbers, place, round_size
from burg_drake.station.diagram import HandDescription, HandLink, HandShape, PadFront
from burg_drake.station.world import STALL

STEP = 0.001
"""Time step [s]. Of the oracle's 72 grasps 68 come out right. With spheres all of one size
69 did, and 64 at 2 ms, with which too much is lost that pivots between the pads."""
IMPRATIO = 1000.0
"""How much harder friction is than the normal direction. What sticks creeps: 1.5 kg by 35 um/s,
which is in inverse proportion to the ratio; at 10 a third of the grasps that hold are lost."""
TOLERANCE = 1e-14
"""Of the solver, which scales it by the mean inertia; that is the carrier's here, tons, while
objects weigh a hundred g."""
FEWEST, SPHERE_PITCH, MOST = 6, 0.0035, 12
"""Spheres along a side of a pad, at least and at most, and their distance in between [m]. 8 x 8 on
the Panda's give as many verdicts of the oracle as 6 x 6."""
SPHERE_RADIUS, MIN_SPHERE_RADIUS = 0.002, 1e-5
"""Of the spheres [m], smaller where the pad ends; with 2 to 6 mm as many verdicts are
the oracle's."""
BACKING = 0.002
"""How far behind the spheres' fronts the rigid backing begins [m]. At 0.5 mm objects that turn
between the pads meet it, and are held by it."""
STEPS_IN_PERIOD = 0.8
"""A time step in the terms of the pads' contacts: over the inverse of their frequency."""
PAD_DAMPING = 1e-3
"""How the pads' force grows with the speed of approach, over how it grows with depth [s]: as by
Drake's dissipation of 5 s/m at a depth of 0.2 mm. With half of it 67 of the oracle's 72 grasps come
out right and with a fifth 63, as more is lost; with twice as much 68, as more is held."""
FIRM = "0.005 1"
"""Time constant [s] and damping ratio of all contacts but the pads'."""
FINGER_INERTIA = 1.0
"""Of a finger's drive along its joint [kg]. MuJoCo solves contact before it makes the servos
implicit: without the inertia of a drive, a servo would throw a 15 g finger about."""
FINGER_MOBILITY = (1.0 / FINGER_INERTIA + 3.0 / 100.0) / 3.0
"""What MuJoCo takes for it where three joints move the hand, the mean over three directions
[1/kg]."""
LEAST_MASS, LEAST_MOMENT = 1e-4, 1e-8
"""Of a link [kg, kg m^2], where a model has none."""

CARRIER, HAND = "hand carrier", "hand"
"""Body of the carrier, and first word of all other names of the hand."""
SPHERE, BACK, SHAPE = f"{HAND} sphere", f"{HAND} back", f"{HAND} shape"
"""First words of the names of geoms; the rest is the link and a number."""
OBJECT_BIT, HAND_BIT, TABLE_BIT = 1, 2, 4
"""Of `contype` and `conaffinity`: the hand meets objects and not itself."""


@dataclass(frozen=True)
class CarrierJoint:
    """A joint of the carrier with its servos, which have its name.

    Attributes:
        name: of the joint, and of the servo of its position.
        axis: (3,) in the world at the carrier's start.
        speed: name of the servo of its speed.
        inertia: of the drive [kg].
        rate: of the critically damped servos [1/s]. As contact is solved before servos are made
            implicit, what the hand holds is ahead of it while the hand speeds up, and creeps, the
            faster the higher the rate: at 50 by 2 mm/s in a usual lift.
    """

    name: str
    axis: tuple[float, float, float]
    speed: str
    inertia: float
    rate: float


MOVED_JOINTS = tuple(
    CarrierJoint(f"{HAND} {letter}", axis, f"{HAND} {letter} speed", 100.0, 50.0)
    for letter, axis in zip("xyz", ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)), strict=True)
)


def link_name(link: str) -> str:
    """Name of the body of a link; joints and servos of fingers have the joint's, likewise."""
    return f"{HAND} {link}"


def add_trial_options(root: Element, step: float = STEP) -> None:
    """Time step and solver that the hand is laid out for."""
    SubElement(
        root, "option", timestep=repr(step), integrator="implicitfast", cone="elliptic",
        impratio=repr(IMPRATIO), tolerance=repr(TOLERANCE),
        # So that scenes of any size are solved alike: from 60 degrees of freedom on MuJoCo would
        # take sparse factors. In MuJoCo 4.0.0 these give the same accelerations (within 2e-11, in
        # 6,000 steps of trials and in piles of 20) and save 9 % in a scene of twelve objects.
        jacobian="dense",
    )  # fmt: skip


def add_moved_hand(
    root: Element,
    world: Element,
    asset: Element,
    parts: HandDescription,
    mobilities: Sequence[float],
) -> str:
    """Adds the hand where the diagram has it, open, to be moved by three actuators.

    Args:
        root, world, asset: elements of the model.
        parts: the hand.
        mobilities: of what there is to grasp, over their masses [1/kg].

    Returns:
        How it is moved, in a sentence.
    """
    add_hand(root, world, asset, parts, MOVED_JOINTS)
    mobility = (float(np.mean(mobilities)) if mobilities else 1.0) + FINGER_MOBILITY
    for finger in parts.fingers:
        solref, solimp = pad_contact(finger.front, mobility, STEP)
        for geom in root.iter("geom"):
            if geom.get("name", "").startswith(f"{SPHERE} {finger.name} "):
                geom.set("solref", numbers(solref))
                geom.set("solimp", f"{numbers((solimp, solimp))} 0.001")
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
    """Adds the hand on a carrier, with its servos; nothing of it has weight.

    Args:
        root, world, asset: elements of the model.
        parts: the hand; at first it is where the diagram has it, open.
        joints: of the carrier.
    """
    X_WH = parts.X_WH
    carrier = add_body(world, CARRIER, make_pose(p_AB=X_WH[:3, 3]))
    carrier.set("gravcomp", "1")
    for joint in joints:
        SubElement(
            carrier, "joint", name=joint.name, type="slide", axis=numbers(joint.axis),
            armature=repr(joint.inertia),
        )  # fmt: skip
    SubElement(carrier, "inertial", full_inertia(1e-3, (0, 0, 0), (1e-6, 1e-6, 1e-6, 0, 0, 0)))
    hand = _add_link(carrier, asset, parts.body, make_pose(X_WH[:3, :3]))
    for finger in parts.fingers:
        opened = make_pose(p_AB=finger.finger.open * finger.axis_B)
        body = _add_link(hand, asset, finger, finger.X_HB @ opened)
        low, high = sorted((finger.finger.closed, finger.finger.open))
        SubElement(
            body, "joint", name=link_name(finger.finger.joint), type="slide",
            axis=numbers(finger.axis_B), range=numbers((low, high)), ref=repr(finger.finger.open),
            armature=repr(FINGER_INERTIA),
        )  # fmt: skip
        _add_pad(body, asset, finger.name, finger.pad, finger.front)
    _add_servos(root, parts, joints)


def pad_spheres(front: PadFront) -> tuple[Array, Array]:
    """Spheres of a pad: one amid each share of the front, touching its plane from behind.

    Those at the rim are smaller, so that none sticks out of the pad: the screen of the open hand
    takes the pad as it is, and what it calls clear must be clear here.

    Returns:
        Their centers (N, 3) in the pad's frame P and radii (N,) [m].
    """
    x, y = (
        ((np.arange(n) + 0.5) / n - 0.5) * side
        for side in front.size
        for n in (min(max(FEWEST, math.ceil(side / SPHERE_PITCH - 1e-9)), MOST),)
    )
    grid = np.stack(np.meshgrid(x, y, indexing="ij"), axis=-1).reshape(-1, 2)
    # Of a sphere that touches the plane z = 0 at (x, y), centered at -r: n (x, y, -r) + d <= -r.
    planes = ConvexHull(front.corners).equations
    sides = planes[planes[:, 2] < 1 - 1e-6]
    room = -(grid @ sides[:, :2].T + sides[:, 3]) / (1 - sides[:, 2])
    radii = np.minimum(room.min(axis=1), SPHERE_RADIUS)
    grid, radii = grid[radii > MIN_SPHERE_RADIUS], radii[radii > MIN_SPHERE_RADIUS]
    return np.column_stack([grid, -radii]), radii


def pad_contact(front: PadFront, mobility: float, step: float) -> tuple[tuple[float, float], float]:
    """How a sphere touches, so that it bears its share of the pad's front.

    MuJoCo's stiffness is one of acceleration: a force is that over a regularization R, which
    follows from the impedance d and from what the two bodies together would accelerate by. With a
    constant impedance MuJoCo divides stiffness and damping by it.

    Args:
        front: the pad's.
        mobility: of finger and object together [1/kg].
        step: time step [s].

    Returns:
        Stiffness and damping of `solref`, and the impedance of `solimp`.
    """
    rate = STEPS_IN_PERIOD / step
    share = front.area / len(pad_spheres(front)[1])
    regularization = rate**2 / (front.stiffness * share)
    d = mobility / (mobility + regularization)
    return (-d * rate**2, -d * PAD_DAMPING * rate**2), d


def _add_link(parent: Element, asset: Element, link: HandLink, X_PB: Array) -> Element:
    body = add_body(parent, link_name(link.name), X_PB)
    body.set("gravcomp", "1")
    moments = link.I_BCm[(0, 1, 2, 0, 0, 1), (0, 1, 2, 1, 2, 2)].copy()
    moments[:3] = np.maximum(moments[:3], LEAST_MOMENT)
    mass = max(link.mass, LEAST_MASS)
    SubElement(body, "inertial", full_inertia(mass, link.p_BCm, moments))
    for k, shape in enumerate(link.shapes):
        _add_shape(body, asset, f"{SHAPE} {link.name} {k}", shape)
    return body


def _add_pad(body: Element, asset: Element, link: str, pad: HandShape, front: PadFront) -> None:
    """Soft spheres along the front, and what is rigid behind them."""
    for k, (center, radius) in enumerate(zip(*pad_spheres(front), strict=True)):
        X_BS = front.X_BP @ make_pose(p_AB=center)
        _add_geom(body, f"{SPHERE} {link} {k}", X_BS, type="sphere", size=repr(float(radius)))
    if front.thickness > 2.0 * BACKING:
        corners = front.corners.copy()
        corners[:, 2] = np.minimum(corners[:, 2], -BACKING)
        _add_mesh(body, asset, f"{BACK} {link} 0", front.X_BP, corners)


def _add_shape(body: Element, asset: Element, name: str, shape: HandShape) -> None:
    if shape.kind == "mesh":
        _add_mesh(body, asset, name, shape.X_BC, shape.points)
    elif shape.kind == "box":
        _add_geom(body, name, shape.X_BC, **box_size(shape.size))
    else:
        _add_geom(body, name, shape.X_BC, **round_size(shape.kind, shape.size))


def _add_mesh(body: Element, asset: Element, name: str, X_BG: Array, points: Array) -> None:
    SubElement(asset, "mesh", name=name, vertex=numbers(points), inertia="convex")
    _add_geom(body, name, X_BG, type="mesh", mesh=name)


def _add_geom(body: Element, name: str, X_BG: Array, **shape: str) -> None:
    """A geom of the hand, which says how objects are touched (`solmix`), and by itself has no
    friction: MuJoCo takes the higher coefficient of two."""
    touching = {
        "contype": f"{HAND_BIT}",
        "conaffinity": f"{OBJECT_BIT}",
        "condim": "3",
        "friction": "0 0 0",
        "solref": FIRM,
        "solmix": "1e6",
        "group": "2",
        "rgba": "0.9 0.9 0.88 1",
    }
    SubElement(body, "geom", {"name": name, **touching, **place(X_BG), **shape})


def _add_servos(root: Element, parts: HandDescription, joints: Sequence[CarrierJoint]) -> None:
    """Servos of speed with limited force for the fingers, of position and speed for the carrier,
    and the coupling of the fingers."""
    actuator, hand = SubElement(root, "actuator"), parts.document
    for joint in joints:
        stiffness = joint.inertia * joint.rate**2
        damping = 2.0 * joint.inertia * joint.rate
        SubElement(actuator, "position", name=joint.name, joint=joint.name, kp=repr(stiffness))
        SubElement(actuator, "velocity", name=joint.speed, joint=joint.name, kv=repr(damping))
    gain = STALL * hand.force / hand.closing_speed
    for finger in hand.fingers:
        name = link_name(finger.joint)
        SubElement(
            actuator, "velocity", name=name, joint=name, kv=repr(gain),
            forcerange=numbers((-hand.force, hand.force)),
        )  # fmt: skip
    if hand.coupled:
        first, second = (link_name(finger.joint) for finger in hand.fingers)
        # From where both are open, as `ref` says.
        SubElement(
            SubElement(root, "equality"), "joint", joint1=second, joint2=first,
            polycoef=numbers((0, parts.coupling, 0, 0, 0)), solref=FIRM, solimp="0.99 0.99 0.001",
        )  # fmt: skip
