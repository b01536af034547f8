"""Grasp trials of the hand alone on MuJoCo: the phases and decisions of `trials`, other physics.

Read `mujoco_trial`, then `mujoco_world`, which has the model; `export.mjcf` describes it.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
