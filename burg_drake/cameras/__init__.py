"""Images in, poses and pictures out: calibration, the board's pose, the overlay, how objects stand.

A camera is described by `optics` and read by `sources`; `pose` finds the board in an image, and
`projection`, `overlay` and `placement` build on that. `systems` and `live` put it all together.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
