"""A camera on the hand: postures of the arm that bring it where it is wanted."""

from __future__ import annotations

import numpy as np

from burg_drake.core import Array, InvalidInputError, inverse, make_pose
from burg_drake.motion.collision import ArmCollision, require_free_home
from burg_drake.motion.ik import ArmKinematics, arm_solutions, solve_ik
from burg_drake.scene.document import Scene
from burg_drake.station.diagram import build_station_diagram
from burg_drake.station.document import Hand, Station

DEFAULT_CAMERA_POSITION = (0.0, -0.07, -0.09)
"""Usual place of the camera in the grasp frame G [m]: beside the hand in the plane between the
fingers, and behind the fingertips, which it sees at the lower edge of its image."""
LIMIT_MARGIN = 0.01
"""Distance to keep from joint limits [rad or m]."""
REDUNDANT = (16,)
"""Values of the redundant joint, where there is one, that are looked at."""
REFINEMENTS, TOLERANCE = 5, 1e-9
"""Steps by which solutions are refined, and what is left of their error then [m and rad]: poses of
cameras are labels, and should be more exact than those of grasps."""
CHECKED = 12
"""Postures of a hand pose that are checked for collisions, the nearest to home first."""

UNREACHABLE, COLLIDES = "are out of the arm's reach", "have the arm collide"


def usual_X_HC(hand: Hand) -> Array:
    """(4, 4) a camera beside a hand that looks along its fingers."""
    return np.asarray(hand.X_HG.matrix() @ make_pose(p_AB=DEFAULT_CAMERA_POSITION))


class WristCamera:
    """An arm with a camera on its hand, in one scene.

    Attributes:
        X_HC: (4, 4) optical frame in the hand's frame.
    """

    def __init__(self, scene: Scene, station: Station, X_HC: Array | None = None) -> None:
        """Builds the arm among the scene's objects, which takes about a second.

        Args:
            scene: what the arm must not touch.
            station: has the arm.
            X_HC: (4, 4) optical frame in the hand's frame; the usual place if None.

        Raises:
            InvalidInputError: the station has no arm, or the arm collides at home.
        """
        arm = station.document.arm
        if arm is None:
            raise InvalidInputError(
                f"a wrist camera needs an arm, but station {station.name!r} ({station.path}) has"
                " none; view the scene from 'sphere' or a camera of the station"
            )
        built = build_station_diagram(scene, station, robot="arm", weld_objects=True)
        self._collision = ArmCollision(built)
        require_free_home(built, self._collision)
        self._kinematics = ArmKinematics.of(built)
        self._solutions = arm_solutions(
            self._kinematics, redundant=REDUNDANT, limit_margin=LIMIT_MARGIN
        )
        self._home = np.array(arm.home)
        self._X_AS = inverse(arm.X_WA.matrix()) @ station.document.X_WS.matrix()
        self.X_HC = usual_X_HC(station.hand) if X_HC is None else X_HC

    def posture(self, X_SC: Array) -> Array | str:
        """Joint positions (n,) that bring the camera to a pose (4, 4) while nothing collides, as
        near to home as there are; or why there are none."""
        X_AH = self._X_AS @ X_SC @ inverse(self.X_HC)
        found = [
            self._solutions.solve(X_AH[None], turn)[1] for turn in range(self._solutions.rounds)
        ]
        near, met = solve_ik(
            self._kinematics,
            np.broadcast_to(X_AH, (sum(map(len, found)), 4, 4)),
            np.concatenate(found),
            iterations=REFINEMENTS,
            tolerance=TOLERANCE,
        )
        q = self._kinematics.wrapped_near(near[met], self._home)
        if not len(q):
            return UNREACHABLE
        far = np.abs(q - self._home).max(axis=1)
        for one in q[np.argsort(far, kind="stable")[:CHECKED]]:
            if self._collision.is_free(one):
                return np.asarray(one)
        return COLLIDES
