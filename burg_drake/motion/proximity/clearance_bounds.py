"""Quick bounds on the clearance of an arm in a scene, for many configurations at a time.

Where the lower bound is above zero Drake's checker finds the configuration free, where the upper
bound is below zero it finds a collision; in between it has to be asked.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from burg_drake.core import Array, Indices, InvalidInputError, Single, content_hash
from burg_drake.grasping.clearance import shape_of
from burg_drake.motion.ik import LinkPoses
from burg_drake.motion.proximity.arm_shape import ArmShape
from burg_drake.motion.proximity.displacement_bound import ROUNDING, DisplacementBound
from burg_drake.motion.proximity.distance_field import DistanceField
from burg_drake.motion.proximity.solids import ProximitySolid, content_of, solid_of
from burg_drake.station.diagram import StationDiagram

BLOCK = 2**12
"""Configurations that are looked at together: what fits a processor's caches."""
CHUNK = 2**13
"""Nodes of their trees that are looked at together, for the same reason."""
REFINED = 0.022
"""Below this lower bound [m] of a ball what is in it is looked at. Half of a step of 4 cm, so that
paths in steps of that size are mostly proven free by their points."""
LIKELY = -0.008
"""Above this lower bound a configuration is likelier free than not [m]: 0.5 % of the configurations
with the Panda's hand among six objects are judged wrong by it."""


@dataclass(frozen=True, eq=False)
class ClearanceBounds:
    """Bounds on clearances from the scene, and of the arm from itself.

    Links that cannot meet wherever the arm stands within its joints' limits do not count. Below
    zero the bounds say that something collides, or may; how deep, they say only roughly.

    Attributes:
        lower: (N,) not above the clearance [m]; above zero it is proven that nothing collides.
        upper: (N,) below zero where it is proven that something collides, else infinite [m].
    """

    lower: Array
    upper: Array

    @property
    def free(self) -> np.ndarray:
        """(N,) whether it is proven that nothing collides."""
        return self.lower > 0.0

    @property
    def blocked(self) -> np.ndarray:
        """(N,) whether it is proven that something collides."""
        return self.upper < 0.0

    @property
    def likely_free(self) -> np.ndarray:
        """(N,) the best guess, where Drake is not to be asked."""
        return (self.lower > LIKELY) & ~self.blocked


class ArmProximity:
    """Bounds the clearance of an arm and its open hand from the scene and from itself.

    Attributes:
        links: the arm's forward kinematics.
        field: distances from the scene.
        content: hash of all that the bounds follow from.
        apart: pairs of the robot's bodies that are proven not to meet while its joints are within
            their limits.
    """

    def __init__(self, station_diagram: StationDiagram) -> None:
        """Reads the diagram; nothing of it is kept.

        Args:
            station_diagram: built with `robot="arm"` and `weld_objects=True`.

        Raises:
            InvalidInputError: the diagram has no arm, or a shape or joint that is not known.
        """
        if station_diagram.robot != "arm":
            raise InvalidInputError(
                f"the diagram was built with robot={station_diagram.robot!r}; build it with 'arm'"
            )
        plant = station_diagram.plant
        shape = ArmShape.of(station_diagram)
        self.links = shape.links
        solids = _solids(station_diagram)
        self.field = DistanceField.of(solids)
        self.content = content_hash(shape.content, content_of(solids))
        self._trees, self._itself = shape.trees, shape.itself
        self._bodies = self._trees.bodies
        hand = set(plant.GetBodyIndices(plant.GetModelInstanceByName("hand")))
        moving = [i for i, body in enumerate(self._bodies) if body.frame]
        self._moving = np.array(moving, dtype=np.intp)
        links = [i for i in moving if self._bodies[i].body not in hand]
        self._arm = np.array(links, dtype=np.intp)
        self._radius = np.array([b.radius for b in self._bodies], dtype=np.float32)[:, None]
        self._roots = np.array([body.root for body in self._bodies])
        bodies = [body.body for body in self._bodies]
        self.apart = [(bodies[i], bodies[j]) for i, j in self._itself.apart]
        self._displacement = DisplacementBound(self.links, self._trees, shape.limits)

    def bounds(self, q: Array, *, hand: bool = True) -> ClearanceBounds:
        """Bounds at arm positions `q` (N, n).

        Args:
            q: positions [rad or m].
            hand: whether hand and fingers, open as in the default context, count against the
                scene; against the arm's own links they always do.
        """
        q = np.asarray(q, dtype=float)
        lower = np.empty(len(q))
        upper = np.empty(len(q))
        for start in range(0, len(q), BLOCK):
            block = slice(start, start + BLOCK)
            lower[block], upper[block] = self._bounds(q[block], hand)
        return ClearanceBounds(lower - ROUNDING, upper + ROUNDING)

    def displacement(self, q_a: Array, q_b: Array) -> Array:
        """How far any point of the robot moves at most, the hand's open fingers included.

        Two parts of the robot do not move farther to each other either, as only the joints between
        them matter there. So where the lower bounds at the two ends add up to more than this, the
        whole segment is free.

        Args:
            q_a, q_b: (N, n) ends of straight segments, within the joints' limits.

        Returns:
            (N,) upper bounds [m].
        """
        q_a, q_b = np.asarray(q_a, dtype=float), np.asarray(q_b, dtype=float)
        found = np.empty(len(q_a))
        for start in range(0, len(q_a), BLOCK):
            block = slice(start, start + BLOCK)
            found[block] = self._displacement.between(q_a[block], q_b[block])
        return found

    def _bounds(self, q: Array, hand: bool) -> tuple[Single, Single]:
        poses = self.links.poses(q)
        centers = self._trees.roots_placed(poses)
        counted = self._moving if hand else self._arm
        bound = self.field.lower_at(centers[:, counted]) - self._radius[counted]
        row, which = np.nonzero(bound < REFINED)
        bound[row, which] = np.inf
        lower = bound.min(axis=0, initial=np.inf)
        upper = np.full_like(lower, np.inf)
        self._descend(poses, which, self._roots[counted[row]], lower, upper)
        low, up = self._itself.bounds(q, poses, centers, upper >= -ROUNDING)
        lower, upper = np.minimum(lower, low), np.minimum(upper, up)
        return lower, np.where(upper < -ROUNDING, upper, np.float32(np.inf))

    def _descend(
        self, poses: LinkPoses, which: Indices, node: Indices, lower: Single, upper: Single
    ) -> None:
        """Brings in how far nodes of the trees are from the scene in configurations `which`."""
        trees = self._trees
        for start in range(0, len(which), CHUNK):
            k, at = which[start : start + CHUNK], node[start : start + CHUNK]
            places = trees.placed(at, poses, k)
            bound = self.field.lower_at(places) - trees.outer.take(at, axis=1)
            if trees.child[0, at[0]] >= 0:
                i, f = np.nonzero(bound < REFINED)
                bound[i, f] = np.inf
                self._descend(poses, k[f], trees.child[i, at[f]], lower, upper)
            else:
                i, f = np.nonzero(bound <= 0.0)
                if len(f):
                    up = self.field.upper_at(places[:, i, f]) - trees.inner[i, at[f]]
                    np.minimum.at(upper, k[f], up)
            np.minimum.at(lower, k, bound.min(axis=0))


def _solids(station_diagram: StationDiagram) -> list[ProximitySolid]:
    """Everything that is not the robot, where it stands."""
    plant = station_diagram.plant
    inspector = station_diagram.scene_graph.model_inspector()
    context = plant.CreateDefaultContext()
    robot = set(station_diagram.robot_bodies)
    solids = []
    for geometry in inspector.GetAllGeometryIds():
        body = plant.GetBodyFromFrameId(inspector.GetFrameId(geometry))
        if body.index() in robot or inspector.GetProximityProperties(geometry) is None:
            continue
        X_WB = plant.EvalBodyPoseInWorld(context, body).GetAsMatrix4()
        X_BP = inspector.GetPoseInFrame(geometry).GetAsMatrix4()
        solids.append(solid_of(shape_of(inspector, geometry, X_BP), X_WB))
    return solids
