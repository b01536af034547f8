"""Reads, writes and recognises grasp files in all formats; defines burg_drake's own format."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from burg_drake.core import (
    READ_ERRORS,
    FileLimits,
    GraspSet,
    GraspSetFormat,
    InvalidInputError,
    UnknownNameError,
    checked_yaml_events,
    is_hdf5,
    load_json,
    make_pose,
    npy_shape,
    open_hdf5,
    open_npz,
    open_regular,
    read_text,
    report_read_errors,
    suggest_names,
)
from burg_drake.formats.acronym import ACRONYM_FORMAT
from burg_drake.formats.burg_grasps import BURG_TOOLKIT_FORMAT
from burg_drake.formats.grasp_format import PANDA_GRIPPER, GraspFormat, Gripper, ImportedGrasps
from burg_drake.formats.graspgen import GRASPGEN_FORMAT
from burg_drake.formats.graspnet import GRASPNET_FORMAT
from burg_drake.formats.isaac_grasp import GRASPGEN_YAML_FORMAT, ISAAC_GRASP_FORMAT
from burg_drake.formats.vgn import VGN_FORMAT


def read_grasp_file(
    path: str | Path, format: str | None = None, gripper: Gripper = PANDA_GRIPPER
) -> ImportedGrasps:
    """Reads grasps in any format.

    Args:
        path: the file.
        format: format of the file; None to recognise it by the content.
        gripper: the hand that the grasps were made for.

    Raises:
        InvalidInputError: the file cannot be read or has none of the formats.
        UnknownNameError: there is no such format.
    """
    path = Path(path)
    if path.is_dir() or not path.exists():
        kind = "is a folder" if path.is_dir() else "does not exist"
        raise InvalidInputError(f"cannot read grasps: {path} {kind}; give a file")
    open_regular(path).close()  # fails for files that cannot be read several times
    chosen = format_named(format) if format is not None else format_of(path)
    with report_read_errors(path, f"a file of {chosen.title} that can be read"):
        return chosen.read(path, gripper)


def format_of(path: str | Path) -> GraspFormat:
    """Recognises the format of a file by its content.

    Raises:
        InvalidInputError: the file has none of the formats; the message says why `.npz`, YAML or
            JSON cannot be read.
    """
    path = Path(path)
    for format in GRASP_FORMATS.values():
        if format.recognises(path):
            return format
    if path.suffix in (".yaml", ".yml"):
        text, limits = read_text(path, FileLimits.grasp_file), FileLimits.grasp_file
        for _ in checked_yaml_events(text, str(path), limits):
            pass  # raises the error of a file that is damaged or beyond the limits
    if path.suffix == ".json":
        load_json(path, FileLimits.grasp_file)
    if path.suffix.lower() == ".npz":
        GraspSet.load(path)
    wanted = ""
    if path.suffix.lower() == ".npy" and (shape := npy_shape(path)) is not None:
        wanted = (
            f" its array has shape {shape}; expected (N, 4, 4) or (N, 14) of BURG-Toolkit,"
            " or (N, 17) of GraspNet;"
        )
    raise InvalidInputError(
        f"{path} is not a file of grasps in a known format ({', '.join(GRASP_FORMATS)});"
        f"{wanted} if it should be in one of them, name the format to see what is wrong"
    ).about("format")


def write_grasp_file(
    grasps: GraspSet, path: str | Path, format: str | None = None, gripper: Gripper = PANDA_GRIPPER
) -> tuple[str, ...]:
    """Writes grasps in any format; on an error no partial file remains.

    Args:
        grasps: `X_OG` has the poses of G in the reference frame of the format, see
            `GraspFormat.frame`.
        path: the file.
        format: None for the format of the suffix of `path`.
        gripper: the hand of the grasps.

    Returns:
        Notes on the data that the file cannot carry, one sentence each.

    Raises:
        InvalidInputError: the format cannot hold such grasps, the suffix belongs to several formats
            or none, or the file cannot be written.
        UnknownNameError: there is no such format.
    """
    path = Path(path)
    chosen = format_named(format) if format is not None else format_by_suffix(path)
    return chosen.write(grasps, path, gripper)


def format_by_suffix(path: str | Path) -> GraspFormat:
    """The format of a file name's suffix; burg_drake's own format if several share it.

    Raises:
        InvalidInputError: no format has the suffix, or several others have it.
    """
    suffix = Path(path).suffix.lower()
    fitting = [format for format in GRASP_FORMATS.values() if suffix in format.suffixes]
    if not fitting:
        known = sorted({suffix for format in GRASP_FORMATS.values() for suffix in format.suffixes})
        raise InvalidInputError(
            f"{path}: no format of grasps has the suffix {suffix!r}; give one of the"
            f" formats {', '.join(GRASP_FORMATS)}, or one of the suffixes {' '.join(known)}"
        )
    if len(fitting) > 1 and fitting[0].name != "burg_drake":
        names = " or ".join(format.name for format in fitting)
        raise InvalidInputError(f"{path}: the suffix {suffix} can mean {names}; give the format")
    return fitting[0]


def _recognise(path: Path) -> bool:
    try:
        if is_hdf5(path):
            with open_hdf5(path) as tree:
                return bool(tree.attribute("format") == GraspSetFormat.name)
        with open_npz(path) as file:
            return {"header", "X_OG"} <= set(file.names)
    except (OSError, *READ_ERRORS):
        return False


def _write(grasps: GraspSet, path: Path, gripper: Gripper) -> tuple[str, ...]:
    grasps.save(path)
    return ()


BURG_DRAKE_FORMAT = GraspFormat(
    name="burg_drake",
    title="burg_drake",
    suffixes=(".h5", ".npz", ".hdf5"),
    frame="object",
    source="core/grasp_set.py of this project",
    carries=("everything",),
    cannot_carry=(),
    X_GF=lambda gripper: make_pose(),
    recognises=_recognise,
    read=lambda path, gripper: ImportedGrasps(GraspSet.load(path), "object"),
    write=_write,
)
"""The format of burg_drake's own files; see `GraspSet`."""

GRASP_FORMATS: Mapping[str, GraspFormat] = {
    format.name: format
    for format in (
        BURG_DRAKE_FORMAT,
        ACRONYM_FORMAT,
        ISAAC_GRASP_FORMAT,
        GRASPGEN_FORMAT,
        GRASPGEN_YAML_FORMAT,
        GRASPNET_FORMAT,
        VGN_FORMAT,
        BURG_TOOLKIT_FORMAT,
    )
}
"""Formats of grasp files by name, in the order in which a file is tried."""


def format_named(name: str) -> GraspFormat:
    """The format with this name.

    Raises:
        UnknownNameError: there is no such format.
    """
    if name not in GRASP_FORMATS:
        raise UnknownNameError(
            f"there is no grasp format {name!r}; {suggest_names(name, GRASP_FORMATS)}"
        )
    return GRASP_FORMATS[name]
