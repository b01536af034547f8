"""Writes documents in `isaac_grasp` YAML; see `isaac_reader`."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np

from burg_drake.core import Array, quaternion_from_rotation
from burg_drake.core.files import atomic_write
from burg_drake.core.grasps import GraspSet
from burg_drake.formats.common import PREGRASP_WIDTH, Gripper, conversion_losses, only_object
from burg_drake.formats.grasps.isaac_dialect import CLOSED, NAME, OPEN, Dialect

SLACK = 1e-6
"""By which a width may be beyond the hand's opening and still be its end [m]: single precision."""


def write_yaml(dialect: Dialect, grasps: GraspSet, path: Path, gripper: Gripper) -> tuple[str, ...]:
    """Writes the grasps of one object; returns what the file cannot carry.

    Args:
        dialect: of the file.
        grasps: of one object.
        path: the file.
        gripper: the hand of the grasps.

    Raises:
        InvalidInputError: grasps of several objects, or the place cannot be written to.
    """
    object = only_object(grasps, f"a file of {dialect.title}")
    X_OF = grasps.X_OG @ dialect.X_GF(gripper)
    q = quaternion_from_rotation(X_OF[:, :3, :3])
    closed = gripper.positions(grasps.width)
    opening = grasps.columns.get(PREGRASP_WIDTH, np.full(len(grasps), gripper.opening[1]))
    opened = gripper.positions(opening)
    joints = dialect.names_gripper_frame
    frames = [
        f"object_frame_link: {json.dumps(f'/World/{object}')}",
        f"gripper_frame_link: {json.dumps(f'/World/{gripper.body}')}",
    ]
    lines = ["format: isaac_grasp", "format_version: 1.0", *(frames if joints else ()), "grasps:"]
    for i, name in enumerate(_names(grasps)):
        score = grasps.score[i]
        confidence = ".nan" if np.isnan(score) else _text(score)
        lines += [
            f"  {json.dumps(name)}:",
            f"    confidence: {confidence}",
            f"    position: {_list(X_OF[i, :3, 3])}",
            f"    orientation: {{w: {_text(q[i, 0])}, xyz: {_list(q[i, 1:])}}}",
        ]
        if joints and not np.isnan(grasps.width[i]):
            lines += [f"    {CLOSED}:"]
            lines += [f"      {joint}: {_text(p[i])}" for joint, p in closed.items()]
        if joints and not np.isnan(opening[i]):
            lines += [f"    {OPEN}:"]
            lines += [f"      {joint}: {_text(p[i])}" for joint, p in opened.items()]
    atomic_write(path, "\n".join(lines) + "\n")
    beyond = _beyond(grasps.width, opening, gripper) if joints else ()
    return (*beyond, *_notes(grasps, dialect))


def _beyond(width: Array, opening: Array, gripper: Gripper) -> tuple[str, ...]:
    """A note if the hand cannot open or close so far."""
    low, high = gripper.opening
    off = [(w < low - SLACK) | (w > high + SLACK) for w in (width, opening)]
    count = int((off[0] | off[1]).sum())
    limits = f"the opening of hand {gripper.name!r}, {low:g} to {high:g} m; so are their joints."
    return (f"widths of {count} grasps are outside {limits}",) if count else ()


def _notes(grasps: GraspSet, dialect: Dialect) -> tuple[str, ...]:
    notes = []
    known = grasps.score[~np.isnan(grasps.score)]
    if len(known) < len(grasps):
        without = len(grasps) - len(known)
        whose = "1 grasp has" if without == 1 else f"{without} grasps have"
        notes.append(f"{whose} no score: confidence is .nan there.")
    if len(known) and not (known.min() >= 0.0 and known.max() <= 1.0):
        notes.append(
            f"{dialect.title} expects a confidence from 0 to 1; the scores, {known.min():.3g} to"
            f" {known.max():.3g}, are written as they are."
        )
    of_hand = ("object", "width", PREGRASP_WIDTH) if dialect.names_gripper_frame else ()
    return (*notes, *conversion_losses(grasps, ("score", NAME, *of_hand), dialect.title))


def _names(grasps: GraspSet) -> list[str]:
    """Those that the grasps have, if they differ; else numbers."""
    given = grasps.columns.get(NAME, np.array([], dtype=str))
    names = [str(name) for name in given.tolist()]
    if all(names) and len(set(names)) == len(grasps):
        return names
    return [f"grasp_{i}" for i in range(len(grasps))]


def _list(values: Array) -> str:
    return f"[{', '.join(map(_text, values))}]"


def _text(value: float) -> str:
    """A number that YAML 1.1 takes for one: `1e-05` would be text, `1.0e-05` is not."""
    text = repr(float(value))
    return text.replace("e", ".0e") if "e" in text and "." not in text else text
