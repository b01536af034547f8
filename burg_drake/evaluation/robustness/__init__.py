"""How robust the grasps are that a run found to lift.

Read `probes` and `probe_answer` first, then `probe_judge`, `assessment` and `table`.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
