"""A sample of a data set: one view of one scene, with all that is known of it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from burg_drake.core import Array, Single
from burg_drake.dataset.labels import InstanceLabel, LabelledGrasps
from burg_drake.dataset.rendering import Images
from burg_drake.dataset.views import View


@dataclass(frozen=True, kw_only=True, eq=False)
class Sample:
    """One view of one scene.

    Attributes:
        scene: number of the scene in the data set.
        number: of the view among those of its scene.
        view: the camera at its place.
        X_WS: (4, 4) scene frame in the world.
        images: what it sees, without noise.
        sensor_depth: (H, W) the depth as the sensor measures it [m], 0 where it does not; None if
            no sensor is simulated.
        instances: objects of the scene, in the order of their numbers.
        grasps: on them; None if none were asked for.
        appearance: how it looks, as plain data; empty if as usual.
    """

    scene: int
    number: int
    view: View
    X_WS: Array
    images: Images
    sensor_depth: Single | None = None
    instances: tuple[InstanceLabel, ...] = ()
    grasps: LabelledGrasps | None = None
    appearance: Mapping[str, Any] = field(default_factory=dict)

    @property
    def key(self) -> str:
        """Names it in the data set, as in `000012_003`."""
        return f"{self.scene:06d}_{self.number:03d}"
