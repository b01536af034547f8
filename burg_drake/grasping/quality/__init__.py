"""Analytic quality of grasps: what two compliant pads with friction can bear.

Read `metrics` first; it goes from `contacts` over `pad_indentation` and `wrench_space` to
`wrench_margins`.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
