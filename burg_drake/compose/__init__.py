"""A scene while it is composed by hand: commands, history, journal and status, without any page.

Read `session` first; what is edited is in `document`, how in `commands`, and `editing` carries it
out.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
