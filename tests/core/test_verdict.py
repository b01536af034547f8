"""The record of what became of a grasp."""

from __future__ import annotations

import math
import pickle

from burg_drake.core import Margins


def test_margins_that_were_not_measured_are_equal() -> None:
    """Also if their NaN are different objects, as of two processes, which tuples do not forgive."""
    one = Margins(slip=1e-3, clearance=float("nan"))
    other = pickle.loads(pickle.dumps(Margins(slip=1e-3, clearance=-math.nan)))
    assert one == other and hash(one) == hash(other)
    assert one != Margins(slip=1e-3, clearance=0.0)
    assert one != Margins(slip=2e-3)
    assert one != 1e-3
