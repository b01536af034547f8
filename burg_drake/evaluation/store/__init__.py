"""Runs on disk and how to read them: their folders, and the columns of many scenes in parts.

Read `run_folder` and `campaign_folder` first, then `part_store`.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
