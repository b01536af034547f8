"""Room for words."""

from __future__ import annotations

import numpy as np

from burg_drake.printout import FreeSpace


def test_words_stand_beside_what_they_name_and_on_nothing_else() -> None:
    space = FreeSpace((0.2, 0.1))
    space.occupy((0.09, 0.04), (0.11, 0.06), clear=1e-3)
    at = space.cell_mask((0.1, 0.05))
    extent, boxes = (0.02, 0.004), []
    for _ in range(6):
        corner = space.place(extent, at)
        assert corner is not None
        lower, upper = corner, corner + extent
        assert (lower >= 0.0).all() and (upper <= [0.2, 0.1]).all()
        assert lower[0] > 0.1109 or upper[0] < 0.0891 or lower[1] > 0.0609 or upper[1] < 0.0391
        # No farther than what the object and the words placed before keep it off.
        middle = (lower + upper) / 2
        assert np.linalg.norm(middle - [0.1, 0.05]) < 0.035
        for other in boxes:
            assert (np.abs(other - lower) >= np.array(extent) - 1e-9).any()
        boxes.append(lower)


def test_no_room() -> None:
    space = FreeSpace((0.2, 0.1))
    at = space.cell_mask((0.1, 0.05))
    assert space.place((0.3, 0.01), at) is None
    space.occupy_outside((0.05, 0.04), (0.15, 0.06))
    assert space.place((0.05, 0.025), at) is None
    assert space.place((0.05, 0.015), at) is not None
    space.occupy((0.0, 0.0), (0.2, 0.1))
    assert space.place((0.01, 0.01), at) is None
