"""How well `burg-drake camera calibrate` finds a camera's intrinsics, on images with known truth.

    python benchmarks/calibration.py [CAMERA ...] [--views 30] [--seed 0]

Views of the default target (8 x 11 squares of 20 mm, markers of 14 mm) at 0.2 to 0.45 m, tilted up
to 37 degrees to all sides, blurred by 0.7 pixels, with noise of 2 grey levels. What matters is how
far the camera model is off anywhere in the image (`worst`), and what of that a small turn of the
camera does not take up (`turned`): a pose takes it up. `known` is the scatter that the calibration
itself expects there, and the last columns are errors of parameters in their standard deviations.
"""

from __future__ import annotations

import argparse
import time

import cv2
import numpy as np
from scipy.optimize import least_squares

from burg_drake.cameras.calibration.estimation import Calibration, calibrate_views
from burg_drake.cameras.calibration.lens_uncertainty import image_grid, uncertainty
from burg_drake.cameras.calibration.target import CharucoTarget, CharucoView, find_target
from burg_drake.cameras.optics.intrinsics import Intrinsics
from burg_drake.core.arrays import Array
from burg_drake.core.errors import InvalidInputError
from burg_drake.core.frames import make_pose
from tests.cameras.charuco_image import target_image

CAMERAS = {
    "640x480": Intrinsics(
        width=640,
        height=480,
        focal=(600.0, 602.0),
        center=(322.0, 236.0),
        distortion=(-0.25, 0.08, 0.001, -0.0005),
    ),
    "1280x720": Intrinsics(
        width=1280,
        height=720,
        focal=(920.0, 921.0),
        center=(645.0, 352.0),
        distortion=(0.12, -0.25, 0.0004, 0.0008, 0.11),
    ),
    "1280x720 wide": Intrinsics(
        width=1280,
        height=720,
        focal=(760.0, 762.0),
        center=(635.0, 365.0),
        distortion=(0.4, 0.05, 0.0002, -0.0003, 0.002, 0.6, 0.1, 0.005),
    ),
}
"""A webcam with a barrel, one with k3, and a wide lens (100 degrees) of the rational model."""
BLUR, NOISE = 0.7, 2.0
COLUMNS = ("views", "model", "rms", "fx", "fy", "cx", "cy", "worst", "turned", "known", "sigmas")


def some_view(
    intrinsics: Intrinsics, target: CharucoTarget, rng: np.random.Generator
) -> tuple[Array, CharucoView, float]:
    """A random view: the corners that are found, and the CPU seconds that finding them took."""
    while True:
        distance, tilt = rng.uniform(0.2, 0.45), rng.uniform(0.1, 0.65)
        heading, roll = rng.uniform(0.0, 2 * np.pi, 2)
        R = cv2.Rodrigues(tilt * np.array([np.cos(heading), np.sin(heading), 0.0]))[0]
        R = R @ cv2.Rodrigues(np.array([0.0, 0.0, roll]))[0]
        field = np.array([intrinsics.width, intrinsics.height]) / intrinsics.focal
        aside = rng.uniform(-0.3, 0.3, 2) * distance * field
        center = np.array([*target.size, 0.0]) / [2.0, 2.0, 1.0]
        X_TC = make_pose(R, center - R @ [*aside, distance])
        try:
            image = target_image(target, intrinsics, X_TC, blur=BLUR, noise=NOISE, rng=rng)
        except InvalidInputError:  # part of the image looks past the plane
            continue
        start = time.process_time()
        view = find_target(image, target, "view")
        spent = time.process_time() - start
        if not isinstance(view, str):
            return X_TC, view, spent


def deviations(truth: Intrinsics, found: Intrinsics) -> tuple[float, float]:
    """Largest distance [pixels] between where the true and the found camera show the same, over
    the image; before and after the turn of the camera that lowers it most."""
    pixels = image_grid(truth, 41, 31)
    straight = (truth.undistort(pixels) - truth.center) / truth.focal
    rays = np.column_stack([straight, np.ones(len(straight))])

    def off(turn: Array) -> Array:
        return (found.project(rays @ cv2.Rodrigues(turn)[0].T) - pixels).ravel()

    best = least_squares(off, np.zeros(3)).x
    worst = [np.linalg.norm(off(t).reshape(-1, 2), axis=1).max() for t in (np.zeros(3), best)]
    return float(worst[0]), float(worst[1])


def row_of(truth: Intrinsics, calibration: Calibration, views: int) -> tuple[str, ...]:
    """A row of the table."""
    found = calibration.intrinsics
    errors = np.array([*found.focal, *found.center]) - [*truth.focal, *truth.center]
    sigmas = np.abs(errors) / [s for _, s in list(calibration.parameters.values())[:4]]
    worst, turned = deviations(truth, found)
    known = uncertainty(calibration, image_grid(truth, 41, 31)).max()
    figures = (calibration.rms, *errors, worst, turned, known)
    return (
        str(views),
        calibration.model,
        *(f"{value:.3f}" for value in figures),
        " ".join(f"{s:.1f}" for s in sigmas),
    )


def main() -> None:
    """Prints a table a camera."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("cameras", nargs="*", default=list(CAMERAS), help="default: all")
    parser.add_argument("--views", type=int, default=30)
    parser.add_argument("--seed", type=int, default=0)
    arguments = parser.parse_args()
    cv2.setNumThreads(1)
    target = CharucoTarget()
    for name in arguments.cameras:
        truth = CAMERAS[name]
        rng = np.random.default_rng(arguments.seed)
        made = [some_view(truth, target, rng) for _ in range(arguments.views)]
        offs = []
        for X_TC, view, _ in made:
            X_CT = np.linalg.inv(X_TC)
            p_C = target.p_TQ[view.ids] @ X_CT[:3, :3].T + X_CT[:3, 3]
            offs.append(view.corners - truth.project(p_C))
        off = np.sqrt(np.mean(np.sum(np.concatenate(offs) ** 2, axis=1)))
        spent = 1e3 * np.median([seconds for *_, seconds in made])
        print(f"\n{name}: corners are off by {off:.3f} pixels (rms); {spent:.0f} ms CPU an image")
        print("  ".join(f"{column:>8}" for column in COLUMNS))
        views = [view for _, view, _ in made]
        for count in (10, 20, 30):
            for first in range(0, len(views) - count + 1, count):
                start = time.process_time()
                calibration = calibrate_views(views[first : first + count], target)
                spent = time.process_time() - start
                row = row_of(truth, calibration, count)
                print("  ".join(f"{text:>8}" for text in row) + f"  {spent:.2f} s CPU", flush=True)


if __name__ == "__main__":
    main()
