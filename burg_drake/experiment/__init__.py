"""Trials on the real robot beside simulated ones: choice, records, comparison, the gap.

`trials` has the file of trials and `planning` makes it; `comparison` rests on `pairing` and
`statistics`, and `gap` on all of them.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
