"""Reads documents of other projects into plain data; depends only on `core`.

Read `grasp_format` and `grasp_files` first; each grasp format is a module. `burg_toolkit` and `ycb`
read object libraries and scenes.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
