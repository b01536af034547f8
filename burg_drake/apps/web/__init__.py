"""What the small servers of the command line share.

`server` has the server and the handler of requests, `requests` reads what browsers send.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
