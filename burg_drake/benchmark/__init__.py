"""Benchmarks of grasp planners: suites of scenes, planners, runs, and their comparison.

Read `suite` first, then `benchmark_run`; `burg_planner` is the file that planners copy.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
