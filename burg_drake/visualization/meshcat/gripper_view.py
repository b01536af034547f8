"""One whole gripper in Meshcat, put at one grasp after the other.

Below `/drake/gripper`, which is H: a path for each part of the hand that moves by itself.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from pydrake.geometry import Meshcat
from pydrake.math import RigidTransform

from burg_drake.core import Array, make_pose
from burg_drake.core.paths import NO_PACKAGES, Packages
from burg_drake.station.document import Hand
from burg_drake.visualization.meshcat.hand_visual import hand_visuals

GRIPPER_PATH = "/drake/gripper"


class GripperView:
    """A gripper that is hidden until it is put somewhere.

    Args:
        meshcat: where to draw it.
        hand: the document.
        model: the model file.
        packages: what a station says of packages.

    Attributes:
        hand: the document.
        slides: by Meshcat path, how far (3,) that part moves in H for each metre by which the hand
            closes.
        shown: whether it is in the view.

    Raises:
        InvalidInputError: the model cannot be loaded.
    """

    def __init__(
        self, meshcat: Meshcat, hand: Hand, model: Path, packages: Packages = NO_PACKAGES
    ) -> None:
        self.hand = hand
        self.slides: dict[str, Array] = {}
        self._meshcat = meshcat
        paths: dict[tuple[float, ...], str] = {}
        for k, visual in enumerate(hand_visuals(hand, model, packages=packages)):
            part = paths.setdefault(tuple(visual.slide), f"{GRIPPER_PATH}/{len(paths)}")
            self.slides[part] = visual.slide
            meshcat.SetObject(f"{part}/{k}", visual.shape, visual.color)
            meshcat.SetTransform(f"{part}/{k}", RigidTransform(visual.X_HV))
        self.hide()

    def hide(self) -> None:
        """Takes it out of the view."""
        self._meshcat.SetProperty(GRIPPER_PATH, "visible", False)
        self.shown = False

    def put(self, X_WG: Array, width: float) -> None:
        """Shows it at a grasp (4, 4) with so much between its pads [m], as far as it can."""
        self._meshcat.SetTransform(GRIPPER_PATH, RigidTransform(self.hand.X_AH(X_WG)))
        for path, slide in self.slides.items():
            shift = self.closed_by(width) * slide
            self._meshcat.SetTransform(path, RigidTransform(make_pose(p_AB=shift)))
        self._meshcat.SetProperty(GRIPPER_PATH, "visible", True)
        self.shown = True

    def closed_by(self, width: float) -> float:
        """How far the open hand closes to a width [m]."""
        low, high = self.hand.opening
        return high - float(np.clip(width, low, high))
