"""What trials of grasps share, whatever carries the hand: the screen of the open hand before, and
the result of the execution after it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

from burg_drake.core import Array
from burg_drake.grasping.clearance import HandClearance
from burg_drake.simulation.trials.execution import Execution
from burg_drake.simulation.trials.result import TrialResult, collision, failure
from burg_drake.simulation.trials.scene_trial import SceneTrial
from burg_drake.simulation.trials.trial_settings import TrialSettings
from burg_drake.station.diagram import HandHandle, StationDiagram
from burg_drake.station.document import GraspMotion


class GraspTrial(SceneTrial):
    """Executes grasps in one scene.

    Args:
        diagram, hand, settings, motion: see `SceneTrial`.
        clearance: the screen of the open hand in the scene.

    Attributes:
        clearance: as given.
    """

    def __init__(
        self,
        diagram: StationDiagram,
        hand: HandHandle,
        settings: TrialSettings,
        clearance: HandClearance,
        motion: GraspMotion | None = None,
    ) -> None:
        super().__init__(diagram, hand, settings, motion)
        self.clearance = clearance

    def execute(self, instance: str, X_WG: Array, begin: Callable[[], Execution]) -> TrialResult:
        """Executes a grasp, if the open hand is clear at it.

        Args:
            instance: the target.
            X_WG: (4, 4) grasp in the world.
            begin: brings the Context to the start of the trial.

        Returns:
            The outcome with its margins. A failure of the simulator is an outcome, too.
        """
        screen = self.clearance.check(instance, X_WG)
        if screen.outcome is not None:
            return collision(screen)
        try:
            found = begin().run()
            return replace(found, margins=replace(found.margins, clearance=screen.clearance))
        except (RuntimeError, SystemExit) as error:  # Drake ends some failed checks by SystemExit
            self.invalidate()
            return failure(error, screen, self.context.get_time())
