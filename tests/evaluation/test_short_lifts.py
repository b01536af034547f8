"""How many lifts are shorter than asked, counted by hand."""

from __future__ import annotations

import numpy as np

from burg_drake.evaluation.results.shortened_lifts import short_lifts


def test_only_shorter_lifts_are_told() -> None:
    whole = 0.1 + 0.2
    assert short_lifts(np.array([0.3, whole, np.nan]), whole) is None
    found = short_lifts(np.array([0.3, 0.02, np.nan, 0.25, 0.08]), whole)
    assert str(found) == (
        "In 3 of 4 grasps there is no room for the whole lift of 300 mm:"
        " the median of these is 80 mm, the shortest 20 mm."
    )
    one = short_lifts(np.array([0.3, 0.02]), whole)
    assert str(one).endswith("the whole lift of 300 mm: it is 20 mm.")
