"""How many lifts are shorter than asked, counted by hand."""

from __future__ import annotations

import numpy as np

from burg_drake.evaluation import count_short_lifts


def test_only_shorter_lifts_are_told() -> None:
    whole = 0.1 + 0.2
    assert count_short_lifts(np.array([0.3, whole, np.nan]), whole) is None
    found = count_short_lifts(np.array([0.3, 0.02, np.nan, 0.25, 0.08]), whole)
    assert str(found) == (
        "For 3 of 4 grasps there is no room to lift the whole 300 mm: the median is 80"
        " mm, the shortest lift is 20 mm."
    )
    one = count_short_lifts(np.array([0.3, 0.02]), whole)
    assert str(one).endswith("to lift the whole 300 mm: it is lifted 20 mm.")
