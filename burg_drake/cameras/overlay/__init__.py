"""A scene's objects drawn over a camera's image of the board, without a renderer.

Read `renderer` first; `style` says how it looks, and the other modules draw lines, areas and texts.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
