"""Shapes, stations and grasps that the tests of trials share."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import trimesh

from burg_drake.core import Array, Pose, grasp_from_axes, resolve_reference
from burg_drake.simulation import REFERENCE_LIFT_LENGTH, TrialSettings
from burg_drake.station import (
    ENGINES,
    GraspMotion,
    Obstacle,
    Station,
    StationDocument,
    Table,
    load_hand,
)

QUICK = ENGINES["screening"]
"""Of most trials; `test_statics` holds all engines against closed forms."""
GRAVITY = 9.81
FORCE = 40.0
"""Of each finger of the Panda hand [N]."""
PAD = (0.0175, 0.0185)
"""Size of its pads [m], across and along the approach."""
BOX = (0.06, 0.09, 0.08)
"""Size of the box [m]; only its x extent fits between the fingers."""
BOX_MASS = 0.3
WIDE = (0.096, 0.15, 0.10)
"""Size of a box that the Panda's fingers do not fit about [m]."""
POST = (0.04, 0.04, 0.42)
"""Size of the post [m], which reaches up to an arm's forearm."""
PILLAR = (0.04, 0.04, 0.13)
"""Size of the pillar [m], which topples if it is pushed in its upper half."""


def lifting(height: float, time: float, **others: float) -> TrialSettings:
    """Phases with a lift of a height [m] in a time [s]."""
    motion = GraspMotion(lift_height=height)
    return TrialSettings(
        motion=motion, lift_time=time * (REFERENCE_LIFT_LENGTH / height) ** 0.5, **others
    )


SLOW = lifting(0.01, 1.0, hold_time=0.3)
"""Accelerates by at most 0.04 m/s^2, so that weight alone decides."""


def box_mesh(size: tuple[float, float, float]) -> trimesh.Trimesh:
    """A box that stands on its origin."""
    return trimesh.creation.box(
        size, trimesh.transformations.translation_matrix((0, 0, size[2] / 2))
    )


def make_station(X_WS: Pose = Pose(), obstacles: dict[str, Obstacle] | None = None) -> Station:
    """The Panda hand over a large table, without an arm."""
    hand = load_hand("panda_hand")
    document = StationDocument(
        name="test",
        X_WS=X_WS,
        table=Table(center=(0.3, 0.2), size=(3.0, 3.0, 0.1)),
        background=obstacles or {},
    )
    return Station(document, hand, resolve_reference(hand.model), None, Path("test.yaml"))


def from_above(z: float, x: float = 0.0, y: float = 0.0, yaw: float = 0.0) -> Array:
    """Grasp (4, 4) from above at (x, y, z) [m]; closes along x turned by `yaw` [rad]."""
    return grasp_from_axes((np.cos(yaw), np.sin(yaw), 0.0), (0.0, 0.0, -1.0), (x, y, z))


CENTRE = from_above(0.05)
"""At the middle of the box, above its centre of mass."""
