from .arm_trial import ArmTrial as ArmTrial
from .contacts import (
    BodyContact as BodyContact,
    finger_contact as finger_contact,
)
from .execution import (
    Execution as Execution,
    OtherTouched as OtherTouched,
)
from .grasp_trial import KEPT_WORLDS as KEPT_WORLDS
from .grip_motion import (
    LEVER as LEVER,
    motion_in_hand as motion_in_hand,
)
from .hand_trial import (
    HandAloneTrial as HandAloneTrial,
    HandTrial as HandTrial,
)
from .lift_carrier import (
    FloatingCarrier as FloatingCarrier,
    LiftPath as LiftPath,
    check_count as check_count,
)
from .lift_clearance import HandLiftClearance as HandLiftClearance
from .result import TrialResult as TrialResult
from .trial_settings import (
    DEFAULT_TRIAL as DEFAULT_TRIAL,
    NO_LIMITS as NO_LIMITS,
    TrialSettings as TrialSettings,
)
from .trial_world import check_overrides as check_overrides
