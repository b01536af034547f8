"""Meshcat views and pictures: scenes, grasps coloured by outcome, replays.

Read `scene_view` and `grasp_view` first. All views and pages share `colors` and `html_page`;
those in Meshcat share `meshcat_drawing`.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
