"""MuJoCo's MJCF: scenes, with or without a hand above them, and the model of grasp trials.

`writer` writes the folder of an export; `bodies` has what it shares with `trial_model`, `hand` the
hand of both.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
