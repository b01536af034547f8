"""Meshcat views and pictures: scenes, grasps coloured by outcome, replays.

Read `scenes` first; `style` has colours and markup, `meshcat` what all views share.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
