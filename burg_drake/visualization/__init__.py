"""Meshcat views and pictures: scenes, grasps coloured by outcome, replays.

Read `scene_view` and `grasp_view` first. `colors` and `html_page` are shared by all views and pages,
`meshcat_drawing` by those in Meshcat.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
