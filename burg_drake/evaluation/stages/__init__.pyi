from .counts import (
    GraspCount as GraspCount,
    count_grasps as count_grasps,
    grasp_counts as grasp_counts,
)
from .judge import (
    Decide as Decide,
    Decision as Decision,
    Judge as Judge,
    Screen as Screen,
    ScreenAnswers as ScreenAnswers,
    judge_grasp as judge_grasp,
    screen_grasps as screen_grasps,
    trial_decision as trial_decision,
    trial_verdict as trial_verdict,
)
from .mode import (
    mode_for as mode_for,
    require_engine_for as require_engine_for,
    require_scene_for as require_scene_for,
)
from .scene_acceptance import (
    clear_grasp_counts as clear_grasp_counts,
    within_reach as within_reach,
)
from .screening import (
    arm_reach as arm_reach,
    arm_screen as arm_screen,
    arm_settings as arm_settings,
    hand_alone as hand_alone,
    hand_screen as hand_screen,
)
from .station_judge import (
    StationJudge as StationJudge,
    StationJudgeFactory as StationJudgeFactory,
    build_judge as build_judge,
)
