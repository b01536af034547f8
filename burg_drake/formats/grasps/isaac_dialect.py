"""What two formats share that are written as `isaac_grasp` YAML, and how they differ."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from burg_drake.core import Array
from burg_drake.formats.common import Gripper

CLOSED, OPEN = "cspace_position", "pregrasp_cspace_position"
"""Keys of a grasp's joint positions."""
NAME = "name"
"""Column of the names of grasps."""


@dataclass(frozen=True)
class Dialect:
    """A way to write `isaac_grasp` YAML.

    Attributes:
        name: of the format.
        title: of the format, for people.
        X_GF: (4, 4) pose in G of what the file's poses are those of, for a gripper.
        names_gripper_frame: whether it says which frames its poses relate, and where the joints
            are.
    """

    name: str
    title: str
    X_GF: Callable[[Gripper], Array]
    names_gripper_frame: bool
