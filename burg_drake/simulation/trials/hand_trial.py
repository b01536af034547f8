"""The floating-hand trial: the open hand stands at the grasp, closes, lifts and holds.

How it came there is not simulated, unless `TrialSettings.approach` asks for it: then the open hand
begins at the pregrasp, and goes straight in before it closes.

After Rudorfer et al., "BURG-Toolkit" (2022): a grasp that collides is rejected before any step; the
fingers close with a limited force until the grip settles; the hand rises by 0.30 m along world z,
unless another motion is asked for, and holds; success means that both fingers still hold the
target.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache, partial

import numpy as np
from pydrake.geometry import Meshcat

from burg_drake.core import Array, make_pose
from burg_drake.grasping.clearance import Clearance, HandClearance
from burg_drake.scene.document import SceneLike, as_scene
from burg_drake.simulation.trials.execution import Execution
from burg_drake.simulation.trials.grasp_trial import KEPT_WORLDS, DrakeTrial, GraspTrial, W
from burg_drake.simulation.trials.lift_carrier import LiftCarrier, LiftPath, lift_paths
from burg_drake.simulation.trials.lift_clearance import HandLiftClearance
from burg_drake.simulation.trials.result import TrialResult
from burg_drake.simulation.trials.trial_settings import DEFAULT_TRIAL, TrialSettings
from burg_drake.simulation.trials.trial_world import TrialWorld, check_overrides
from burg_drake.station.diagram import FloatingHand, StationDiagram, build_station_diagram
from burg_drake.station.document import (
    ENGINES,
    Engine,
    GraspMotion,
    StationLike,
    as_drake_engine,
    as_station,
)


class HandAloneTrial(GraspTrial[W]):
    """Where the hand alone goes, of whatever engine."""

    def lift_paths(self, X_WG: Array, lift: float | None = None) -> tuple[LiftPath, ...]:
        """Straight paths of the hand with the target: the retreat, if there is one, and the lift.

        Args:
            X_WG: (4, 4) grasp in the world.
            lift: length of the lift [m], in place of the motion's.

        Returns:
            One or two, each longer than 0.

        Raises:
            InvalidInputError: the hand would not move, or a length is not one.
        """
        return lift_paths(self.motion, X_WG, lift)

    def X_WG_start(self, X_WG: Array) -> Array:
        """Where (4, 4) the hand begins, of a grasp in the world: there, or at its pregrasp."""
        return X_WG if self._approach(X_WG) is None else self._pregrasp(X_WG)

    def _screen_of_start(self, instance: str, X_WG: Array) -> Clearance | None:
        if self._approach(X_WG) is None:
            return None
        return self.clearance.check(instance, self._pregrasp(X_WG))

    def _approach(self, X_WG: Array) -> LiftPath | None:
        """The path of the hand to a grasp (4, 4) in the world; None if it begins there."""
        if not self.settings.approach or self.motion.standoff <= 0.0:
            return None
        return LiftPath(X_WG[:3, 2], self.motion.standoff)

    def _pregrasp(self, X_WG: Array) -> Array:
        """(4, 4) pregrasp of a grasp in the world."""
        return make_pose(X_WG[:3, :3], X_WG[:3, 3] - self.motion.standoff * X_WG[:3, 2])


class HandTrial(HandAloneTrial[TrialWorld], DrakeTrial):
    """Executes grasps of one scene with the hand alone.

    The approach is not simulated: the open hand begins at the grasp, and what is in its way there
    is a collision. With `TrialSettings.approach` it begins at the pregrasp, the standoff back along
    the approach, and goes straight in with open fingers, as fast as it lifts. What it meets on the
    way is pushed, or stops it, as in the trial of the whole arm.

    Example::

        trial = burg.HandTrial("tabletop_six", "panda_tabletop")
        grasps = burg.sample_grasps("tabletop_six", "panda_tabletop", 10, only=["mug"])
        for X_OG in grasps.X_OG:
            print(trial.run("mug", X_OG).outcome)

    Args:
        scene: the scene.
        station: table, board pose and hand.
        engine: time step and contact settings, or the name of a preset.
        settings: phases of a trial.
        motion: where the hand goes, if not as the settings or else the station say; the standoff
            counts only if the approach is simulated.
        lock: keep objects locked until something moving touches them. Without it all free objects
            are simulated from the start, which costs more and gives the same verdicts.
        meshcat: where to show the trials; recording is the caller's.

    Attributes:
        scene, station, engine, settings, motion, clearance: see `GraspTrial`.
    """

    def __init__(
        self,
        scene: SceneLike,
        station: StationLike,
        *,
        engine: Engine | str = ENGINES["standard"],
        settings: TrialSettings = DEFAULT_TRIAL,
        motion: GraspMotion | None = None,
        lock: bool = True,
        meshcat: Meshcat | None = None,
    ) -> None:
        scene, station = as_scene(scene), as_station(station)
        self._plain = build_station_diagram(scene, station, robot="hand")
        super().__init__(
            scene,
            station,
            "hand",
            as_drake_engine(engine),
            settings=settings,
            clearance=HandClearance(self._plain),
            motion=motion,
            lock=lock,
            meshcat=meshcat,
        )
        kept = lru_cache(maxsize=KEPT_WORLDS)
        self._lift_clearance = kept(partial(HandLiftClearance, self._plain))

    @property
    def hand(self) -> FloatingHand:
        """The hand in `world`."""
        hand = self.world.hand
        assert isinstance(hand, FloatingHand)
        return hand

    def run(
        self,
        instance: str,
        X_OG: Array,
        *,
        friction: float | None = None,
        mass: float | None = None,
        lift: float | None = None,
        without_hull: bool = False,
    ) -> TrialResult:
        """Executes one grasp.

        Args:
            instance: name of the target in the scene.
            X_OG: (4, 4) grasp in the target's frame.
            friction: the target's friction coefficient, in place of the library's.
            mass: the target's mass [kg], in place of the library's; its inertia scales with it.
            lift: length of the lift [m], in place of the motion's.
            without_hull: for who goes on in `world`: run where no part of the hand meets a hull in
                the place of the target.

        Returns:
            The outcome with its margins. A failure of the simulator is an outcome, too.

        Raises:
            InvalidInputError: `X_OG` is not a pose, `instance` cannot be grasped, friction is below
                0, the mass is not above 0, or the lift is of no length.
        """
        X_WG = self.X_WG(instance, X_OG)
        check_overrides(friction, mass)
        paths = self.lift_paths(X_WG, lift)

        def begin(world: TrialWorld) -> Execution:
            return self.begin(instance, X_WG, paths, friction=friction, mass=mass, world=world)

        return self.execute(
            instance, X_WG, begin, friction=friction, mass=mass, without_hull=without_hull
        )

    def begin(
        self,
        instance: str,
        X_WG: Array,
        paths: Sequence[LiftPath] | None = None,
        *,
        friction: float | None = None,
        mass: float | None = None,
        world: TrialWorld | None = None,
    ) -> Execution:
        """Brings the Context to the start of a trial; nothing of an earlier one remains.

        The fingers start where they would touch something first: until then nothing happens. Only
        the target, and what stands so close that it may lean on it, is free to move; others are
        released when something moving touches them. What nothing touches stays at rest, so that
        the result is the one with all objects free, at the cost of those that matter. With an
        approach the fingers start open, and the target is locked like the others.

        Args:
            instance: the target.
            X_WG: (4, 4) grasp in the world at which the open hand is clear.
            paths: of the hand with the target; those of the motion if None.
            friction, mass: as in `run`.
            world: in which it runs; by default the complete one.
        """
        world = self._enter(world)
        target = world.diagram.free[instance]
        everything = set(world.diagram.free.values())
        approach = self._approach(X_WG)
        beside_hand = set() if approach else world.neighbours.close_to({target})
        moving = beside_hand if self._lock else everything
        world.prepare(instance, moving, friction, mass)
        paths = self.lift_paths(X_WG) if paths is None else paths
        plant_context = world.diagram.plant.GetMyMutableContextFromRoot(world.context)
        assert isinstance(world.hand, FloatingHand)
        if approach is None:
            closed = self.closed_before_contact(instance, X_WG)
            world.hand.place(plant_context, X_WG, closed, direction_W=paths[0].direction_W)
            world.command("hand", world.hand.closing_command())
        else:
            X_WP = self._pregrasp(X_WG)
            world.hand.place(plant_context, X_WP, direction_W=approach.direction_W)
            world.command("hand", world.hand.opening_command())
        world.command("lift", np.zeros(2))
        world.simulator.Initialize()
        lift_clearance = partial(self._lift_clearance, instance)
        carrier = LiftCarrier(world, paths, lift_clearance, approach, target)
        return Execution(world, target, moving, carrier)

    def _handle(self, diagram: StationDiagram) -> FloatingHand:
        return FloatingHand(diagram)
