"""The main job: grasps on a station are judged stage by stage, and all of it is recorded.

Read `cascade` first; `candidates` go through the `stages` of a judge, `workers` or a `cluster` do
the work, and `store` has the folder of a run. `report`, `robustness` and `merge` build on runs.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
