"""Grasps for the benchmarks of trials: good ones and bad ones, all clear for the open hand."""

from __future__ import annotations

import dataclasses

import numpy as np

import burg_drake as burg
from burg_drake.core import Array, Pose, make_pose, rng_from, rot_z
from burg_drake.scene import Scene
from burg_drake.simulation import MujocoTrial
from burg_drake.station import Station, Table

CONE = np.deg2rad(75.0)
"""Grasps approach from above, within this angle."""
SLIPPERY = 0.4
"""Every second grasp is tried with so much of the object's friction: most sampled grasps are good,
and a grasp that is good by far tells little."""


def hand_only(station: Station, angle: float = 0.0, x: float = 0.0, y: float = 0.0) -> Station:
    """A station without its arm, on a large table; the board is turned and then moved.

    Args:
        station: the station.
        angle: about the world's z axis [rad].
        x, y: in the world [m].
    """
    X_WS = make_pose(rot_z(angle), (x, y, 0.0)) @ station.document.X_WS.matrix()
    document = dataclasses.replace(
        station.document,
        arm=None,
        X_WS=Pose.from_matrix(X_WS, quaternion=True),
        table=Table(size=(6.0, 6.0, 0.1), friction=station.document.table.friction),
    )
    return dataclasses.replace(station, document=document, arm_model=None)


def sampled_set(scene: Scene, station: Station, name: str, count: int) -> burg.GraspSet:
    """Antipodal grasps on an instance, in its frame, from above; clear or not."""
    X_WO = station.document.X_WS.matrix() @ scene.X_SO(name)
    down_O = np.round(-X_WO[2, :3], 9)
    return burg.grasps.sample_antipodal(
        scene.library.surface(scene.instance(name).object),
        count,
        rng_from("mixed grasps", name),
        burg.grasps.AntipodalSettings(
            friction=scene.entry(name).friction,
            opening=station.hand.opening,
            approach_cones=(burg.grasps.ApproachCone(tuple(down_O), CONE),),
        ),
    )


def sampled_grasps(scene: Scene, station: Station, name: str, count: int) -> Array:
    """Poses (N, 4, 4) of those."""
    return sampled_set(scene, station, name, count).X_OG


def clear_grasps(trial: burg.HandTrial | MujocoTrial, name: str, count: int) -> Array:
    """Clear ones (at most `count`, 4, 4) of a hundred times as many antipodal grasps."""
    grasps = sampled_grasps(trial.diagram.scene, trial.diagram.station, name, 100 * count)
    screened = trial.clearance.check_all(name, trial.diagram.X_WO(name) @ grasps)
    return grasps[[verdict.outcome is None for verdict in screened]][:count]


def frictions(scene: Scene, name: str, count: int) -> Array:
    """Coefficients (count,) to try the grasps of an instance with."""
    return scene.entry(name).friction * np.where(np.arange(count) % 2, SLIPPERY, 1.0)
