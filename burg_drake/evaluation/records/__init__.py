"""What runs write down: their documents, a journal of verdicts, and the table of results.

Read `run_document`, `journal` and `table` first.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
