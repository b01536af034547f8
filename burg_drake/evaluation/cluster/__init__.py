"""Judging on other machines: scenes and stations that travel, workers of Dask, and their driver.

Read `document` and `dask_executor` first, then `dispatch` and `remote`, its two ends.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
