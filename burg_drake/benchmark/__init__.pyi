from .answers import (
    AnswerError as AnswerError,
    FarGraspsError as FarGraspsError,
    PlannedGrasps as PlannedGrasps,
    frame_mistakes as frame_mistakes,
    read_answer as read_answer,
)
from .baselines import (
    antipodal as antipodal,
    random_grasps as random_grasps,
    top_down as top_down,
)
from .benchmark_folder import (
    BenchmarkDocument as BenchmarkDocument,
    BenchmarkResult as BenchmarkResult,
    BenchmarkTimes as BenchmarkTimes,
    JudgedAnswer as JudgedAnswer,
    Round as Round,
    StoredAnswer as StoredAnswer,
    StoredGrasps as StoredGrasps,
    load_result as load_result,
)
from .benchmark_run import (
    choose_grasps as choose_grasps,
    run_benchmark as run_benchmark,
)
from .burg_planner import Observation as Observation, observation_id as observation_id
from .clearing import Attempt as Attempt, episodes as episodes
from .leaderboard import (
    LeaderboardExtras as LeaderboardExtras,
    failed_grasps as failed_grasps,
    scene_pictures as scene_pictures,
    write_leaderboard as write_leaderboard,
)
from .measures import BenchmarkMeasure as BenchmarkMeasure, measure_all as measure_all
from .method_comparison import (
    MethodComparison as MethodComparison,
    MethodDifference as MethodDifference,
    compare_by_suite as compare_by_suite,
    compare_methods as compare_methods,
    permutation_p_value as permutation_p_value,
    version_notes as version_notes,
)
from .method_tables import all_tables as all_tables
from .observing import SceneCamera as SceneCamera
from .oracle_planner import oracle as oracle
from .planner_check import (
    CheckScene as CheckScene,
    PlannerCheck as PlannerCheck,
    check_answers as check_answers,
    check_planner as check_planner,
    make_check_scene as make_check_scene,
)
from .planners import (
    BUILTIN_PLANNERS as BUILTIN_PLANNERS,
    REFERENCE_FORMS as REFERENCE_FORMS,
    GraspPlanner as GraspPlanner,
    PlannerError as PlannerError,
    open_planner as open_planner,
    require_websocket_packages as require_websocket_packages,
    serve_planner as serve_planner,
)
from .real_images import RealImages as RealImages
from .robot_trials import (
    RobotSuccess as RobotSuccess,
    plan_robot_trials as plan_robot_trials,
    robot_successes as robot_successes,
)
from .robustness import (
    ConditionEffect as ConditionEffect,
    condition_effects as condition_effects,
)
from .settings import (
    SUITE_FOLDER as SUITE_FOLDER,
    VERIFIED_GRASPS as VERIFIED_GRASPS,
    BenchmarkSettings as BenchmarkSettings,
    Budget as Budget,
    Conditions as Conditions,
)
from .suite import (
    Suite as Suite,
    SuiteDocument as SuiteDocument,
    SuiteLike as SuiteLike,
    SuiteScene as SuiteScene,
    SuiteSettings as SuiteSettings,
    load_suite as load_suite,
    make_suite as make_suite,
    suite_names as suite_names,
    write_suite_scene as write_suite_scene,
)
from .suite_camera import CameraPlacement as CameraPlacement, SuiteCamera as SuiteCamera
from .verification import (
    Verification as Verification,
    VerifiedGrasp as VerifiedGrasp,
    verify_result as verify_result,
)
