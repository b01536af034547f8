"""What all tests share: one thread a process, a cache, Ctrl-C, and the generators under `tools/`.

The tests run against a checkout (editable install) and against an installed wheel alike
(`make test`). `tools/` is in no wheel, and putting the root of the checkout on `sys.path` would
shadow the wheel; therefore the package `tools`, and nothing else, is announced by hand.
"""

from __future__ import annotations

import atexit
import os
import shutil
import signal
import sys
import tempfile
from pathlib import Path
from types import ModuleType

# pytest-xdist fills the cores with processes; read by OpenMP and OpenBLAS when they are loaded.
os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

# What is computed once for a robot or a scene serves all tests of a run, but not the next run.
if "BURG_DRAKE_CACHE" not in os.environ:
    os.environ["BURG_DRAKE_CACHE"] = tempfile.mkdtemp(prefix="burg_drake_cache_")
    atexit.register(shutil.rmtree, os.environ["BURG_DRAKE_CACHE"], ignore_errors=True)

# What a script starts in the background ignores Ctrl-C, and so do all its children; the tests of
# interrupts need it as it is at a terminal.
if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    signal.signal(signal.SIGINT, signal.default_int_handler)


def _announce_tools(folder: Path) -> None:
    tools = ModuleType("tools")
    tools.__path__ = [str(folder)]
    sys.modules["tools"] = tools


_announce_tools(Path(__file__).resolve().parents[1] / "tools")
