from .mujoco_trial import MujocoTrial as MujocoTrial
from .package import require_mujoco as require_mujoco
from .trial_of_engine import hand_trial_of as hand_trial_of
