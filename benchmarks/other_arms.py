"""Stations with arms that the project does not come with, for benchmarks: a KUKA LBR iiwa 14 R820
and a Panda on a base that slides along x and y.

The iiwa's joints, their ranges and speeds are those of its data sheet (KUKA, "LBR iiwa 7 R800, LBR
iiwa 14 R820, Specification"): 0.36, 0.42, 0.40 and 0.126 m from base to flange, no offsets.
Capsules about these lengths stand in for its housings.
"""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np

from burg_drake.core import Pose, data_root, save_document
from burg_drake.station import Arm, StationDocument, load_station

IIWA = (
    # origin in the frame before, its roll, pitch and yaw, end of the link, radius; range [deg],
    # speed [deg/s], torque [Nm], mass [kg]
    ((0, 0, 0.1575), (0, 0, 0), (0, 0, 0.2025), 0.070, 170, 85, 320, 4.0),
    ((0, 0, 0.2025), (90, 0, 180), (0, 0.2045, 0), 0.070, 120, 85, 320, 4.0),
    ((0, 0.2045, 0), (90, 0, 180), (0, 0, 0.2155), 0.070, 170, 100, 176, 3.0),
    ((0, 0, 0.2155), (90, 0, 0), (0, 0.1845, 0), 0.070, 120, 75, 176, 2.7),
    ((0, 0.1845, 0), (-90, 180, 0), (0, 0, 0.2155), 0.060, 170, 130, 110, 1.7),
    ((0, 0, 0.2155), (90, 0, 0), (0, 0.081, 0), 0.060, 120, 135, 40, 1.8),
    ((0, 0.081, 0), (-90, 180, 0), (0, 0, 0.045), 0.045, 175, 135, 40, 0.3),
)
SLIDES = (("slide_x", "1 0 0", 0.5), ("slide_y", "0 1 0", 1.5))
"""Joints of the mobile base, their axes, and how far they go to either side [m]."""
RAIL, PLATFORM = (1.6, 3.6, 0.04), (0.5, 0.4, 0.5)
"""What the base slides on, and the base itself, on which the arm stands [m]."""
GAP = 0.01
"""Between the two [m]."""


def iiwa_station(folder: Path) -> Path:
    """Writes model and station of the iiwa; returns the station's file."""
    (folder / "iiwa14.urdf").write_text(_iiwa_urdf(), encoding="utf-8")
    home = tuple(np.deg2rad([0.0, 30.0, 0.0, -90.0, 0.0, 60.0, 0.0]).tolist())
    arm = Arm(
        model="iiwa14.urdf",
        base="link_0",
        flange="flange",
        X_FH=Pose(translation=(0.0, 0.0, 0.03)),
        home=home,
    )
    return _station(folder, "iiwa_tabletop", replace(load_station("panda_wsg").document, arm=arm))


def mobile_station(folder: Path) -> Path:
    """Writes model and station of the Panda on its base; returns the station's file."""
    (folder / "mobile_panda.sdf").write_text(_mobile_sdf(), encoding="utf-8")
    panda = load_station("panda_tabletop").document
    assert panda.arm is not None
    arm = replace(
        panda.arm,
        model="mobile_panda.sdf",
        base="rail",
        X_WA=Pose(translation=(-0.3, 0.0, -PLATFORM[2])),
        home=(0.0, 0.0, *panda.arm.home),
    )
    table = replace(panda.table, center=(0.5, 0.0), size=(0.8, 1.4, 0.1))
    return _station(folder, "mobile_tabletop", replace(panda, arm=arm, table=table))


def _station(folder: Path, name: str, document: StationDocument) -> Path:
    path = folder / f"{name}.yaml"
    save_document(replace(document, name=name), path, "Written by a benchmark.")
    return path


def _iiwa_urdf() -> str:
    parts = [_link("link_0", (0, 0, 0.1575), 0.080, 5.0, start=0.08)]
    for k, (origin, rpy, end, radius, turn, speed, torque, mass) in enumerate(IIWA, 1):
        parts += [
            _link(f"link_{k}", end, radius, mass),
            f'<joint name="joint_{k}" type="revolute"><origin xyz="{_text(origin)}"'
            f' rpy="{_text(np.deg2rad(rpy))}"/><parent link="link_{k - 1}"/>'
            f'<child link="link_{k}"/><axis xyz="0 0 1"/><limit lower="{-np.deg2rad(turn)}"'
            f' upper="{np.deg2rad(turn)}" velocity="{np.deg2rad(speed)}" effort="{torque}"/>'
            "</joint>",
            f'<transmission name="t{k}"><type>SimpleTransmission</type><joint name="joint_{k}"/>'
            f'<actuator name="joint_{k}"/></transmission>',
        ]
    parts += [
        '<link name="flange"/><joint name="end" type="fixed"><origin xyz="0 0 0.045"/>'
        '<parent link="link_7"/><child link="flange"/></joint>',
        '<drake:collision_filter_group name="wrist" ignore="wrist"><drake:member link="link_5"/>'
        '<drake:member link="link_7"/><drake:ignored_collision_filter_group name="wrist"/>'
        "</drake:collision_filter_group>",
    ]
    robot = '<robot name="iiwa14" xmlns:drake="http://drake.mit.edu">'
    return "\n".join(['<?xml version="1.0"?>', robot, *parts, "</robot>\n"])


def _link(name: str, end: tuple[float, ...], radius: float, mass: float, start: float = 0.0) -> str:
    """A capsule from the link's origin, or a height over it, to `end`; turns as a ball does."""
    way = np.array(end)
    length = float(np.linalg.norm(way)) - start
    rpy = (0.0, 0.0, 0.0) if way[2] else (-np.pi / 2, 0.0, 0.0)
    inertia = 0.4 * mass * (radius + length / 4) ** 2
    middle = way / 2 + np.array([0.0, 0.0, start / 2])
    origin = f'<origin xyz="{_text(middle)}" rpy="{_text(rpy)}"/>'
    return (
        f'<link name="{name}"><inertial>{origin}<mass value="{mass}"/>'
        f'<inertia ixx="{inertia}" iyy="{inertia}" izz="{inertia}" ixy="0" ixz="0" iyz="0"/>'
        f"</inertial><collision>{origin}<geometry>"
        f'<drake:capsule radius="{radius}" length="{length}"/></geometry></collision></link>'
    )


def _mobile_sdf() -> str:
    model = (data_root() / "models" / "panda" / "panda_arm.sdf").read_text(encoding="utf-8")
    meshes = data_root() / "models" / "panda" / "meshes"
    model = model.replace("<uri>meshes/", f"<uri>file://{meshes}/")
    links = ["rail", "carriage", "platform"]
    inertia = "<ixx>1</ixx><iyy>1</iyy><izz>1</izz><ixy>0</ixy><ixz>0</ixz><iyz>0</iyz>"
    shapes = {"rail": _box(RAIL, -GAP - RAIL[2] / 2), "platform": _box(PLATFORM, PLATFORM[2] / 2)}
    added = [
        f'<link name="{link}"><inertial><mass>20</mass><inertia>{inertia}</inertia></inertial>'
        f"{shapes.get(link, '')}</link>"
        for link in links
    ]
    for (name, axis, way), (parent, child) in zip(SLIDES, pairwise(links), strict=True):
        added.append(
            f'<joint name="{name}" type="prismatic"><parent>{parent}</parent><child>{child}</child>'
            f"<axis><xyz>{axis}</xyz><limit><lower>{-way}</lower><upper>{way}</upper>"
            "<velocity>0.5</velocity><effort>500</effort></limit></axis></joint>"
        )
    added.append(
        '<joint name="mount" type="fixed"><parent>platform</parent><child>panda_link0</child>'
        "</joint>"
    )
    first = '<link name="panda_link0">'
    placed = f'{first}<pose relative_to="platform">0 0 {PLATFORM[2]} 0 0 0</pose>'
    return model.replace(first, "".join(added) + placed)


def _box(size: tuple[float, ...], z: float) -> str:
    return (
        f'<collision name="box"><pose>0 0 {z} 0 0 0</pose><geometry><box><size>{_text(size)}</size>'
        "</box></geometry></collision>"
    )


def _text(values: object) -> str:
    return " ".join(f"{x:.12g}" for x in np.asarray(values, dtype=float))
