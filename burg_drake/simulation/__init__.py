"""Time stepping: grasp trials with their outcome and margins, and scenes that come to rest.

Read `grasp_trial` first, then `trial_execution`, the phases of a trial. `settled_scene` brings a
scene to rest; `perturbation` and `grip_limits` repeat trials. `batch` executes many at once.
"""

import lazy_loader

__getattr__, _, _ = lazy_loader.attach_stub(__name__, __file__)

__all__ = [
    "ArmLiftClearance",
    "BatchTrial",
    "BodyContact",
    "Carrier",
    "ContactReader",
    "Execution",
    "FrictionSettings",
    "Grip",
    "GripLoad",
    "HandLiftClearance",
    "HandSegment",
    "HoldForces",
    "LiftPath",
    "LoadSettings",
    "Margins",
    "ModelIndex",
    "MovingBody",
    "MujocoTrial",
    "MujocoWorld",
    "Neighbours",
    "Noise",
    "PlacedRobot",
    "ShakeSettings",
    "SteppedWorld",
    "SuccessRate",
    "TrialWorld",
    "friction_limit",
    "hand_trial_of",
    "shake",
    "success_rate",
    "take_grip",
    "tug",
]


def __dir__() -> list[str]:
    return __all__
