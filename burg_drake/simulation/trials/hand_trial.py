"""The floating-hand trial: the open hand stands at the grasp, closes, lifts and holds.

After Rudorfer et al., "BURG-Toolkit" (2022): a grasp that collides is rejected before any step; the
fingers close with a limited force until the grip settles; the hand rises by 0.30 m along world z,
unless another motion is asked for, and holds; success means that both fingers still hold the
target.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import cache, partial

import numpy as np
from pydrake.geometry import Meshcat

from burg_drake.core import Array, InvalidInputError
from burg_drake.grasping.clearance import HandClearance
from burg_drake.scene.document import SceneLike, as_scene
from burg_drake.simulation.trials.execution import Execution
from burg_drake.simulation.trials.grasp_trial import GraspTrial
from burg_drake.simulation.trials.lift_carrier import LiftCarrier, LiftPath
from burg_drake.simulation.trials.lift_clearance import HandLiftClearance
from burg_drake.simulation.trials.result import TrialResult
from burg_drake.simulation.trials.scene_trial import check_overrides
from burg_drake.simulation.trials.trial_settings import DEFAULT_TRIAL, TrialSettings
from burg_drake.station.diagram import FloatingHand, build_station_diagram
from burg_drake.station.document import (
    ENGINES,
    Engine,
    GraspMotion,
    StationLike,
    as_station,
)


class HandTrial(GraspTrial):
    """Executes grasps of one scene with the hand alone.

    Args:
        scene: the scene.
        station: table, board pose and hand.
        engine: time step and contact settings, or the name of a preset.
        settings: phases of a trial.
        motion: where the hand goes, if not as the settings or else the station say; the way to the
            grasp does not count, as the hand begins there.
        lock: keep objects locked until something moving touches them. Without it all free objects
            are simulated from the start, which costs more and gives the same verdicts.
        meshcat: where to show the trials; recording is the caller's.

    Attributes:
        diagram: the station diagram that all trials share.
        clearance: the screen of the open hand in it.
        hand: the floating hand in it.
        contacts, neighbours, simulator, settings, motion: see `SceneTrial`.
    """

    hand: FloatingHand

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
        diagram = build_station_diagram(
            scene, station, robot="hand", engine=engine, meshcat=meshcat
        )
        clearance = HandClearance(diagram)
        super().__init__(diagram, FloatingHand(diagram), settings, clearance, motion)
        self._lock = lock
        self._lift_clearance = cache(partial(HandLiftClearance, diagram))

    def run(
        self,
        instance: str,
        X_OG: Array,
        *,
        friction: float | None = None,
        mass: float | None = None,
        lift: float | None = None,
    ) -> TrialResult:
        """Executes one grasp.

        Args:
            instance: name of the target in the scene.
            X_OG: (4, 4) grasp in the target's frame.
            friction: the target's friction coefficient, in place of the library's.
            mass: the target's mass [kg], in place of the library's; its inertia scales with it.
            lift: length of the lift [m], in place of the motion's.

        Returns:
            The outcome with its margins. A failure of the simulator is an outcome, too.

        Raises:
            InvalidInputError: `X_OG` is not a pose, `instance` cannot be grasped, friction is below
                0, the mass is not above 0, or the lift is of no length.
        """
        X_WG = self.X_WG(instance, X_OG)
        check_overrides(friction, mass)
        paths = self.lift_paths(X_WG, lift)
        begin = partial(self.begin, instance, X_WG, paths, friction=friction, mass=mass)
        return self.execute(instance, X_WG, begin)

    def begin(
        self,
        instance: str,
        X_WG: Array,
        paths: Sequence[LiftPath] | None = None,
        *,
        friction: float | None = None,
        mass: float | None = None,
    ) -> Execution:
        """Brings the Context to the start of a trial; nothing of an earlier one remains.

        The fingers start where they would touch something first: until then nothing happens. Only
        the target, and what stands so close that it may lean on it, is free to move; others are
        released when something moving touches them. What nothing touches stays at rest, so that
        the result is the one with all objects free, at the cost of those that matter.

        Args:
            instance: the target.
            X_WG: (4, 4) grasp in the world at which the open hand is clear.
            paths: of the hand with the target; those of the motion if None.
            friction, mass: as in `run`.
        """
        target = self.diagram.free[instance]
        everything = set(self.diagram.free.values())
        moving = self.neighbours.close_to({target}) if self._lock else everything
        self.prepare(instance, moving, friction, mass)
        paths = self.lift_paths(X_WG) if paths is None else paths
        plant_context = self.diagram.plant.GetMyMutableContextFromRoot(self.context)
        closed = self.clearance.free_travel(X_WG)
        self.hand.place(plant_context, X_WG, closed, direction_W=paths[0].direction_W)
        self.command("lift", np.zeros(2))
        self.command("hand", self.hand.closing_command())
        self.simulator.Initialize()
        lift_clearance = partial(self._lift_clearance, target)
        return Execution(self, target, moving, LiftCarrier(self, paths, lift_clearance))

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
        height = self.motion.lift_height if lift is None else lift
        if not 0.0 <= height < math.inf or self.motion.retreat + height <= 0.0:
            raise InvalidInputError(
                f"lift is {height:g} m; with a retreat of {self.motion.retreat:g} m it must be"
                " finite, from 0 on, and move the hand"
            )
        paths = (
            LiftPath(-X_WG[:3, 2], self.motion.retreat),
            LiftPath(self.motion.direction_W, height),
        )
        return tuple(path for path in paths if path.length > 0.0)
