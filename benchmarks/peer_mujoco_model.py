"""The MuJoCo model of a scene under the hand, as MJCF: what stands where is set for each trial.

The hand's boxes are those of its SDF. Each pad's front is a grid of soft spheres, which bears load
over an area, and with friction at each sphere a torque about the normal as well; a rigid box 2 mm
behind the fronts backs them. A box of the pad's full size takes the spheres' place where the open
hand is screened. Objects are their convex pieces, the table is a plane.
"""

from __future__ import annotations

from pathlib import Path
from xml.etree import ElementTree
from xml.etree.ElementTree import Element, SubElement

import numpy as np
from peer_pybullet import PAD_SIZE, numbers

from burg_drake.core.arrays import Array
from burg_drake.core.frames import make_pose, quaternion_from_rotation, rotation_from_rpy
from burg_drake.scene.document.scene import Scene
from burg_drake.station.document.station_document import Station

STEP = 0.002
"""Time step [s], for which pads and servos are laid out. Half of it gives the same verdicts on the
72 grasps of `contact_oracle.py`."""
IMPRATIO = 1000.0
"""How much harder friction is than the normal direction. What sticks creeps: 1.5 kg by 35 um/s,
which is in inverse proportion to the ratio; at 10 a third of the grasps that hold are lost."""
TOLERANCE = 1e-11
"""Of the solver, which scales it by the mean inertia; that is the carrier's here, a hundred kg,
while objects weigh a hundred g."""
GRID = (6, 6)
"""Spheres of a pad, across it and along the finger."""
RADIUS = 0.002
"""Of the spheres [m]; with 2 to 6 mm, and with 8 x 8 spheres, as many verdicts are the oracle's."""
BACKING = 0.002
"""How far behind the spheres' fronts the rigid backing begins [m]."""
FIRM = "0.005 1"
"""Time constant [s] and damping ratio of all contacts but the pads'."""
CARRIER_INERTIA, FINGER_INERTIA = 100.0, 1.0
"""Of the drives along their joints [kg]. MuJoCo solves contact before it makes the servos implicit:
without the inertia of a drive, a servo would throw a 15 g finger about."""
LIFT_RATE = 50.0
"""Of the critically damped servo that lifts the hand [1/s]; it lags by a tenth of a millimetre."""
STALL = 1.25
"""Force that a finger's servo asks for when it stands still over that of the grip, as in Drake."""

CARRIER, LIFT, TABLE = "hand carrier", "hand lift", "table"
SPHERE, BACK, FULL, BOX = "hand sphere", "hand back", "hand full pad", "hand box"
HEIGHT, RISE = "hand height", "hand rise"
"""First words of the names of the hand's geometries; the rest is the link and a number."""


def scene_mjcf(scene: Scene, station: Station) -> str:
    """The model; objects are bodies by the names of their instances."""
    root = Element("mujoco")
    SubElement(root, "compiler", angle="radian", autolimits="true")
    option = SubElement(
        root, "option", timestep=f"{STEP}", integrator="implicitfast", cone="elliptic",
        impratio=f"{IMPRATIO}", tolerance=f"{TOLERANCE}",
        # Sparse factors are wrong in MuJoCo 4.0.0 (its issue 3767).
        jacobian="dense",
    )  # fmt: skip
    SubElement(option, "flag", autoreset="disable")
    default = SubElement(root, "default")
    SubElement(default, "geom", condim="3", contype="0", conaffinity="1", solref=FIRM)
    SubElement(default, "pair", condim="3", solref=FIRM)
    SubElement(default, "mesh", inertia="convex")
    assets, world = SubElement(root, "asset"), SubElement(root, "worldbody")
    contact = SubElement(root, "contact")
    SubElement(world, "geom", name=TABLE, type="plane", size="1 1 1")
    for name in scene.instances:
        _add_object(assets, world, contact, scene, name)
    _add_hand(world, station)
    _add_drives(root, station)
    return ElementTree.tostring(root, encoding="unicode")


def _add_object(assets: Element, world: Element, contact: Element, scene: Scene, name: str) -> None:
    """A free body of convex pieces, whose contacts with the table are pairs of their own."""
    properties, body = scene.entry(name).mass_properties, SubElement(world, "body", name=name)
    SubElement(body, "freejoint", name=name)
    SubElement(
        body, "inertial", pos=_text(properties.center_of_mass), mass=repr(properties.mass),
        fullinertia=_text(properties.inertia),
    )  # fmt: skip
    for k, piece in enumerate(scene.entry(name).pieces):
        geom = f"{name}/{k}"
        SubElement(assets, "mesh", name=geom, file=str(Path(scene.library.path(piece)).resolve()))
        SubElement(body, "geom", name=geom, type="mesh", mesh=geom)
        SubElement(contact, "pair", name=geom, geom1=TABLE, geom2=geom)


def _add_hand(world: Element, station: Station) -> None:
    """The hand on a carrier, which a joint along the world's z lifts; nothing of it has weight."""
    sdf = ElementTree.parse(station.hand_model).getroot()
    links = {link.get("name"): link for link in sdf.iter("link")}
    joints = {joint.get("name"): joint for joint in sdf.iter("joint")}
    carrier = SubElement(world, "body", name=CARRIER, gravcomp="1")
    SubElement(
        carrier, "joint", name=LIFT, type="slide", axis="0 0 1", armature=f"{CARRIER_INERTIA}"
    )
    SubElement(carrier, "inertial", pos="0 0 0", mass="0.001", diaginertia="1e-6 1e-6 1e-6")
    hand = _add_link(carrier, links[station.hand.body], np.eye(4))
    for finger in station.hand.fingers:
        joint = joints[finger.joint]
        body = _add_link(hand, links[finger.body], _pose(joint))
        low, high = sorted((finger.closed, finger.open))
        SubElement(
            body, "joint", name=finger.joint, type="slide",
            axis=joint.findtext("axis/xyz", "0 1 0"), range=f"{low} {high}",
            armature=f"{FINGER_INERTIA}",
        )  # fmt: skip


def _add_link(parent: Element, link: Element, X_PB: Array) -> Element:
    """A link with its inertia and boxes, and what a pad consists of."""
    name = link.get("name", "")
    body = SubElement(parent, "body", {"name": name, "gravcomp": "1", **_place(X_PB)})
    moments = [link.findtext(f"inertial/inertia/{key}", "0") for key in INERTIA]
    SubElement(
        body, "inertial", pos=_text(numbers(link.findtext("inertial/pose"))[:3]),
        mass=link.findtext("inertial/mass", ""), fullinertia=" ".join(moments),
    )  # fmt: skip
    for k, collision in enumerate(link.iter("collision")):
        size, X_BC = collision.findtext("geometry/box/size"), _pose(collision)
        if size is None:
            _add_pad(body, name, X_BC)
        else:
            _add_box(body, f"{BOX}/{name}/{k}", X_BC, np.array(numbers(size)))
    return body


INERTIA = ("ixx", "iyy", "izz", "ixy", "ixz", "iyz")


def _add_pad(body: Element, name: str, X_BP: Array) -> None:
    """A pad, whose front looks along -y of its frame P."""
    size = np.array(numbers(PAD_SIZE))
    for k, center in enumerate(sphere_centers()):
        X_BS = X_BP @ make_pose(p_AB=center)
        _add_geom(body, f"{SPHERE}/{name}/{k}", X_BS, type="sphere", size=f"{RADIUS}")
    behind = make_pose(p_AB=(0.0, BACKING / 2, 0.0))
    _add_box(body, f"{BACK}/{name}", X_BP @ behind, size - (0.0, BACKING, 0.0))
    _add_box(body, f"{FULL}/{name}", X_BP, size)


def sphere_centers() -> Array:
    """(N, 3) of a pad's spheres in its frame: each in the middle of its share of the front [m]."""
    size = np.array(numbers(PAD_SIZE))
    x, z = (
        ((np.arange(n) + 0.5) / n - 0.5) * length for n, length in zip(GRID, size[::2], strict=True)
    )
    grid = np.stack(np.meshgrid(x, RADIUS - size[1] / 2, z, indexing="ij"), axis=-1)
    return np.asarray(grid.reshape(-1, 3))


def _add_box(body: Element, name: str, X_BG: Array, size: Array) -> None:
    _add_geom(body, name, X_BG, type="box", size=_text(size / 2))


def _add_geom(body: Element, name: str, X_BG: Array, **shape: str) -> None:
    """A geometry of the hand, which says how it touches objects (`priority`), and touches itself
    not."""
    touching = {"contype": "1", "conaffinity": "0", "priority": "1"}
    SubElement(body, "geom", {"name": name, **touching, **_place(X_BG), **shape})


def _add_drives(root: Element, station: Station) -> None:
    """Servos of speed with limited force for the fingers, one of position and speed for the lift,
    and the coupling of the fingers."""
    hand, actuator = station.hand, SubElement(root, "actuator")
    stiffness, damping = CARRIER_INERTIA * LIFT_RATE**2, 2.0 * CARRIER_INERTIA * LIFT_RATE
    SubElement(actuator, "position", name=HEIGHT, joint=LIFT, kp=f"{stiffness}")
    SubElement(actuator, "velocity", name=RISE, joint=LIFT, kv=f"{damping}")
    gain = STALL * hand.force / hand.closing_speed
    for finger in hand.fingers:
        SubElement(
            actuator, "velocity", name=finger.joint, joint=finger.joint, kv=f"{gain}",
            forcerange=f"{-hand.force} {hand.force}",
        )  # fmt: skip
    if hand.coupled:
        first, second = hand.fingers
        SubElement(
            SubElement(root, "equality"), "joint", joint1=second.joint, joint2=first.joint,
            polycoef="0 1 0 0 0", solref=FIRM, solimp="0.99 0.99 0.001",
        )  # fmt: skip


def _pose(element: Element) -> Array:
    """The pose (4, 4) that an element of an SDF has in it."""
    x, y, z, *angles = numbers(element.findtext("pose", "0 0 0 0 0 0"))
    return make_pose(rotation_from_rpy(angles), (x, y, z))


def _place(X_AB: Array) -> dict[str, str]:
    return {"pos": _text(X_AB[:3, 3]), "quat": _text(quaternion_from_rotation(X_AB[:3, :3]))}


def _text(values: object) -> str:
    return " ".join(repr(v) for v in np.asarray(values, dtype=float).tolist())
