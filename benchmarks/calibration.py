"""How well `burg-drake camera calibrate` finds a camera, and whether it is as good as it promises.

    python benchmarks/calibration.py [LENS ...] [--calibrations 4] [--views 15] [--bulge-mm 0.5]
    python benchmarks/calibration.py [LENS ...] --corners [--calibrations 40]

Pictures of `benchmarks/room`, which shares no code with what is judged: the page that
`burg-drake camera target` prints, in linear light, through lenses by closed forms, with blur of
0.6 pixels, vignetting, the noise of 3,000 electrons and JPEG. The target is 0.15 to 0.35 m away
and tilted by 5 to 45 degrees, its middle anywhere in the image (`all over`) or in the middle half
of its width and height (`middle`), where the image's corners stay empty. With `--corners` there are
no pictures, but corners with errors of 0.03 pixels each and, over a view, of waves of 0.03 pixels.

Columns: the models that were chosen; the residual; how far the camera is off at most [pixels] where
the promise holds, what is promised there, and their ratio, median and worst; how many of nine parts
of the image are excepted, how far it is off anywhere, what the bounds say there, and the worst
ratio of any part; CPU time of a calibration [s]. The turn of the camera that lowers errors most
does not count, as a pose takes it up. Medians of all calibrations.
"""

from __future__ import annotations

import argparse
import time
from collections import Counter
from dataclasses import dataclass

import numpy as np
from room.lens import Camera, Fisheye
from room.rows import WEBCAM
from room.target import target_picture, view_at
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation

import burg_drake as burg
from burg_drake.cameras import IMAGE_PARTS, calibrate_views, find_target, image_part_indices

Array = np.ndarray

LENSES = {
    "barrel": Camera((640, 480), (600.0, 602.0), (322.0, 236.0), (-0.25, 0.08, 1e-3, -5e-4, 0.0)),
    "k3": Camera((1280, 720), (920.0, 921.0), (645.0, 352.0), (0.12, -0.25, 4e-4, 8e-4, 0.11)),
    "barrel k3": Camera(
        (640, 480), (500.0, 502.0), (322.0, 236.0), (-0.32, 0.16, 4e-4, 8e-4, -0.05)
    ),
    "rational 100": Camera(
        (1280, 720),
        (760.0, 762.0),
        (635.0, 365.0),
        (0.4, 0.05, 2e-4, -3e-4, 0.002, 0.6, 0.1, 0.005),
    ),
    "equisolid 150": Fisheye((1280, 960), (520.0, 521.0), (635.0, 485.0), projection="equisolid"),
    "stereographic 150": Fisheye(
        (1280, 960), (430.0, 430.5), (645.0, 475.0), projection="stereographic"
    ),
}
"""Barrel, one with k3, a strong barrel with k3, a wide one whose corners look 100 degrees apart,
and fisheyes of 140 to 150 degrees across, which the calibrated model only approximates."""
REACHES = {"all over": 1.0, "middle": 0.5}
"""Where the target's middle is, as a share of the image."""
TARGET = burg.cameras.CharucoTarget()
NOISE = WAVES = 0.03
"""Errors of corners with `--corners` [pixels]: as large as those in the pictures."""
SMALLEST = 22.0
"""Sides of squares there, at least [pixels]."""
FARTHEST = np.radians(85.0)
"""From the axis, up to which errors are looked for: what the target can be brought to."""


@dataclass(frozen=True)
class Judgement:
    """A calibration beside the truth; all but the first in pixels.

    Attributes:
        model: that was chosen.
        residual: root mean square.
        off, promised: largest error where the promise holds, and what it says.
        excepted: parts where it does not.
        anywhere, bound: largest error over the image, and the largest bound.
        ratio: largest ratio of error and bound of any part.
        seconds: of CPU time.
    """

    model: str
    residual: float
    off: float
    promised: float
    excepted: int
    anywhere: float
    bound: float
    ratio: float
    seconds: float


def seen_views(
    camera: Camera, reach: float, count: int, rng: np.random.Generator, bulge: float
) -> list[burg.cameras.CharucoView]:
    """Views from pictures."""
    views: list[burg.cameras.CharucoView] = []
    while len(views) < count:
        image = target_picture(camera, view_at(camera, reach, rng), WEBCAM, rng, bulge)
        view = find_target(image, TARGET, f"view {len(views)}")
        if not isinstance(view, str):
            views.append(view)
    return views


def made_views(
    camera: Camera, reach: float, count: int, rng: np.random.Generator, bulge: float = 0.0
) -> list[burg.cameras.CharucoView]:
    """Views of corners that are projected, with errors."""
    columns, rows = (n - 1 for n in TARGET.squares)
    place = np.stack(np.meshgrid(np.arange(columns) + 1, np.arange(rows) + 1), axis=-1)
    flat = TARGET.square * (place.reshape(-1, 2) - np.array(TARGET.squares) / 2) * [1.0, -1.0]
    middle = np.array([0.105, 0.1485])
    height = bulge * (1.0 - (flat[:, 1] / middle[1]) ** 2)
    views: list[burg.cameras.CharucoView] = []
    while len(views) < count:
        X_SC = view_at(camera, reach, rng)
        p_C = (np.c_[flat + middle, height] - X_SC[:3, 3]) @ X_SC[:3, :3]
        ahead = p_C[:, 2] > np.cos(np.radians(88.0)) * np.linalg.norm(p_C, axis=1)
        pixels = camera.project(np.where(ahead[:, None], p_C, [0.0, 0.0, 1.0]))
        inside = ahead & ((pixels > 6) & (pixels < np.array(camera.size) - 7)).all(axis=1)
        # A lens's formula leads what is far outside back into the image.
        at = np.where(inside[:, None], pixels, camera.center)
        flat_C = p_C[:, :2] / p_C[:, 2:]
        inside &= np.abs(camera.directions(at) - flat_C).max(axis=1) < 1e-3
        grid = np.where(inside[:, None], pixels, np.nan).reshape(rows, columns, 2)
        sides = np.linalg.norm(np.diff(grid, axis=1), axis=2)
        if inside.sum() < 20 or not np.nanmedian(sides) > SMALLEST:
            continue
        found = pixels[inside]
        wave = rng.normal(0.0, 1.0, (2, 2)) / 100.0
        found = found + WAVES * np.sin((found - found.mean(axis=0)) @ wave + rng.uniform(0, 6, 2))
        found += rng.normal(0.0, NOISE, found.shape)
        views.append(
            burg.cameras.CharucoView(
                f"view {len(views)}",
                camera.size,
                np.flatnonzero(inside).astype(np.int32),
                found,
                0.7,
                float(np.nanmedian(sides)),
            )
        )
    return views


def errors(camera: Camera, found: burg.cameras.Intrinsics) -> tuple[Array, Array]:
    """(N, 2) places all over the image, and (N,) how far from there the calibrated camera shows
    what the true one shows there, after the turn that lowers that most [pixels]."""
    width, height = camera.size
    pixels = np.stack(
        np.meshgrid(np.linspace(0, width - 1, 41), np.linspace(0, height - 1, 31)), axis=-1
    ).reshape(-1, 2)
    if isinstance(camera, Fisheye):
        pixels = pixels[camera.angles(pixels) < FARTHEST]
    rays = np.c_[camera.directions(pixels), np.ones(len(pixels))]
    rays /= np.linalg.norm(rays, axis=1, keepdims=True)

    def off(turn: Array) -> Array:
        return np.asarray(found.project(rays @ Rotation.from_rotvec(turn).as_matrix().T) - pixels)

    best = least_squares(lambda turn: off(turn).ravel(), np.zeros(3)).x
    return pixels, np.linalg.norm(off(best), axis=1)


def judged(camera: Camera, views: list[burg.cameras.CharucoView]) -> Judgement:
    """Calibrates, and compares."""
    start = time.process_time()
    found = calibrate_views(views, TARGET)
    seconds = time.process_time() - start
    pixels, off = errors(camera, found.intrinsics)
    part = np.array(IMAGE_PARTS)[image_part_indices(pixels, camera.size)]
    accuracy = found.accuracy
    of_parts = {name: off[part == name].max() for name in accuracy.parts if (part == name).any()}
    held = [of_parts[name] for name in of_parts if name not in accuracy.excepted_parts]
    return Judgement(
        found.model,
        found.rms,
        max(held),
        accuracy.error_bound,
        len(accuracy.excepted_parts),
        max(of_parts.values()),
        max(accuracy.parts.values()),
        max(error / accuracy.parts[name] for name, error in of_parts.items()),
        seconds,
    )


def main() -> None:
    """Prints a row for each lens and where the target was."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("lenses", nargs="*", default=list(LENSES), help="default: all")
    parser.add_argument("--calibrations", type=int, default=4)
    parser.add_argument("--views", type=int, default=15)
    parser.add_argument("--bulge-mm", type=float, default=0.0, help="of the sheet's middle")
    parser.add_argument("--corners", action="store_true", help="corners instead of pictures")
    parser.add_argument("--seed", type=int, default=0)
    arguments = parser.parse_args()
    heads = ("rms", "off", "promised", "ratio", "worst", "except", "off", "bound", "worst", "s")
    print(f"{'':34}{'':24}" + "".join(f"{head:>9}" for head in heads))
    every: list[Judgement] = []
    bulge = 1e-3 * arguments.bulge_mm
    for name in arguments.lenses:
        for where, reach in REACHES.items():
            rng = np.random.default_rng([arguments.seed, list(LENSES).index(name)])
            found = []
            for _ in range(arguments.calibrations):
                if arguments.corners:
                    views = made_views(LENSES[name], reach, arguments.views, rng, bulge)
                else:
                    views = seen_views(LENSES[name], reach, arguments.views, rng, bulge)
                found.append(judged(LENSES[name], views))
            print_row(f"{name}, {where}", found)
            every += found
    off = np.array([one.off / one.promised for one in every])
    ratio = np.array([one.ratio for one in every])
    print(
        f"{len(every)} calibrations: off by more than promised {np.mean(off > 1):.1%}, than 1.5"
        f" times that {np.mean(off > 1.5):.1%}; in any part {np.mean(ratio > 1):.1%},"
        f" {np.mean(ratio > 1.5):.1%}"
    )


def print_row(name: str, found: list[Judgement]) -> None:
    """A row of the table."""
    models = ", ".join(f"{n} {m}" for m, n in Counter(one.model for one in found).most_common())
    ratio = [one.off / one.promised for one in found]
    figures = (
        np.median([one.residual for one in found]),
        np.median([one.off for one in found]),
        np.median([one.promised for one in found]),
        np.median(ratio),
        np.max(ratio),
        np.mean([one.excepted for one in found]),
        np.median([one.anywhere for one in found]),
        np.median([one.bound for one in found]),
        np.max([one.ratio for one in found]),
        np.median([one.seconds for one in found]),
    )
    print(f"{name:34}{models:24}" + "".join(f"{value:9.3g}" for value in figures), flush=True)


if __name__ == "__main__":
    main()
