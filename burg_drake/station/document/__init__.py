"""Documents of stations and hands, and presets of engines.

Read `station_document` and `gripper_document` first, then `engine` and `grasp_motion`.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
