"""Grasps without time stepping: sampled, screened, scored and compared.

`antipodal_sampling` draws grasps, `hand_clearance` screens the open hand, `quality_metrics` scores
contacts. `grasp_distance` defines the distance that `set_comparison` and `neighbour_search` use.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
