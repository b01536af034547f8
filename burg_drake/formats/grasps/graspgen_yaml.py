"""Grasps that GraspGen predicts: `isaac_grasp` YAML that names no gripper frame.

`save_to_isaac_grasp_format` in grasp_gen/dataset/eval_utils.py (github.com/NVlabs/GraspGen) writes
`format`, `format_version` and of each grasp `confidence`, `position` and `orientation`, but neither
object nor gripper frame nor joints. Its poses are those of GraspGen's own convention, see
`graspgen`: x along the fingers' way, where the grasp editor's `panda_hand` has y.
"""

from __future__ import annotations

from functools import partial
from pathlib import Path

from burg_drake.core import Array
from burg_drake.formats.common import GraspFormat, Gripper
from burg_drake.formats.grasps.isaac_dialect import Dialect
from burg_drake.formats.grasps.isaac_grasp import describes_gripper
from burg_drake.formats.grasps.isaac_reader import read_yaml
from burg_drake.formats.grasps.isaac_writer import write_yaml


def X_GF(gripper: Gripper) -> Array:
    """The hand's base, x along the closing direction."""
    return gripper.X_GB


def recognises(path: Path) -> bool:
    """`isaac_grasp` YAML without a gripper frame."""
    return describes_gripper(path) is False


DIALECT = Dialect("graspgen_yaml", "GraspGen predictions", X_GF, names_gripper_frame=False)

FORMAT = GraspFormat(
    name=DIALECT.name,
    title=DIALECT.title,
    suffixes=(".yaml", ".yml"),
    frame="object",
    source="github.com/NVlabs/GraspGen, grasp_gen/dataset/eval_utils.py",
    carries=("score as confidence", "names of grasps"),
    cannot_carry=("ids", "several objects", "the object's name", "width", "further columns"),
    X_GF=X_GF,
    recognises=recognises,
    read=partial(read_yaml, DIALECT),
    write=partial(write_yaml, DIALECT),
    one_object=True,
)
