"""The tests that `make test` leaves out, and `make test-all` does not.

They take a third of the time of all. Most show again what others show: with one more robot,
engine, scene or page, or after one more kind of accident. A few are of parts that change rarely and
take many seconds to start, such as ROS 1 as a whole, and pages in a browser after a kill.
"""

from __future__ import annotations

from typing import Any

import pytest


def thorough(*values: Any) -> Any:
    """One of the cases of a parametrised test, as one that `make test` leaves out."""
    return pytest.param(*values, marks=pytest.mark.thorough)
