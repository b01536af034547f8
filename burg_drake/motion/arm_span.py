"""Largest reach of an arm at any joint positions, and parts of a scene beyond it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from burg_drake.core import Array, inverse, transform_points
from burg_drake.scene import Board, Scene, placed_vertices
from burg_drake.station import Station, StationLike, as_station

if TYPE_CHECKING:
    from burg_drake.motion.numeric_ik import ArmKinematics


@dataclass(frozen=True, eq=False)
class ArmSpan:
    """A ball that the grasp frame's origin never leaves.

    Attributes:
        p_WJ: (3,) its centre, on the axis of the arm's first joint, at the shoulder [m].
        radius: [m].
    """

    p_WJ: Array
    radius: float

    @classmethod
    def of(cls, arm: ArmKinematics, station: StationLike) -> ArmSpan:
        """The span of a station's arm with its hand.

        A point on the axis of a revolute joint belongs to both links that it joins. So a chain of
        points, one on each axis, is rigid from point to point, and G is never farther from the
        first one than the lengths of the chain add up to. The points are chosen so that the sum is
        small; a prismatic joint adds its stroke.

        Args:
            arm: the arm's kinematics.
            station: the station that it stands on: as loaded, or a reference for `load_station`.
        """
        softness = 1e-5  # Metres. Rounds off the kinks of the lengths.
        from scipy.optimize import minimize  # takes 0.1 s

        station = as_station(station)
        assert station.document.arm is not None  # `arm` is its kinematics
        turns = arm.turns == 1.0
        axis, p_AJ = arm.axis[turns], arm.p_AJ[turns]
        p_AG = (arm.X_AH0 @ station.hand.X_HG.matrix())[:3, 3]
        stroke = np.maximum(np.abs(arm.lower), np.abs(arm.upper))[~turns].sum()

        def lengths(along: Array) -> Array:
            chain = np.vstack([p_AJ + along[:, None] * axis, p_AG])
            return np.asarray(np.linalg.norm(np.diff(chain, axis=0), axis=1))

        def rounded(along: Array) -> float:
            return float(np.sqrt(lengths(along) ** 2 + softness**2).sum())

        along = minimize(rounded, ((p_AG - p_AJ) * axis).sum(axis=1), method="BFGS").x
        middle = p_AJ[0] + along[0] * axis[0] if len(along) else p_AG
        (p_WJ,) = transform_points(station.document.arm.X_WA.matrix(), middle[None])
        return cls(p_WJ, float(lengths(along).sum() + stroke))

    def excess_distance(self, p_WQ: Array) -> float:
        """Distance of the nearest of N points (N, 3) out of reach [m]; 0 or less if within."""
        return float(np.linalg.norm(p_WQ - self.p_WJ, axis=1).min()) - self.radius


def unreachable_board(span: ArmSpan, station: Station, board: Board) -> str:
    """One line if all of a board is out of an arm's reach, else ""."""
    X_WS = station.document.X_WS.matrix()
    p_SJ = transform_points(inverse(X_WS), span.p_WJ[None])
    nearest = np.clip(p_SJ, 0.0, (*board.size, 0.0))
    beyond = span.excess_distance(transform_points(X_WS, nearest))
    if beyond <= 0.0:
        return ""
    return (
        f"{station.path}: no part of the board is within reach: its nearest point is"
        f" {span.radius + beyond:.2f} m from the arm's shoulder, and the arm reaches"
        f" {span.radius:.2f} m at most; change X_WS or arm.X_WA"
    )


def unreachable_objects(span: ArmSpan, scene: Scene, station: Station) -> dict[str, str]:
    """One line, by name, for each instance that is out of an arm's reach as a whole."""
    found = {}
    for name in scene.instances:
        p_WV = transform_points(station.document.X_WS.matrix(), placed_vertices(scene, name))
        beyond = span.excess_distance(p_WV)
        if beyond > 0.0:
            found[name] = (
                f"{name!r} is out of reach: it is {span.radius + beyond:.2f} m from the arm's"
                f" shoulder, and the arm reaches {span.radius:.2f} m at most"
            )
    return found
