"""Benchmarks of grasp planners: suites of scenes, planners, runs, and the comparison of methods.

Read `suite` first, then `benchmark_run`. The file `burg_planner` is copied beside planners.
"""

import lazy_loader

__getattr__, _, _ = lazy_loader.attach_stub(__name__, __file__)

__all__ = [
    "Attempt",
    "BenchmarkDocument",
    "BenchmarkMeasure",
    "BenchmarkResult",
    "BenchmarkSettings",
    "BenchmarkTimes",
    "Budget",
    "CameraPlacement",
    "ConditionEffect",
    "Conditions",
    "GraspPlanner",
    "JudgedAnswer",
    "LeaderboardExtras",
    "MethodComparison",
    "MethodDifference",
    "Observation",
    "PlannerCheck",
    "PlannerError",
    "RobotSuccess",
    "Round",
    "SceneCamera",
    "StoredAnswer",
    "StoredGrasps",
    "Suite",
    "SuiteCamera",
    "SuiteDocument",
    "SuiteLike",
    "SuiteScene",
    "SuiteSettings",
    "Verification",
    "VerifiedGrasp",
    "check_planner",
    "compare_by_suite",
    "compare_methods",
    "condition_effects",
    "episodes",
    "load_result",
    "load_suite",
    "make_suite",
    "measure_all",
    "open_planner",
    "plan_robot_trials",
    "robot_successes",
    "run_benchmark",
    "verify_result",
    "write_leaderboard",
]


def __dir__() -> list[str]:
    return __all__
