from .confidence.grip_signs import GripLoad as GripLoad
from .mujoco.mujoco_trial import MujocoTrial as MujocoTrial
from .mujoco.mujoco_world import MujocoWorld as MujocoWorld
from .mujoco.trial_of_engine import hand_trial_of as hand_trial_of
from .rest.neighbours import Neighbours as Neighbours
from .robustness.friction_search import (
    friction_limit as friction_limit,
)
from .robustness.grip import (
    Grip as Grip,
    take_grip as take_grip,
)
from .robustness.hold_force import (
    HoldForces as HoldForces,
    shake as shake,
    tug as tug,
)
from .robustness.perturbation import (
    SuccessRate as SuccessRate,
    success_rate as success_rate,
)
from .robustness.settings import (
    FrictionSettings as FrictionSettings,
    LoadSettings as LoadSettings,
    Noise as Noise,
)
from .trials.carrier import (
    Carrier as Carrier,
    HandSegment as HandSegment,
)
from .trials.contacts import (
    BodyContact as BodyContact,
    ContactReader as ContactReader,
)
from .trials.execution import (
    Execution as Execution,
    SteppedWorld as SteppedWorld,
)
from .trials.lift_carrier import LiftPath as LiftPath
from .trials.lift_clearance import (
    ArmLiftClearance as ArmLiftClearance,
    HandLiftClearance as HandLiftClearance,
    PlacedRobot as PlacedRobot,
)
from .trials.result import Margins as Margins
from .trials.trial_world import TrialWorld as TrialWorld
