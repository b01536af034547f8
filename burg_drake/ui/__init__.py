"""Pages in the browser, on viser; each action is a command of a session in `compose`.

Read `setup_page` first: it puts the panels (`*_panels`) beside the `scene_view`. `page_server`
opens the page, and `admission` decides which browsers may use it.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
