"""Judging in the processes of this machine; what executors are, and jobs.

Read `executor` and `job` first, then `pool`; `worker` is the other side.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
