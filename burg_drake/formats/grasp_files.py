"""All kinds of grasp files: which there are, which one a file is of, reading and writing."""

from __future__ import annotations

import importlib
from collections.abc import Iterator, Mapping
from pathlib import Path

from burg_drake.core import InvalidInputError, UnknownNameError, nearest
from burg_drake.core.documents import checked_events, load_json
from burg_drake.core.files import (
    GRASP_FILE,
    npy_shape,
    open_regular,
    read_text,
    reporting_read_errors,
)
from burg_drake.core.grasps import GraspSet
from burg_drake.formats.common import PANDA, GraspFormat, Gripper, ImportedGrasps

MODULES = {
    "burg_drake": "burg_drake",
    "acronym": "acronym",
    "isaac_grasp": "isaac_grasp",
    "graspgen": "graspgen",
    "graspgen_yaml": "graspgen_yaml",
    "graspnet": "graspnet",
    "vgn": "vgn",
    "burg": "burg_toolkit",
}
"""Module of each format in this package, in the order in which files are tried."""


class _Formats(Mapping[str, GraspFormat]):
    """Formats by name; each module is imported when it is first asked for."""

    def __getitem__(self, name: str) -> GraspFormat:
        if name not in MODULES:
            raise UnknownNameError(f"there is no grasp format {name!r}; {nearest(name, MODULES)}")
        module = importlib.import_module(f"burg_drake.formats.grasps.{MODULES[name]}")
        found: GraspFormat = module.FORMAT
        return found

    def __iter__(self) -> Iterator[str]:
        return iter(MODULES)

    def __len__(self) -> int:
        return len(MODULES)


FORMATS: Mapping[str, GraspFormat] = _Formats()
"""Formats by name."""


def read_grasp_file(
    path: str | Path, format: str | None = None, gripper: Gripper = PANDA
) -> ImportedGrasps:
    """Reads grasps in any format.

    Args:
        path: the file.
        format: its format; None to tell by the content.
        gripper: the hand that the grasps were made for.

    Raises:
        InvalidInputError: the file cannot be read or is of none of the formats.
        UnknownNameError: there is no such format.
    """
    path = Path(path)
    if path.is_dir() or not path.exists():
        kind = "is a folder" if path.is_dir() else "does not exist"
        raise InvalidInputError(f"cannot read grasps: {path} {kind}; give a file")
    open_regular(path).close()  # formats are recognised by reading the file again and again
    chosen = FORMATS[format] if format is not None else format_of(path)
    with reporting_read_errors(path, f"a file of {chosen.title} that can be read"):
        return chosen.read(path, gripper)


def format_of(path: str | Path) -> GraspFormat:
    """The format of a file, by its content.

    Raises:
        InvalidInputError: it is of none; of `.npz`, YAML and JSON that cannot be read, why.
    """
    path = Path(path)
    for format in FORMATS.values():
        if format.recognises(path):
            return format
    if path.suffix in (".yaml", ".yml"):
        for _ in checked_events(read_text(path, GRASP_FILE), str(path), GRASP_FILE):
            pass  # says what is wrong with a file that is damaged or beyond the limits
    if path.suffix == ".json":
        load_json(path, GRASP_FILE)
    if path.suffix.lower() == ".npz":
        GraspSet.load(path)
    shape = npy_shape(path) if path.suffix.lower() == ".npy" else None
    wanted = (
        f" its array has shape {shape}; expected (N, 4, 4) or (N, 14) of BURG-Toolkit,"
        " or (N, 17) of GraspNet;"
        if shape is not None
        else ""
    )
    raise InvalidInputError(
        f"{path} is not a file of grasps in a known format ({', '.join(FORMATS)});"
        f"{wanted} if it should be in one of them, name the format to see what is wrong"
    ).about("format")


def write_grasp_file(
    grasps: GraspSet, path: str | Path, format: str | None = None, gripper: Gripper = PANDA
) -> tuple[str, ...]:
    """Writes grasps in any format, whole or not at all.

    Args:
        grasps: `X_OG` has the poses of G in the frame that the format wants, see
            `GraspFormat.frame`.
        path: the file.
        format: None for the one that the suffix of `path` stands for.
        gripper: the hand of the grasps.

    Returns:
        What the file cannot carry, one sentence each.

    Raises:
        InvalidInputError: the format cannot hold such grasps, the suffix stands for several formats
            or none, or the place cannot be written to.
        UnknownNameError: there is no such format.
    """
    path = Path(path)
    chosen = FORMATS[format] if format is not None else format_by_suffix(path)
    return chosen.write(grasps, path, gripper)


def format_by_suffix(path: str | Path) -> GraspFormat:
    """The format that a file's name stands for; of several, our own.

    Raises:
        InvalidInputError: none, or several that are not ours.
    """
    suffix = Path(path).suffix.lower()
    fitting = [format for format in FORMATS.values() if suffix in format.suffixes]
    if not fitting:
        known = sorted({suffix for format in FORMATS.values() for suffix in format.suffixes})
        raise InvalidInputError(
            f"{path}: no format of grasps has the suffix {suffix!r}; give one of the"
            f" formats {', '.join(FORMATS)}, or one of the suffixes {' '.join(known)}"
        )
    if len(fitting) > 1 and fitting[0].name != "burg_drake":
        names = " or ".join(format.name for format in fitting)
        raise InvalidInputError(f"{path}: the suffix {suffix} can mean {names}; give the format")
    return fitting[0]
