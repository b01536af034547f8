"""Placement checks in ambient light and in sun, of objects off their places, missing or too many.

    python benchmarks/room_placement.py [--rows NAME ...] [--photos N] [--size 640x480 ...]
                                        [--views N] [--keep FOLDER] [--recolored] [--true-pose] [-v]

Photos of `benchmarks/room`, which shares no code with what reads them: `tabletop_six` on its
printed board, each object 0 to 30 mm and up to 20 degrees off, one in four on its place; a camera
with noise, blur and a lens 0.6 to 1 m away, 35 to 70 degrees above the board, on all sides. Objects
have stripes of up to 40 % contrast. Of six photos one has an object too many, one lacks one, and in
one two stand on each other's places. The board's pose is `BoardPose`'s, or with --true-pose the
true one; photos without a valid one are skipped, and counted. With --views the same scene is
taken from several sides and checked as one. With --recolored the objects do not have the colors
of their meshes.

Columns: `measured`, of the objects that stand within 30 mm of their place and of which more than
half is seen; their errors of displacement [mm] and turn [deg], median and 95 %; `sd`, root mean
square of errors over standard deviations (1 if these are right) of displacement and turn; `false`,
`measured` beyond 3 standard deviations and 1 mm or 1 degree, or another object than it says, of all
`measured`; `>5 sd`, uncertain ones with numbers beyond 5 standard deviations, of all uncertain ones
within range; `missing`, that are `not_seen`; `swapped`, whose reason names the other; `extra`,
named within 50 mm of its middle; `too many`, named though there is none; CPU
time of a photo, median [s].
"""

from __future__ import annotations

import argparse
import time
from collections import Counter
from dataclasses import dataclass, field
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray
from room.lens import CAMERAS, Camera
from room.placed import LIGHTS, PlacedPhoto, kept
from room.rows import BOARD

import burg_drake as burg

SEEN = 0.5
NEAR = 0.05
"""Of an extra object's middle to where it is named: less than half of the largest's length [m]."""
LEAST = (1e-3, np.deg2rad(1.0))
"""Errors below these do not mislead anybody [m, rad]; see the column `false`."""


@dataclass
class Tally:
    """What was counted of a row."""

    photos: int = 0
    skipped: int = 0
    counts: Counter[str] = field(default_factory=Counter)
    shift: list[float] = field(default_factory=list)
    turn: list[float] = field(default_factory=list)
    shift_sd: list[float] = field(default_factory=list)
    turn_sd: list[float] = field(default_factory=list)
    seconds: list[float] = field(default_factory=list)


def intrinsics_of(camera: Camera) -> burg.cameras.Intrinsics:
    """The camera's, as its calibration would have them."""
    return burg.cameras.Intrinsics(
        width=camera.size[0],
        height=camera.size[1],
        focal=camera.focal,
        center=camera.center,
        distortion=camera.coefficients,
    )


def checked(photos: list[PlacedPhoto], camera: Camera, tally: Tally, arguments: Any) -> Any:
    """The check of photos of one scene; None if the board's pose is not valid in one."""
    scene, intrinsics = burg.load_scene(BOARD.scene), intrinsics_of(camera)
    estimator = burg.cameras.BoardPose(scene.board, intrinsics)
    estimates = [estimator.estimate(photo.image) for photo in photos]
    if arguments.true_pose:
        estimates = [
            burg.cameras.BoardEstimate(X_SC=photo.X_SC, valid=True, covariance=np.zeros((6, 6)))
            for photo in photos
        ]
    if not all(estimate.valid for estimate in estimates):
        tally.skipped += 1
        return None
    start = time.process_time()
    if len(photos) == 1:
        check = burg.cameras.check_placement(
            scene, photos[0].image, intrinsics, estimate=estimates[0]
        )
    else:
        check = burg.cameras.combine_checks(
            [
                burg.cameras.check_placement(scene, photo.image, intrinsics, estimate=estimate)
                for photo, estimate in zip(photos, estimates, strict=True)
            ]
        )
    tally.seconds.append((time.process_time() - start) / len(photos))
    tally.photos += 1
    return check


def compare(photos: list[PlacedPhoto], check: Any, tally: Tally, label: str) -> None:
    """Counts what a check says of a scene."""
    photo, verbose = photos[0], bool(label)
    for name, found in check.instances.items():
        seen = max(p.seen.get(name, 0.0) for p in photos)
        if name in photo.odd:
            _odd(photo, name, found, tally, label)
            continue
        off = _errors(found, photo.X_SO[name])
        wrong = off is not None and _beyond(off, 3.0)
        if seen > SEEN:
            tally.counts["seen"] += 1
            tally.counts[found.status] += 1
        if found.status == "measured":
            assert off is not None
            tally.counts["all measured"] += 1
            tally.counts["false"] += wrong
            tally.shift.append(1e3 * float(np.hypot(*off[0][:2])))
            tally.shift_sd.extend(off[0][:2] / off[1][:2])
            if np.isfinite(off[0][2]):
                tally.turn.append(float(np.rad2deg(abs(off[0][2]))))
                tally.turn_sd.append(off[0][2] / off[1][2])
        elif found.status == "uncertain" and off is not None:
            tally.counts["with numbers"] += 1
            tally.counts["far"] += _beyond(off, 5.0)
        if verbose and (found.status != "measured" or wrong):
            what = "" if off is None else _text(off)
            print(f"  {label} {name}, seen {seen:.2f}: {found.status} {what} {found.reason}")
    named = [np.array(extra.position) for extra in getattr(check, "extra", ())]
    if photo.extra is not None:
        right = [np.hypot(*(p - photo.extra)) < NEAR for p in named]
        tally.counts["extra"] += 1
        tally.counts["extra named"] += any(right)
        tally.counts["too many"] += len(right) - sum(right)
        if verbose and not any(right):
            print(f"  {label} the extra object at {photo.extra.round(3)} is not named: {named}")
    else:
        tally.counts["too many"] += len(named)
        if verbose and named:
            print(f"  {label} extra objects that are none: {named}")


def _odd(photo: PlacedPhoto, name: str, found: Any, tally: Tally, label: str) -> None:
    tally.counts[photo.kind] += 1
    if photo.kind == "missing":
        right = found.status == "not_seen"
    else:
        other = next(o for o in photo.odd if o != name)
        right = found.status != "measured" and other in found.reason
    tally.counts[f"{photo.kind} named"] += right
    tally.counts["all measured"] += found.status == "measured"
    tally.counts["false"] += found.status == "measured"
    if label and not right:
        print(f"  {label} {photo.kind} {name}: {found.status} {found.reason}")


def _errors(found: Any, X_SO: NDArray[np.float64]) -> tuple[Any, Any] | None:
    """Errors of x, y [m] and turn [rad], and what the check says of them."""
    if found.displacement is None:
        return None
    p_OR = np.r_[found.reference, 1.0]
    target = found.target.matrix()
    shift = np.array(found.displacement) - ((X_SO - target) @ p_OR)[:2]
    sd = np.array(found.displacement_sd)
    if found.angle is None:
        return np.r_[shift, np.nan], np.r_[sd, np.nan]
    R = X_SO[:3, :3] @ target[:3, :3].T
    turn = found.angle - np.arctan2(R[1, 0], R[0, 0])
    return np.r_[shift, (turn + np.pi) % (2 * np.pi) - np.pi], np.r_[sd, found.angle_sd]


def _beyond(off: tuple[Any, Any], times: float) -> bool:
    error, sd = np.abs(off[0]), off[1]
    least = np.array([LEAST[0], LEAST[0], LEAST[1]])
    return bool(np.any((error > times * sd) & (error > least)))


def _text(off: tuple[Any, Any]) -> str:
    unit = np.array([1e3, 1e3, 180 / np.pi])
    return f"off {(off[0] * unit).round(2)}, sd {(off[1] * unit).round(2)}"


def printed(row: str, size: str, tally: Tally) -> None:
    """Prints a row of the table."""
    c = tally.counts
    line = f"{row:10}{size:>9} {c['measured']:4}/{c['seen']:<4}"
    for values in (tally.shift, tally.turn):
        line += "{:8.2f}{:8.2f}".format(*np.quantile(values or [np.nan], [0.5, 0.95]))
    for values in (tally.shift_sd, tally.turn_sd):
        line += f"{np.sqrt(np.mean(np.square(values or [np.nan]))):6.2f}"
    line += f"{c['false']:5}/{c['all measured']:<4}{c['far']:4}/{c['with numbers']:<4}"
    for kind in ("missing", "swapped", "extra"):
        line += f"{c[f'{kind} named']:4}/{c[kind]:<3}"
    line += f"{c['too many']:5}{np.median(tally.seconds or [np.nan]):8.2f}"
    print(f"{line}{f'  {tally.skipped} skipped' if tally.skipped else ''}", flush=True)


def main() -> None:
    """Runs the benchmark."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--rows", nargs="+", choices=LIGHTS, default=list(LIGHTS), metavar="NAME")
    parser.add_argument("--photos", type=int, default=12, help="of each row and size")
    parser.add_argument("--first", type=int, default=0, help="number of the first photo")
    parser.add_argument("--size", nargs="+", choices=CAMERAS, default=["640x480"])
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--views", type=int, default=1, help="photos that are checked as one")
    parser.add_argument("--keep", type=Path, help="folder that pictures are kept in")
    parser.add_argument("--recolored", action="store_true", help="unlike the library's meshes")
    parser.add_argument("--true-pose", action="store_true", help="of the board")
    parser.add_argument("-v", "--verbose", action="store_true", help="what went wrong")
    arguments = parser.parse_args()
    cv2.setNumThreads(1)
    print(
        f"{'':20}{'measured':>9}{'mm':>8}{'95 %':>8}{'deg':>8}{'95 %':>8}{'sd':>6}{'turn':>6}"
        f"{'false':>10}{'>5 sd':>9}{'missing':>8}{'swapped':>8}{'extra':>7}{'too many':>9}{'s':>5}"
    )
    with TemporaryDirectory() as scratch:
        for size in arguments.size:
            for row in arguments.rows:
                printed(row, size, _row(row, size, arguments, arguments.keep or Path(scratch)))


def _row(row: str, size: str, arguments: argparse.Namespace, folder: Path) -> Tally:
    tally, camera = Tally(), CAMERAS[size]
    for k in range(arguments.first, arguments.first + arguments.photos):
        photos = [
            kept(folder, row, camera, (arguments.seed, k), view, arguments.recolored)
            for view in range(arguments.views)
        ]
        check = checked(photos, camera, tally, arguments)
        if check is not None:
            compare(photos, check, tally, f"{row} {k}" if arguments.verbose else "")
    return tally


if __name__ == "__main__":
    main()
