"""Holds motions of the arm against a diagram that none of the reach check's judges has touched.

No collision checker, no filters and no bounds of `burg_drake.motion`: a simulation's diagram with
free objects, positions that are set one after the other, and Drake's penetration query. The target
moves with the hand on retreat and lift, and is looked at as all else is. Of concave objects Drake
sees the convex pieces, as their hulls would keep fingers out of a mug.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from pydrake.math import RigidTransform
from pydrake.multibody.tree import BodyIndex

from burg_drake.core import Array
from burg_drake.motion import ArmPath
from burg_drake.scene import Scene
from burg_drake.station import Station, build_station_diagram, replace_meshes_by_pieces

DEEPER = 1e-3
"""What the target touches at rest counts where it gets deeper by more than that [m]."""
ROUNDED = 1e-9
"""What rests on something exactly may be so deep in it once its pose has been computed [m]."""

Pair = frozenset[BodyIndex]


@dataclass(frozen=True)
class Fault:
    """Two bodies that overlap in an audited motion.

    Attributes:
        part: `transfer`, `approach`, `retreat` or `lift`.
        share: how far along it, from 0 to 1.
        bodies: their names.
        depth: of the overlap; more than at rest, where they touch there [m].
    """

    part: str
    share: float
    bodies: tuple[str, str]
    depth: float

    def __str__(self) -> str:
        where = f"{self.part} at {100.0 * self.share:.0f} %"
        return f"{where}: {' vs '.join(self.bodies)}, {1e3 * self.depth:.2g} mm"


class Audit:
    """Audits motions in one scene."""

    def __init__(self, scene: Scene, station: Station) -> None:
        """Builds the diagram."""
        self._built = build_station_diagram(scene, station, robot="arm")
        plant = self._built.plant
        self._context = self._built.diagram.CreateDefaultContext()
        replace_meshes_by_pieces(self._built, self._context)
        self._state = plant.GetMyMutableContextFromRoot(self._context)
        self._arm = plant.GetModelInstanceByName("arm")
        self._hand = plant.GetModelInstanceByName("hand")
        self._in_hand = set(plant.GetBodyIndices(self._hand))
        still = {body.index() for body in plant.GetBodiesWeldedTo(plant.world_body())}
        self._movers = set(self._built.robot_bodies) - still
        self._at_rest = self._overlaps()

    def faults(
        self, instance: str, arm_path: ArmPath, width: float = np.nan, *, step: float = 0.005
    ) -> list[Fault]:
        """What overlaps, for each configuration that is looked at.

        On retreat and lift, hand and target may. What stands still is not held against each other.

        Args:
            instance: the target; "" if there is none.
            arm_path: the motion.
            width: distance between the pads on retreat and lift [m]; NaN for the open hand.
            step: between two configurations; a radian of each joint counts as one metre, which is
                longer than the arm [m].
        """
        parts = {
            "transfer": arm_path.transfer,
            "approach": arm_path.approach,
            "lift": arm_path.lift,
        }
        held_at = arm_path.lift[0]
        if arm_path.retreat is not None:
            parts["retreat"], held_at = arm_path.retreat, arm_path.retreat[0]
        target = self._built.free.get(instance)
        X_WO = RigidTransform(self._built.X_WO(instance)) if instance else RigidTransform()
        X_HO = self._X_WH(held_at).inverse() @ X_WO
        found = []
        for part, rows in parts.items():
            held = target if part in ("retreat", "lift") else None
            self._set_fingers(np.nan if held is None else width)
            for share, q in between(rows, step):
                X_WH = self._X_WH(q)
                if held is not None:
                    self._place(held, X_WH @ X_HO)
                for pair, depth in self._overlaps().items():
                    if self._counts(pair, held) and depth > self._allowed(pair, held):
                        a, b = sorted(self._built.body_names[body] for body in pair)
                        found.append(Fault(part, share, (a, b), depth))
        if target is not None:
            self._place(target, X_WO)
        return found

    def _counts(self, pair: Pair, held: BodyIndex | None) -> bool:
        """Whether something of a pair moves, and not both together."""
        if held in pair:
            return not pair & self._in_hand
        return bool(pair & self._movers)

    def _allowed(self, pair: Pair, held: BodyIndex | None) -> float:
        """Depth up to which an overlap is none [m]."""
        if held in pair and pair in self._at_rest:
            return self._at_rest[pair] + DEEPER
        return ROUNDED

    def _X_WH(self, q: Array) -> RigidTransform:
        """The hand's pose at arm positions, which are set."""
        plant = self._built.plant
        plant.SetPositions(self._state, self._arm, q)
        body = plant.GetBodyByName(self._built.station.hand.body, self._hand)
        return plant.EvalBodyPoseInWorld(self._state, body)

    def _place(self, body: BodyIndex, X_WO: RigidTransform) -> None:
        plant = self._built.plant
        plant.SetFreeBodyPose(self._state, plant.get_body(body), X_WO)

    def _set_fingers(self, width: float) -> None:
        """Puts the pads at a distance; NaN opens the hand."""
        hand = self._built.station.hand
        low, high = hand.opening
        closed = 0.0 if np.isnan(width) else (high - width) / (high - low)
        for finger in hand.fingers:
            joint = self._built.plant.GetJointByName(finger.joint, self._hand)
            joint.set_translation(self._state, finger.open + closed * (finger.closed - finger.open))

    def _overlaps(self) -> dict[Pair, float]:
        """Depth of all pairs of bodies that overlap [m]."""
        query = self._built.diagram.GetOutputPort("geometry_query").Eval(self._context)
        inspector, plant = query.inspector(), self._built.plant
        depths: dict[Pair, float] = {}
        for overlap in query.ComputePointPairPenetration():
            frames = [inspector.GetFrameId(g) for g in (overlap.id_A, overlap.id_B)]
            pair = frozenset(plant.GetBodyFromFrameId(frame).index() for frame in frames)
            depths[pair] = max(depths.get(pair, 0.0), overlap.depth)
        return depths


def between(rows: Array, step: float) -> Iterator[tuple[float, Array]]:
    """Configurations along a polyline (M, n), with how far along it they are, from 0 to 1."""
    yield 0.0, rows[0]
    for k, change in enumerate(np.diff(rows, axis=0)):
        count = max(1, int(np.ceil(np.abs(change).sum() / step)))
        for s in np.arange(1, count + 1) / count:
            yield float((k + s) / (len(rows) - 1)), rows[k] + s * change
