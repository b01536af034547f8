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

import re
from functools import partial
from pathlib import Path

from burg_drake.core import Array
from burg_drake.formats.common import GraspFormat, Gripper
from burg_drake.formats.grasps.isaac_dialect import Dialect
from burg_drake.formats.grasps.isaac_reader import read_yaml
from burg_drake.formats.grasps.isaac_writer import write_yaml

END = 1 << 16
"""Bytes at each end of a file that are looked at to recognise it: keys that are written in the
order of the alphabet name the gripper after the grasps."""

_FORMAT_LINE = re.compile(rb"^[\"']?format[\"']?\s*:\s*[\"']?isaac_grasp\b", re.MULTILINE)
_GRIPPER = re.compile(
    rb"^[\"']?gripper_(frame|frame_link|file)[\"']?\s*:|cspace_position", re.MULTILINE
)


def X_GF(gripper: Gripper) -> Array:
    """The hand's body."""
    return gripper.X_GH


def recognises(path: Path) -> bool:
    """Text with `format: isaac_grasp` that says something of the gripper."""
    return describes_gripper(path) is True


def describes_gripper(path: Path) -> bool | None:
    """Whether text with the line `format: isaac_grasp` has a gripper frame, a gripper's file or
    joints, which GraspGen does not write; None for other files."""
    try:
        with path.open("rb") as stream:
            text = stream.read(END)
            stream.seek(max(END, path.stat().st_size - END))
            text += stream.read(END)
    except OSError:
        return None
    return _GRIPPER.search(text) is not None if _FORMAT_LINE.search(text) else None


DIALECT = Dialect("isaac_grasp", "Isaac Sim grasp editor", X_GF, names_gripper_frame=True)

FORMAT = GraspFormat(
    name=DIALECT.name,
    title=DIALECT.title,
    suffixes=(".yaml", ".yml"),
    frame="object",
    source="Isaac Sim manual, Grasp Editor; Isaac ROS manual, Isaac Grasp File",
    carries=("score as confidence", "width as finger joints", "names of grasps"),
    cannot_carry=("ids", "several objects", "further columns", "scale of the object"),
    X_GF=X_GF,
    recognises=recognises,
    read=partial(read_yaml, DIALECT),
    write=partial(write_yaml, DIALECT),
    one_object=True,
)
