"""Commands carried out on a scene, and what one sees of it meanwhile.

Read `editor` first, then `view`; `drag` moves objects live.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
