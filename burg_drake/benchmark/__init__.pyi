from .benchmark_folder import (
    BenchmarkDocument as BenchmarkDocument,
    BenchmarkResult as BenchmarkResult,
    JudgedAnswer as JudgedAnswer,
    StoredAnswer as StoredAnswer,
    load_result as load_result,
)
from .benchmark_run import run_benchmark as run_benchmark
from .burg_planner import Observation as Observation
from .clearing import Attempt as Attempt, episodes as episodes
from .leaderboard import write_leaderboard as write_leaderboard
from .measures import MEASURES as MEASURES, Measure as Measure, measure_all as measure_all
from .method_comparison import (
    MethodComparison as MethodComparison,
    MethodDifference as MethodDifference,
    compare_by_suite as compare_by_suite,
    compare_methods as compare_methods,
)
from .method_tables import TableText as TableText, comparison_tables as comparison_tables
from .observing import SceneCamera as SceneCamera
from .suite import (
    SUITES as SUITES,
    Budget as Budget,
    CameraPlacement as CameraPlacement,
    Protocol as Protocol,
    Suite as Suite,
    SuiteCamera as SuiteCamera,
    SuiteDocument as SuiteDocument,
    SuiteLike as SuiteLike,
    SuiteScene as SuiteScene,
    load_suite as load_suite,
    make_suite as make_suite,
    suite_names as suite_names,
    write_suite_scene as write_suite_scene,
)
from .verification import (
    VERIFIED_GRASPS as VERIFIED_GRASPS,
    Verification as Verification,
    VerifiedGrasp as VerifiedGrasp,
    verify_result as verify_result,
)
