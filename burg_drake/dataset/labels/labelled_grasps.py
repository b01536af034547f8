"""Grasps of a view, with what became of them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from burg_drake.core import Array


@dataclass(frozen=True, eq=False)
class LabelledGrasps:
    """Grasps on the objects of a scene.

    Attributes:
        X_CG: (N, 4, 4) grasp frames in the camera's optical frame: z approach, x closing.
        width: (N,) distance of the pads when they touch [m]; nan if not known.
        number: (N,) instance that each grasps, as in the label image.
        outcome: (N,) outcomes as in a run's table; `""` for a grasp that was not judged.
        margins: (N,) each by its column in a run's table; nan where there is none.
    """

    X_CG: Array
    width: Array
    number: NDArray[np.uint16]
    outcome: NDArray[np.str_]
    margins: dict[str, Array]

    def __len__(self) -> int:
        return len(self.X_CG)
