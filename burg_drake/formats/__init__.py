"""Documents of other projects, read into plain data; needs nothing but `core`.

Read `grasp_files` first; each format is a module of `grasps`, and libraries and scenes are in
`collections`.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
