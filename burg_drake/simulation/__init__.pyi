from .arm_trial import ArmTrial as ArmTrial
from .batch.batch_trial import BatchTrial as BatchTrial
from .batch.warp_device import (
    claimed as claimed,
    describe_devices as describe_devices,
    find_devices as find_devices,
    kernels_are_compiled as kernels_are_compiled,
    require_warp as require_warp,
)
from .contacts import (
    BodyContact as BodyContact,
    ContactReader as ContactReader,
    Neighbours as Neighbours,
    RobotContactWatch as RobotContactWatch,
)
from .drift import (
    DriftLimits as DriftLimits,
    is_still as is_still,
    measure_drift as measure_drift,
    predict_drift as predict_drift,
)
from .grasp_trial import GraspTrial as GraspTrial, HandTrial as HandTrial
from .grip_limits import (
    SHAKE_AXES as SHAKE_AXES,
    TUG_DIRECTIONS as TUG_DIRECTIONS,
    Grip as Grip,
    HoldForces as HoldForces,
    friction_limit as friction_limit,
    friction_to_carry as friction_to_carry,
    largest_passing as largest_passing,
    shake as shake,
    take_grip as take_grip,
    tug as tug,
)
from .hand_carrier import (
    ArmLiftClearance as ArmLiftClearance,
    HandLiftClearance as HandLiftClearance,
    LiftPath as LiftPath,
    PlacedRobot as PlacedRobot,
)
from .landing import (
    BoardEdgeGuard as BoardEdgeGuard,
    drop_onto_scene as drop_onto_scene,
    placed_scene as placed_scene,
    reduce_friction as reduce_friction,
    reduce_friction_of as reduce_friction_of,
)
from .mujoco_trial import (
    MujocoTrial as MujocoTrial,
    check_objects as check_objects,
    hand_trial_of as hand_trial_of,
)
from .mujoco_world import (
    ModelIndex as ModelIndex,
    MujocoWorld as MujocoWorld,
    require_mujoco as require_mujoco,
)
from .object_motions import (
    GripMotion as GripMotion,
    MotionTracker as MotionTracker,
    MovingBody as MovingBody,
)
from .perturbation import (
    PerturbedTrial as PerturbedTrial,
    SuccessRate as SuccessRate,
    perturb as perturb,
    success_rate as success_rate,
)
from .relaxation import (
    RELAXING_ENGINE as RELAXING_ENGINE,
    ROLLING_RESISTANCE as ROLLING_RESISTANCE,
    relax as relax,
    resist_rolling as resist_rolling,
)
from .rest_criterion import BodySpeed as BodySpeed, Displacement as Displacement, settle as settle
from .settings import (
    DEFAULT_TRIAL as DEFAULT_TRIAL,
    NO_GRIP_LIMITS as NO_GRIP_LIMITS,
    REFERENCE_LIFT_LENGTH as REFERENCE_LIFT_LENGTH,
    SETTLING_ENGINE as SETTLING_ENGINE,
    SETTLING_TIME as SETTLING_TIME,
    TRIAL_PROTOCOLS as TRIAL_PROTOCOLS,
    FrictionSettings as FrictionSettings,
    LoadSettings as LoadSettings,
    Noise as Noise,
    ShakeSettings as ShakeSettings,
    TrialProtocol as TrialProtocol,
    TrialSettings as TrialSettings,
)
from .settled_scene import SettledScene as SettledScene, settle_scene as settle_scene
from .shaking import (
    ShakeCarrier as ShakeCarrier,
    height_to_shake as height_to_shake,
    require_single_object as require_single_object,
)
from .stable_pose_drops import (
    Confirmation as Confirmation,
    DropSettings as DropSettings,
    confirm_poses as confirm_poses,
)
from .trial_execution import (
    Carrier as Carrier,
    Execution as Execution,
    HandSegment as HandSegment,
    SteppedWorld as SteppedWorld,
)
from .trial_result import (
    CALIBRATION_FILE as CALIBRATION_FILE,
    MAX_LIMIT_DISTANCE as MAX_LIMIT_DISTANCE,
    OUTCOMES_WITHOUT_VERDICT as OUTCOMES_WITHOUT_VERDICT,
    PAD_FRICTION_LEVER as PAD_FRICTION_LEVER,
    Curve as Curve,
    Curves as Curves,
    GripLoad as GripLoad,
    Margins as Margins,
    Population as Population,
    TrialResult as TrialResult,
    calibration as calibration,
    confidence as confidence,
    confidence_from_signs as confidence_from_signs,
    grip_signs as grip_signs,
)
from .trial_world import TrialWorld as TrialWorld
