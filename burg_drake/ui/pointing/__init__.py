"""Mouse and keys in the view: selecting, dragging, moving by handles.

Read `picking` and `object_drags` first.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
