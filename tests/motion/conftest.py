"""Lets the tests of this folder share `gantry` and `ur_ik`."""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))
