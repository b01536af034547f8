"""Photos and placement checks of trials, in folders beside the trials file.

photos/017.png         the photo of trial 17, as it was taken
placements/017.yaml    the whole placement check; the trials file has its main numbers

No file is overwritten: a second photo of trial 17 is called 017_2.
"""

from __future__ import annotations

import math
import os
from itertools import count
from pathlib import Path

from burg_drake.cameras import CheckedScene, Placement, PlacementCheck, save_placement
from burg_drake.core import FileLimits, InvalidInputError, Pose, atomic_write, read_bytes
from burg_drake.experiment.trials.trial_book import lock_trials_file
from burg_drake.experiment.trials.trial_sheet import ObjectPlace, RealTrial, TrialSheet
from burg_drake.scene import Scene


def summarize_placements(check: PlacementCheck) -> dict[str, ObjectPlace]:
    """Main numbers of a placement check by instance, rounded to a micrometre and a thousandth of a
    degree."""
    return {name: _summarize_placement(placement) for name, placement in check.instances.items()}


def require_scene_of_trial(
    scene: Scene | CheckedScene, sheet: TrialSheet, trial: RealTrial, where: str
) -> None:
    """Refuses a scene that differs from the scene of a trial.

    Args:
        scene: scene from a file or from a placement check.
        sheet: contents of the trials file.
        trial: the trial.
        where: file of the scene or of the check, for the message.

    Raises:
        InvalidInputError: the scene differs.
    """
    expected = sheet.runs[trial.run].scene
    if scene.content != expected.content:
        raise InvalidInputError(
            f"{where} is of scene {scene.name!r} ({scene.content[:12]}), but"
            f" trial {trial.number} is on {expected.name!r} ({expected.content[:12]})"
        )


def measure_placement(
    scene: Scene,
    photo: str | Path,
    intrinsics: str | Path,
    *,
    depth: str | Path | None = None,
    depth_unit: float | None = None,
    scale: tuple[float, float] = (1.0, 1.0),
) -> PlacementCheck:
    """The placement check of a photo in a file; see `check_placement`.

    Raises:
        InvalidInputError: a file cannot be read, or the images do not belong to the intrinsics.
    """
    from burg_drake.cameras import (
        check_placement,
        describe_image_file,
        load_intrinsics,
        read_depth,
        read_image,
    )

    camera = load_intrinsics(intrinsics)
    image = read_image(photo)
    camera.require_size(image.shape[1], image.shape[0], str(photo))
    distances = None
    if depth is not None:
        distances = read_depth(depth, depth_unit)
        camera.require_size(distances.shape[1], distances.shape[0], str(depth))
    return check_placement(
        scene,
        image,
        camera,
        depth=distances,
        scale=scale,
        image_source=describe_image_file(photo),
        depth_source=None if depth is None else describe_image_file(depth),
    )


def save_photo_and_placement(
    trials_path: str | Path,
    number: int,
    *,
    photo: str | Path | None = None,
    check: PlacementCheck | None = None,
) -> str:
    """Copies a photo and writes a placement check beside a trials file.

    Args:
        trials_path: the trials file.
        number: number of the trial.
        photo: the photo; none if None.
        check: its placement check; none if None.

    Returns:
        Path of the copied photo, relative to the trials file's folder; empty without a photo.

    Raises:
        InvalidInputError: the photo cannot be read, or a file cannot be written.
    """
    from burg_drake.cameras import decode_image

    folder = Path(os.path.realpath(trials_path)).parent
    content = None if photo is None else read_bytes(photo, FileLimits.image_bytes)
    if content is not None and decode_image(content) is None:
        raise InvalidInputError(f"{photo} is not a readable image; give a PNG or JPEG")
    copy = ""
    with lock_trials_file(Path(trials_path)):  # no other process takes the same name
        stem = _free_stem(folder, number)
        if photo is not None and content is not None:
            copy = f"photos/{stem}{Path(photo).suffix.lower()}"
            atomic_write(folder / copy, content)
        if check is not None:
            save_placement(check, folder / "placements" / f"{stem}.yaml")
    return copy


def _free_stem(folder: Path, number: int) -> str:
    """An unused file name for a photo and a placement check."""
    for k in count(1):
        stem = f"{number:03d}" if k == 1 else f"{number:03d}_{k}"
        if not any(any((folder / place).glob(f"{stem}.*")) for place in ("photos", "placements")):
            return stem
    raise AssertionError


def _summarize_placement(placement: Placement) -> ObjectPlace:
    offset, sd = placement.displacement, placement.displacement_sd
    return ObjectPlace(
        status=placement.status,
        offset_mm=None if offset is None else _millimetres(offset),
        offset_sd_mm=None if sd is None else _millimetres(sd),
        turn_deg=None if placement.angle is None else _degrees(placement.angle),
        turn_sd_deg=None if placement.angle_sd is None else _degrees(placement.angle_sd),
        X_SO=None if placement.measured is None else Pose.readable(placement.measured.matrix()),
    )


def _millimetres(offset: tuple[float, float]) -> tuple[float, float]:
    x, y = (round(1e3 * value, 3) + 0.0 for value in offset)
    return x, y


def _degrees(angle: float) -> float:
    return round(math.degrees(angle), 3) + 0.0
