"""Functions that numba compiles; what is compiled is kept on disk."""

from __future__ import annotations

import sys
from types import ModuleType
from typing import cast


def _import_numba() -> ModuleType:
    """numba looks for the package `coverage`, and scripts in this folder's parent would give it
    their `coverage.py`; it does without."""
    modules = cast("dict[str, ModuleType | None]", sys.modules)
    hidden = "coverage" not in modules
    if hidden:
        modules["coverage"] = None
    import numba

    if hidden:
        del modules["coverage"]
    return numba


numba = _import_numba()
unsigned = numba.uint64
"""Of the counter of a loop: as it is never negative, the compiler can use vector instructions."""
compiled = numba.njit(cache=True, fastmath=True, error_model="numpy")
