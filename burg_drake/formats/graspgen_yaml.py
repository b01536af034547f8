"""Grasps that GraspGen predicts: `isaac_grasp` YAML that names no gripper frame.

`save_to_isaac_grasp_format` in grasp_gen/dataset/eval_utils.py (github.com/NVlabs/GraspGen) writes
`format`, `format_version` and of each grasp `confidence`, `position` and `orientation`, but neither
object nor gripper frame nor joints. Its poses are those of GraspGen's own convention, see
`graspgen`: x along the fingers' way, where the grasp editor's `panda_hand` has y.
"""

from __future__ import annotations

from pathlib import Path

from burg_drake.core.frames import Array
from burg_drake.core.grasps import GraspSet
from burg_drake.formats.grasp_format import GraspFormat, Gripper, Imported
from burg_drake.formats.isaac_grasp import is_isaac_grasp, names_gripper
from burg_drake.formats.isaac_reader import read_yaml
from burg_drake.formats.isaac_writer import write_yaml
from burg_drake.formats.one_object import only_object

KIND = "a YAML file of GraspGen"


def X_GF(gripper: Gripper) -> Array:
    """The hand's base, x along the closing direction."""
    return gripper.X_GB


def recognises(path: Path) -> bool:
    """`isaac_grasp` YAML without a gripper frame."""
    return is_isaac_grasp(path) and not names_gripper(path)


def read(path: Path, gripper: Gripper) -> Imported:
    """The grasps of a file, named after the file, which says of which object they are no more.

    Raises:
        DocumentError: no such file, or a value that cannot be used; the message says where.
    """
    return read_yaml(path, gripper, X_GF)


def write(grasps: GraspSet, path: Path, gripper: Gripper) -> tuple[str, ...]:
    """Writes the grasps of one object.

    Raises:
        InvalidInputError: grasps of several objects, or the place cannot be written to.
    """
    only_object(grasps, KIND)
    return write_yaml(grasps, path, gripper, X_GF, ())


FORMAT = GraspFormat(
    name="graspgen_yaml",
    title="GraspGen predictions",
    suffixes=(".yaml", ".yml"),
    frame="object",
    source="github.com/NVlabs/GraspGen, grasp_gen/dataset/eval_utils.py",
    carries=("score as confidence", "names of grasps"),
    cannot_carry=("several objects", "the object's name", "width", "further columns"),
    X_GF=X_GF,
    recognises=recognises,
    read=read,
    write=write,
)
