"""Poses of a camera over a board: errors, CPU time, and the method of a peer in the same images.

    python benchmarks/board_pose.py [--views N] [--sweep N] [--seed S]

Images of `tests.cameras.synthetic` with exact truth: random views of the default board from
0.5 to 1 m, up to 50 degrees off the vertical, turned at random. First as the targets have it:
clean, with 55 % of the markers hidden, and with 90 % (both with noise of 4 of 256 levels and a blur
of 0.6 pixels), at 640 x 480 and 1280 x 720. Then a sweep of what else degrades images, at
640 x 480.

Columns: `camera` is the distance of the estimated from the true position of the camera in S, and
the angle between their rotations; `board` the distance of the markers' centres from their true
places in the camera's frame, mean over the board. All are median and 95 % of the views that are
valid. `sigma` is the root mean square of errors over what the estimate's covariance says (1 if it
is right). `ms` is CPU time of one thread, best of three, median over the views.

The peer is BURG-Toolkit: OpenCV's ArUco detector as it comes, all corners that it finds into one
iterative solvePnP. Its board of the same sheet (DICT_4X4_250, sides of 57 mm, gaps of 19 mm) is
seen in the same views, with the same share of its markers hidden.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cache

import cv2
import numpy as np
from scipy.spatial.transform import Rotation

from burg_drake.cameras.optics.intrinsics import Intrinsics
from burg_drake.cameras.pose.estimator import BoardPose
from burg_drake.core.arrays import Array
from burg_drake.core.frames import inverse
from burg_drake.scene.document.markers import MarkerLayout, Markers, marker_dictionary
from burg_drake.scene.document.scene import Board
from tests.cameras.synthetic import FINE, ImageDegradation, board_image, covers_of, degraded

SMALL = Intrinsics(width=640, height=480, focal=(615.0, 615.0), center=(319.5, 239.5))
LARGE = Intrinsics(width=1280, height=720, focal=(920.0, 920.0), center=(639.5, 359.5))
LENS = Intrinsics(
    width=640,
    height=480,
    focal=(615.0, 617.0),
    center=(323.0, 236.0),
    distortion=(0.12, -0.25, 0.001, -0.0015, 0.1),
)
REAL = ImageDegradation(noise=4.0, blur=0.6)
OURS = Board()
PEERS = Board(markers=Markers(dictionary="4X4_250", side=0.057, spacing=0.019))


@dataclass(frozen=True, kw_only=True)
class Condition:
    """What images are taken under.

    Attributes:
        name: of the row.
        intrinsics: of the camera.
        hidden: share of the markers that are hidden.
        partial: hidden markers show a part.
        look: blur, noise, light.
        tilt: angle of the view off the vertical, from and to [deg].
        target: largest median error of position [mm] and rotation [deg], if there is one.
    """

    name: str
    intrinsics: Intrinsics = SMALL
    hidden: float = 0.0
    partial: bool = False
    look: ImageDegradation = REAL
    tilt: tuple[float, float] = (0.0, 50.0)
    target: tuple[float, float] | None = None


TARGETS = (
    Condition(name="clean 640", look=ImageDegradation(), target=(0.2, 0.02)),
    Condition(name="55 % hidden 640", hidden=0.55, target=(0.5, 0.04)),
    Condition(name="90 % hidden 640", hidden=0.9, target=(2.0, 0.15)),
    Condition(name="clean 1280", intrinsics=LARGE, look=ImageDegradation(), target=(0.05, 0.005)),
    Condition(name="55 % hidden 1280", intrinsics=LARGE, hidden=0.55, target=(0.5, 0.04)),
    Condition(name="90 % hidden 1280", intrinsics=LARGE, hidden=0.9, target=(2.0, 0.15)),
)
SWEEP = (
    Condition(name="55 % partly hidden", hidden=0.55, partial=True),
    Condition(name="90 % partly hidden", hidden=0.9, partial=True),
    Condition(name="blur 1.5 px", look=ImageDegradation(noise=4.0, blur=1.5)),
    Condition(name="blur 2.5 px", look=ImageDegradation(noise=4.0, blur=2.5)),
    Condition(name="noise 10", look=ImageDegradation(noise=10.0, blur=0.6)),
    Condition(name="noise 20", look=ImageDegradation(noise=20.0, blur=0.6)),
    Condition(name="tilt 50 to 60 deg", tilt=(50.0, 60.0)),
    Condition(name="tilt 60 to 70 deg", tilt=(60.0, 70.0)),
    Condition(name="a third of the light", look=ImageDegradation(noise=4.0, blur=0.6, gain=0.33)),
    Condition(name="overexposed by 30 %", look=ImageDegradation(noise=4.0, blur=0.6, gain=1.3)),
    Condition(
        name="light from one side",
        look=ImageDegradation(noise=4.0, blur=0.6, gain=0.7, gradient=1.0),
    ),
    Condition(name="lens distortion", intrinsics=LENS),
)


@dataclass
class Errors:
    """Of the views that gave a pose.

    Attributes:
        views: number that were looked at.
        position [mm], rotation [deg], board [mm]: errors.
        normalised: squared errors by the covariance (6 degrees of freedom).
        milliseconds: CPU time of each view.
        reasons: why views gave none.
    """

    views: int = 0
    position: list[float] = field(default_factory=list)
    rotation: list[float] = field(default_factory=list)
    board: list[float] = field(default_factory=list)
    normalised: list[float] = field(default_factory=list)
    milliseconds: list[float] = field(default_factory=list)
    reasons: list[str] = field(default_factory=list)

    def add(self, X_SC: Array, truth: Array, p_S: Array, covariance: Array | None) -> None:
        """Takes a pose."""
        turn = Rotation.from_matrix(X_SC[:3, :3] @ truth[:3, :3].T).as_rotvec()
        shift = X_SC[:3, 3] - truth[:3, 3]
        self.rotation.append(float(np.degrees(np.linalg.norm(turn))))
        self.position.append(1e3 * float(np.linalg.norm(shift)))
        in_camera = [p_S @ inverse(X)[:3, :3].T + inverse(X)[:3, 3] for X in (X_SC, truth)]
        self.board.append(1e3 * float(np.linalg.norm(in_camera[0] - in_camera[1], axis=1).mean()))
        if covariance is not None:
            error = np.r_[turn, shift]
            self.normalised.append(float(error @ np.linalg.solve(covariance, error)))

    def row(self) -> str:
        """Its columns of the table."""
        if not self.position:
            return f"{0:4.0%}  no pose"
        (p, p95), (r, r95), (b, b95) = (
            np.quantile(v, [0.5, 0.95]) for v in (self.position, self.rotation, self.board)
        )
        sigma = np.sqrt(np.mean(self.normalised) / 6.0) if self.normalised else np.nan
        return (
            f"{len(self.position) / self.views:4.0%} {p:8.3f} {p95:8.3f} {r:8.4f} {r95:8.4f}"
            f" {b:8.3f} {b95:8.3f} {sigma:6.2f} {np.median(self.milliseconds):6.1f}"
        )


class Peer:
    """The method of BURG-Toolkit, from its description."""

    def __init__(self, layout: MarkerLayout, intrinsics: Intrinsics) -> None:
        self._detector = cv2.aruco.ArucoDetector(
            marker_dictionary(layout.dictionary), cv2.aruco.DetectorParameters()
        )
        self._corners = dict(zip(layout.ids.tolist(), layout.p_SQ, strict=True))
        self._intrinsics = intrinsics

    def estimate(self, image: np.ndarray) -> Array | None:
        """`X_SC`, or None."""
        corners, ids, _ = self._detector.detectMarkers(cv2.cvtColor(image, cv2.COLOR_RGB2BGR))
        pairs = [
            (self._corners[int(i)], c.reshape(4, 2))
            for i, c in zip(np.ravel([] if ids is None else ids), corners, strict=False)
            if int(i) in self._corners
        ]
        if not pairs:
            return None
        p_S, pixels = (np.concatenate(part).astype(float) for part in zip(*pairs, strict=True))
        fits, rotation, translation = cv2.solvePnP(
            p_S, pixels, self._intrinsics.K, self._intrinsics.coefficients
        )
        X_CS = np.eye(4)
        X_CS[:3, :3], X_CS[:3, 3] = cv2.Rodrigues(rotation)[0], translation.ravel()
        return inverse(X_CS) if fits else None


def random_view(rng: np.random.Generator, board: Board, tilt: tuple[float, float]) -> Array:
    """A camera that looks at about the middle of a board from 0.5 to 1 m."""
    distance, angle = rng.uniform(0.5, 1.0), np.radians(rng.uniform(*tilt))
    direction, roll = rng.uniform(-np.pi, np.pi, 2)
    target = np.r_[rng.uniform(0.4, 0.6, 2) * board.size, 0.0]
    R = Rotation.from_euler("ZYZ", [direction, angle, 0.0]).as_matrix()  # z away from the sheet
    R = R @ np.diag([1.0, -1.0, -1.0]) @ Rotation.from_euler("z", roll).as_matrix()
    X_SC = np.eye(4)
    X_SC[:3, :3], X_SC[:3, 3] = R, target - distance * R[:, 2]
    return X_SC


def measure(condition: Condition, board: Board, views: int, seed: int, peer: bool) -> Errors:
    """Errors of one method."""
    layout, intrinsics = board.layout, condition.intrinsics
    ours, theirs = BoardPose(board, intrinsics), Peer(layout, intrinsics)
    errors = Errors(views)
    for k in range(views):
        truth, clean = seen(
            board, intrinsics, condition.tilt, condition.hidden, condition.partial, seed, k
        )
        image = degraded(clean, condition.look, np.random.default_rng([seed, k, 1]))
        p_S = layout.p_SQ.mean(axis=1)
        if peer:
            X_SC = theirs.estimate(image)
            errors.milliseconds.append(best_time(lambda: theirs.estimate(image)))  # noqa: B023
            if X_SC is not None:
                errors.add(X_SC, truth, p_S, None)
            continue
        estimate = ours.estimate(image)
        errors.milliseconds.append(best_time(lambda: ours.estimate(image)))  # noqa: B023
        if estimate.valid:
            errors.add(estimate.X_SC, truth, p_S, estimate.covariance)
        else:
            errors.reasons.append(estimate.reason)
    return errors


@cache
def seen(
    board: Board,
    intrinsics: Intrinsics,
    tilt: tuple[float, float],
    hidden: float,
    partial: bool,
    seed: int,
    k: int,
) -> tuple[Array, np.ndarray]:
    """A view and its image without noise and blur, which conditions share: making images takes most
    of the time."""
    rng = np.random.default_rng([seed, k])
    truth = random_view(rng, board, tilt)
    covers, _ = covers_of(board.layout, hidden, rng, partial=partial)
    return truth, board_image(board, intrinsics, truth, covers=covers, samples=FINE)


def best_time(run: Callable[[], object]) -> float:
    """CPU time of the fastest of three runs [ms]."""
    seconds = []
    for _ in range(3):
        start = time.process_time()
        run()
        seconds.append(time.process_time() - start)
    return 1e3 * min(seconds)


def print_rows(conditions: tuple[Condition, ...], views: int, seed: int) -> None:
    """Measures and prints conditions."""
    print(f"{'':22}{'':14}   camera [mm]        camera [deg]       board [mm]")
    columns = ("median", "95 %") * 3
    print(f"{'':22}{'':9}{'valid':>5}" + "".join(f"{c:>9}" for c in columns) + "  sigma     ms")
    for condition in conditions:
        ours = measure(condition, OURS, views, seed, peer=False)
        theirs = measure(condition, PEERS, views, seed, peer=True)
        print(f"{condition.name:22}{'':9}{ours.row()}", flush=True)
        print(f"{'':22}{'peer':9}{theirs.row()}")
        if ours.position and theirs.position:
            pairs = (
                (ours.position, theirs.position),
                (ours.rotation, theirs.rotation),
                (ours.board, theirs.board),
            )
            ratios = [np.median(b) / np.median(a) for a, b in pairs]
            print(f"{'':22}{'times':9}{'':5}" + "".join(f"{r:9.0f}{'':9}" for r in ratios))
        if condition.target and ours.position:
            mm, deg = condition.target
            met = np.median(ours.position) <= mm and np.median(ours.rotation) <= deg
            print(f"{'':22}target {mm:g} mm, {deg:g} deg: {'met' if met else 'MISSED'}")
        for reason in sorted(set(ours.reasons)):
            print(f"{'':22}no pose ({ours.reasons.count(reason)}): {reason}")


def main() -> None:
    """Runs the benchmark."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--views", type=int, default=12, help="views of each target")
    parser.add_argument("--sweep", type=int, default=6, help="views of each row of the sweep")
    parser.add_argument("--seed", type=int, default=1)
    args = parser.parse_args()
    cv2.setNumThreads(1)
    if args.views:
        print_rows(TARGETS, args.views, args.seed)
    if args.sweep:
        print_rows(SWEEP, args.sweep, args.seed)


if __name__ == "__main__":
    main()
