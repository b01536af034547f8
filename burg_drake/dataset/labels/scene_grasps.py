"""Grasps on the objects of a scene, whatever looks at them, and the same as a camera has them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from burg_drake.core import Array, InvalidInputError, check_pose, inverse
from burg_drake.dataset.labels.labelled_grasps import LabelledGrasps
from burg_drake.dataset.rendering import instance_numbers
from burg_drake.scene.document import SceneLike, as_scene


@dataclass(frozen=True, eq=False)
class SceneGrasps:
    """N grasps on the instances of a scene, with what became of them.

    Attributes:
        X_OG: (N, 4, 4) grasp frames in the frames of their objects.
        instance: (N,) names of the placed objects.
        width: (N,) distance of the pads when they touch [m]; nan if not known.
        outcome: (N,) outcomes as in a run's table; `""` for a grasp that was not judged to its end.
        margins: (N,) each by its column in a run's table; nan where there is none.

    Raises:
        InvalidInputError: the arrays are not of one length, or a pose is none.
    """

    X_OG: Array
    instance: NDArray[np.str_]
    width: Array
    outcome: NDArray[np.str_]
    margins: dict[str, Array]

    def __post_init__(self) -> None:
        check_pose(self.X_OG, "X_OG")
        columns = {"instance": self.instance, "width": self.width, "outcome": self.outcome}
        for name, values in (columns | self.margins).items():
            if np.shape(values) != self.X_OG.shape[:1]:
                raise InvalidInputError(
                    f"{name} of grasps has shape {np.shape(values)}; expected ({len(self)},), one"
                    " for each grasp"
                )

    def __len__(self) -> int:
        return len(self.X_OG)


def label_grasps(grasps: SceneGrasps, scene: SceneLike, X_SC: Array) -> LabelledGrasps:
    """Grasps as a camera has them: all of them, in their order, seen or not.

    Args:
        grasps: on instances of the scene.
        scene: has them at their places; its order gives their numbers.
        X_SC: (4, 4) camera's optical frame in the scene frame, or any other frame that the grasps
            are wanted in, such as that of a volume.

    Raises:
        UnknownNameError: the scene has no such instance.
        InvalidInputError: `X_SC` is no pose.
    """
    scene = as_scene(scene)
    X_CS = inverse(check_pose(X_SC, "X_SC"))
    X_CG = np.empty((len(grasps), 4, 4))
    number = np.empty(len(grasps), np.uint16)
    numbers = instance_numbers(scene)
    for name in np.unique(grasps.instance).tolist():
        mine = grasps.instance == name
        X_CG[mine] = X_CS @ scene.X_SO(name) @ grasps.X_OG[mine]
        number[mine] = numbers[name]
    return LabelledGrasps(X_CG, grasps.width, number, grasps.outcome, dict(grasps.margins))
