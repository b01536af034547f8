"""Collision checks of the open hand against the scene, with the hand's real collision geometry."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import replace
from typing import Literal, get_args

import numpy as np
from numpy.typing import NDArray
from pydrake.geometry import PenetrationAsPointPair, QueryObject, SignedDistancePair

from burg_drake.core import (
    Array,
    InvalidInputError,
    Outcome,
    Pose,
    UnknownNameError,
    check_pose,
    suggest_names,
)
from burg_drake.geometry import HandScreen
from burg_drake.grasping.clearance_verdict import Clearance, ClearanceBatch
from burg_drake.grasping.collision_geometry import filter_hand_pairs, read_shapes, screened_bodies
from burg_drake.objects import ObjectLibrary
from burg_drake.scene import Instance, Scene, SceneDocument
from burg_drake.station import (
    FloatingHand,
    StationDiagram,
    StationLike,
    as_station,
    build_station_diagram,
)

ClearanceMode = Literal["exact", "conservative"]


class HandClearance:
    """Checks grasps of one scene; objects stand where the scene document places them.

    Args:
        station_diagram: a diagram built with `robot="hand"`.
        bodies: names of the bodies to check; all if None.

    Raises:
        UnknownNameError: there is no such body.
        InvalidInputError: a collision geometry has an unsupported shape.
    """

    def __init__(
        self, station_diagram: StationDiagram, bodies: Collection[str] | None = None
    ) -> None:
        self._hand = FloatingHand(station_diagram)
        self._context = station_diagram.diagram.CreateDefaultContext()
        self._plant_context = station_diagram.plant.GetMyMutableContextFromRoot(self._context)
        self._query_port = station_diagram.scene_graph.get_query_output_port()
        names = screened_bodies(station_diagram)
        for name in bodies or ():
            if name not in names.values():
                known = tuple(names.values())
                raise UnknownNameError(f"there is no body {name!r}; {suggest_names(name, known)}")
        self._names = {i: name for i, name in names.items() if bodies is None or name in bodies}
        self._bodies = filter_hand_pairs(station_diagram, self._context, self._names)
        self._graph_context = station_diagram.scene_graph.GetMyContextFromRoot(self._context)
        self._station_diagram = station_diagram
        self._hand.place(self._plant_context, np.eye(4))
        shapes, others = read_shapes(
            station_diagram, self._plant_context, self._query(), self._bodies, self._names
        )
        self._screen = HandScreen(shapes, others)
        self._finger_screens: dict[int, HandScreen] = {}

    def check(self, instance: str, X_WG: Array) -> Clearance:
        """Checks one grasp; the result is the same as in a batch, bit by bit.

        Args:
            instance: the target's name in the scene.
            X_WG: (4, 4) grasp in the world.
        """
        (verdict,) = self.measure(instance, X_WG[None])
        return verdict

    def check_all(
        self, instance: str, X_WG: Array, *, mode: ClearanceMode = "exact", margin: float = 0.0
    ) -> list[Clearance]:
        """The verdicts of `measure` as a list."""
        return list(self.measure(instance, X_WG, mode=mode, margin=margin))

    def measure(
        self, instance: str, X_WG: Array, *, mode: ClearanceMode = "exact", margin: float = 0.0
    ) -> ClearanceBatch:
        """Measures the clearance of grasps.

        The clearance does not depend on the margin: a set that was measured once can be sorted and
        thresholded afterwards.

        Args:
            instance: the target's name in the scene.
            X_WG: (N, 4, 4) grasps in the world.
            mode: `exact` computes exact depths; use it for reports, rankings and comparisons with
                trials. `conservative` counts a pair as an overlap if no face of a hand part or of a
                body's piece separates it. A hand that overlaps a body is never called clear; a
                positive clearance is exact, a negative one a lower bound of the clearance from the
                blocker. But it rejects a tenth of the clear grasps, those with edges or corners of
                hand and body close to each other. It takes two thirds of the time where most grasps
                collide: use it to thin out large sets that need not be complete.
            margin: required clearance of a grasp [m].

        Returns:
            N verdicts. If the hand overlaps several bodies, the blocker is the one that would also
            be there in an emptier scene: the target, then the table, background, and clutter.
            Overlaps up to `CONTACT_TOLERANCE` do not count. Without an overlap, a body nearer than
            the margin is the blocker.

        Raises:
            InvalidInputError: `X_WG` are not poses, or the margin is not 0 or more.
            UnknownNameError: no such mode.
        """
        if not 0.0 <= margin < np.inf:
            raise InvalidInputError(f"margin is {margin} m; give a clearance of 0 or more")
        if mode not in get_args(ClearanceMode):
            raise UnknownNameError(
                f"mode {mode!r} does not exist; {suggest_names(mode, get_args(ClearanceMode))}"
            )
        outcomes = self.outcomes(instance)
        X_WG = check_pose(X_WG, "X_WG")
        faces_only = mode == "conservative"
        blocker, overlap = self._screen.deepest(X_WG, list(outcomes), faces_only=faces_only)
        near, clearance = blocker.copy(), -overlap
        clear = blocker == ""
        near[clear], clearance[clear] = self._screen.nearest(X_WG[clear])
        too_near = (blocker == "") & (clearance < margin)
        blocker[too_near] = near[too_near]
        values = {"": "", **{name: outcome.value for name, outcome in outcomes.items()}}
        return ClearanceBatch(
            np.array([values[name] for name in blocker], dtype=np.str_),
            blocker.astype(np.str_),
            overlap,
            clearance,
            near.astype(np.str_),
        )

    def is_clear(self, X_WG: Array) -> NDArray[np.bool_]:
        """(N,) whether the open hand overlaps nothing at grasps (N, 4, 4); faster than `measure`,
        which also measures the clearance."""
        blocker, _ = self._screen.deepest(check_pose(X_WG, "X_WG"), list(self._screen.bodies))
        return np.asarray(blocker == "")

    def blockers(self, instance: str, X_WG: Array, mode: ClearanceMode) -> NDArray[np.str_]:
        """(N,) `blocker` of `measure` without a margin; faster, as no clearance is measured."""
        blocker, _ = self._screen.deepest(
            X_WG, list(self.outcomes(instance)), faces_only=mode == "conservative"
        )
        return blocker.astype(np.str_)

    def outcomes(self, instance: str) -> dict[str, Outcome]:
        """Outcome of an overlap with each body for grasps of `instance`, by priority."""
        # The first of these outcomes is reported.
        outcome_order = (
            Outcome.COLLISION_TARGET,
            Outcome.COLLISION_TABLE,
            Outcome.COLLISION_BACKGROUND,
            Outcome.COLLISION_CLUTTER,
        )
        outcomes = {name: self._outcome(instance, name) for name in self._screen.bodies}
        order = sorted(outcomes, key=lambda name: (outcome_order.index(outcomes[name]), name))
        return {name: outcomes[name] for name in order}

    def free_travel(self, X_WG: Array) -> float:
        """How far the fingers can close before they touch anything.

        Args:
            X_WG: (4, 4) grasp at which the open hand is clear.

        Returns:
            0 (open) to 1 (pads together), to within 0.025; up to there the fingers are clear.
        """
        closed = 0.0
        for step in (0.125, 0.025):  # 5 mm and 1 mm of the Panda hand's travel
            while closed + step <= 1.0 and not self.touched(X_WG, closed + step):
                closed += step
        return closed

    def free_travels(self, X_WG: Array) -> Array:
        """How far the fingers can close before they touch anything, for many grasps together.

        Fingers overlap a body only beyond `CONTACT_TOLERANCE` here, and in `free_travel` at once,
        so that the two may differ by a step.

        Args:
            X_WG: (N, 4, 4) grasps at which the open hand is clear.

        Returns:
            (N,) 0 (open) to 1 (pads together), to within 0.025.
        """
        coarse, levels = 5, 40  # Steps of 0.125 and 0.025.
        level = np.zeros(len(X_WG), dtype=int)
        for step in (coarse, 1):
            rows = np.arange(len(X_WG))
            while len(rows):
                rows = rows[level[rows] + step <= levels]
                for k in np.unique(level[rows] + step):
                    at = rows[level[rows] + step == k]
                    free = self._fingers_are_clear(k, levels, X_WG[at])
                    level[at[free]] = k
                    rows = rows[~np.isin(rows, at[~free])]
        return level / levels

    def _fingers_are_clear(self, level: int, levels: int, X_WG: Array) -> NDArray[np.bool_]:
        """(N,) whether the fingers overlap nothing at grasps (N, 4, 4), closed up to a level."""
        if level not in self._finger_screens:
            self._hand.place(self._plant_context, np.eye(4), level / levels)
            fingers = set(self._hand.fingers)
            bodies = {g: b for g, b in self._bodies.items() if b in fingers}
            shapes, _ = read_shapes(
                self._station_diagram, self._plant_context, self._query(), bodies, self._names
            )
            self._finger_screens[level] = HandScreen(shapes, self._screen.bodies)
        screen = self._finger_screens[level]
        blocker, _ = screen.deepest(X_WG, list(screen.bodies))
        return np.asarray(blocker == "")

    def touched(self, X_WG: Array, closed: float = 0.0) -> dict[str, float]:
        """Bodies that the hand overlaps, by Drake's own query for a single grasp.

        Args:
            X_WG: (4, 4) grasp in the world.
            closed: how far the fingers are closed, from 0 (open) to 1 (pads together).

        Returns:
            Names and depths [m]; a depth is along some separating direction, and may be larger
            than the smallest one.
        """
        self._hand.place(self._plant_context, X_WG, closed)
        found: dict[str, float] = {}
        for pair in self._query().ComputePointPairPenetration():
            name = self._body_name(pair)
            found[name] = max(found.get(name, 0.0), pair.depth)
        return found

    def signed_distances(self, X_WG: Array) -> dict[str, float]:
        """Signed distance of the open hand from each body, by Drake's own query.

        For curved shapes its search may end some millimetres above the distance.

        Args:
            X_WG: (4, 4) grasp in the world.

        Returns:
            Signed distance by name [m].
        """
        self._hand.place(self._plant_context, X_WG)
        found: dict[str, float] = {}
        for pair in self._query().ComputeSignedDistancePairwiseClosestPoints():
            name = self._body_name(pair)
            found[name] = min(found.get(name, np.inf), pair.distance)
        return found

    def _body_name(self, pair: PenetrationAsPointPair | SignedDistancePair) -> str:
        """Name of the body that the hand meets in a pair."""
        names, bodies = self._names, self._bodies
        return names.get(bodies[pair.id_A]) or names[bodies[pair.id_B]]

    def _query(self) -> QueryObject:
        return self._query_port.Eval(self._graph_context)

    def _outcome(self, instance: str, blocker: str) -> Outcome:
        if blocker == instance:
            return Outcome.COLLISION_TARGET
        if blocker == "table":
            return Outcome.COLLISION_TABLE
        if blocker in self._station_diagram.free:
            return Outcome.COLLISION_CLUTTER
        return Outcome.COLLISION_BACKGROUND


def hand_clearance_alone(
    library: ObjectLibrary, object: str, station: StationLike
) -> HandClearance:
    """A `HandClearance` of a station's hand against one object, without table and clutter.

    Its world is the object's frame O: `hand_clearance_alone(...).check_all(object, X_OG)`.

    Args:
        library: the library.
        object: name in it; the outcome of an overlap is `COLLISION_TARGET`.
        station: the station with the hand.

    Raises:
        UnknownNameError: the library has no such object.
        InvalidInputError: see `HandClearance`.
    """
    station = as_station(station)
    library.entry(object)
    document = SceneDocument(
        name=object, library=str(library.root), instances=(Instance(object=object),)
    )
    empty = replace(station, document=replace(station.document, X_WS=Pose(), background={}))
    scene = Scene(document, library, library.root)
    return HandClearance(build_station_diagram(scene, empty, robot="hand"), bodies=[object])
