"""A gantry for tests: three prismatic joints that carry the Panda's hand, pointing down, so that a
configuration is the place of the hand and what is free can be told by eye."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from burg_drake.core import Pose
from burg_drake.motion import ArmCollision, ArmProximity, EdgeChecker
from burg_drake.scene import Instance, Scene, SceneDocument, load_scene
from burg_drake.station import Arm, Obstacle, StationDiagram, build_station_diagram, load_station

LOWER = np.array([0.1, -0.5, 0.15])
UPPER = np.array([0.9, 0.5, 0.9])
HOME = np.array([0.2, 0.0, 0.3])
"""Place of the hand's origin in the world [m]."""
FINGERTIP = 0.0584 + 0.04525 + 0.0185 / 2
"""From the hand's origin to the end of a pad [m]: finger joint, centre of the pad, half of its
height (franka_ros, franka_hand.xacro)."""
HALF_PAD = 0.0175 / 2
"""Half of the width of a pad across the closing direction [m]; the hand itself is wider."""
BLOCK = """<collision name="block"><pose>0 0 0.1 0 0 0</pose><geometry><box>
<size>0.1 0.1 0.05</size></box></geometry></collision>"""
"""What the hand hangs on."""


def gantry_edges(
    folder: Path, *instances: Instance, exact: bool = True, **background: Obstacle
) -> EdgeChecker:
    """Edges of the gantry over a table with some boxes and objects; fingers open along y."""
    diagram = gantry_diagram(folder, *instances, **background)
    return EdgeChecker(ArmProximity(diagram), ArmCollision(diagram), exact=exact)


def gantry_diagram(
    folder: Path, *instances: Instance, blocks: Sequence[str] = ("z_link",), **background: Obstacle
) -> StationDiagram:
    """The gantry over a table, with blocks on some of its links."""
    model = folder / "gantry.sdf"
    model.write_text(_sdf(blocks), encoding="utf-8")
    station = load_station("panda_tabletop")
    arm = Arm(
        model=str(model),
        base="base",
        flange="z_link",
        X_FH=Pose(rpy_deg=(180.0, 0.0, 0.0)),
        home=tuple(HOME),
    )
    document = replace(station.document, arm=arm, background=background)
    scene = Scene(
        SceneDocument(name="few", library="household", instances=instances),
        load_scene("tabletop_six").library,
        Path("few.yaml"),
    )
    return build_station_diagram(
        scene, replace(station, document=document, arm_model=model), weld_objects=True
    )


def box(low: tuple[float, float, float], high: tuple[float, float, float]) -> Obstacle:
    """A box between two corners [m]."""
    size = np.subtract(high, low)
    return Obstacle(X_WB=Pose(tuple(np.add(low, high) / 2.0)), size=tuple(size))


def _sdf(blocks: Sequence[str]) -> str:
    links = "".join(
        f'<link name="{name}">{BLOCK if name in blocks else ""}<inertial><mass>1</mass>'
        "<inertia><ixx>.01</ixx><iyy>.01</iyy><izz>.01</izz><ixy>0</ixy><ixz>0</ixz><iyz>0</iyz></inertia></inertial></link>"
        for name in ("base", "x_link", "y_link", "z_link")
    )
    joints = "".join(
        f'<joint name="{axis}" type="prismatic"><parent>{parent}</parent><child>{axis}_link</child>'
        f"<axis><xyz>{xyz}</xyz><limit><lower>{low}</lower><upper>{high}</upper>"
        "<effort>100</effort></limit></axis></joint>"
        for axis, parent, xyz, low, high in zip(
            "xyz",
            ("base", "x_link", "y_link"),
            ("1 0 0", "0 1 0", "0 0 1"),
            LOWER,
            UPPER,
            strict=True,
        )
    )
    return f'<sdf version="1.9"><model name="gantry">{links}{joints}</model></sdf>'
