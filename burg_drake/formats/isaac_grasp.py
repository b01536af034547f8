"""Grasps of Isaac Sim's grasp editor: `isaac_grasp` YAML, version 1.0, one object a file.

The layout is the one of the manual of Isaac Sim (docs.isaacsim.omniverse.nvidia.com, "Grasp
Editor") and of "Isaac Grasp File" in that of Isaac ROS (nvidia-isaac-ros.github.io):

- `format: isaac_grasp` and `format_version: 1.0` (or "1.0") say what it is. `object_frame_link` and
  `gripper_frame_link` are prims such as `/World/mug` and `/World/panda_hand`; Isaac ROS spells them
  `object_frame` and `gripper_frame`.
- `grasps` has by name: `confidence` from 0 to 1; `position` and `orientation: {w, xyz}` of the
  gripper frame in the object frame [m]; `cspace_position`, the finger joints by name while the
  object is held; `pregrasp_cspace_position`, the same on approach.
- GraspDataGen (github.com/NVlabs/GraspDataGen, scripts/graspgen/grasp_guess.py) writes
  `object_file`, `object_scale` and `gripper_file` besides, and `bite_point` of each grasp; its
  `confidence` is 1 or 0.

The gripper frame is that of the hand's link which is named, for the Panda `panda_hand`: +z towards
the tips and y along the fingers' way. Isaac Sim itself ignores the name. Files that say nothing of
the gripper, as GraspGen writes them, are the matter of `graspgen_yaml`.
"""

from __future__ import annotations

import json
import re
from pathlib import Path

from burg_drake.core.frames import Array
from burg_drake.core.grasps import GraspSet
from burg_drake.formats.grasp_format import GraspFormat, Gripper, Imported
from burg_drake.formats.isaac_reader import read_yaml
from burg_drake.formats.isaac_writer import write_yaml
from burg_drake.formats.one_object import only_object

KIND = "an isaac_grasp file"
_FORMAT_LINE = re.compile(rb"^[\"']?format[\"']?\s*:\s*[\"']?isaac_grasp\b", re.MULTILINE)
_GRIPPER = re.compile(
    rb"^[\"']?gripper_(frame|frame_link|file)[\"']?\s*:|cspace_position", re.MULTILINE
)


def X_GF(gripper: Gripper) -> Array:
    """The hand's body."""
    return gripper.X_GH


def recognises(path: Path) -> bool:
    """Text with `format: isaac_grasp` that says something of the gripper."""
    return is_isaac_grasp(path) and names_gripper(path)


def is_isaac_grasp(path: Path) -> bool:
    """Text with the line `format: isaac_grasp`."""
    try:
        return _FORMAT_LINE.search(path.read_bytes()) is not None
    except OSError:
        return False


def names_gripper(path: Path) -> bool:
    """Text with a gripper frame, a gripper's file or joints, which GraspGen does not write."""
    return _GRIPPER.search(path.read_bytes()) is not None


def read(path: Path, gripper: Gripper) -> Imported:
    """The grasps of a file; `score` is the confidence.

    Raises:
        DocumentError: no such file, or a value that cannot be used; the message says where.
    """
    return read_yaml(path, gripper, X_GF)


def write(grasps: GraspSet, path: Path, gripper: Gripper) -> tuple[str, ...]:
    """Writes the grasps of one object.

    Raises:
        InvalidInputError: grasps of several objects, or the place cannot be written to.
    """
    name = only_object(grasps, KIND)
    frames = [
        f"object_frame_link: {json.dumps(f'/World/{name}')}",
        f"gripper_frame_link: {json.dumps(f'/World/{gripper.body}')}",
    ]
    return write_yaml(grasps, path, gripper, X_GF, frames)


FORMAT = GraspFormat(
    name="isaac_grasp",
    title="Isaac Sim grasp editor",
    suffixes=(".yaml", ".yml"),
    frame="object",
    source="Isaac Sim manual, Grasp Editor; Isaac ROS manual, Isaac Grasp File",
    carries=("score as confidence", "width as finger joints", "names of grasps"),
    cannot_carry=("several objects", "further columns", "scale of the object"),
    X_GF=X_GF,
    recognises=recognises,
    read=read,
    write=write,
)
