from .arm_trial import ArmTrial as ArmTrial
from .contacts import finger_contact as finger_contact
from .grip_motion import (
    LEVER as LEVER,
    motion_in_hand as motion_in_hand,
)
from .hand_trial import HandTrial as HandTrial
from .result import TrialResult as TrialResult
from .trial_settings import (
    NO_LIMITS as NO_LIMITS,
    TrialSettings as TrialSettings,
)
