"""Poses of a camera over a board in a room: light, motion, paper and hands; OpenCV beside it.

    python benchmarks/room_board.py [--rows NAME ...] [--views N] [--size 640x480 ...] [--jobs J]
    python benchmarks/room_board.py --negatives N

Pictures of `benchmarks/room`, which shares no code with what reads them. The same pictures go to

- ours: `burg.cameras.BoardPose`; valid as it says;
- OpenCV: ArucoDetector with sub-pixel refinement of corners, all corners of the board's markers
  into one solvePnP; valid with a marker or more, if the corners are less than 3 pixels from where
  the pose puts them (root mean square).

Columns: `valid` views; `of cv` the share of OpenCV's valid views that are valid here as well;
distance of the estimated from the true position of the camera [mm] and angle between their
rotations [deg], median and 95 % of the valid views; `worst`, the largest error of position;
`sigma`,
the root mean square of errors over what the covariance says, of all six and of the position alone
(1 if it is right); `> 5 sd`, valid poses with one of six independent errors above that; CPU time of
one thread, median [ms]. Truth is where the camera was in the middle of the exposure, over the plane
that fits the printed corners best. `--negatives` takes pictures without a board and of other
boards, and counts valid poses.
"""

from __future__ import annotations

import argparse
import time
from collections import Counter
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from functools import lru_cache, partial
from multiprocessing import get_context

import cv2
import numpy as np
from numpy.typing import NDArray
from room.lens import CAMERAS, Camera
from room.paper import Board
from room.rows import BOARD, ROWS, Row, picture
from scipy.spatial.transform import Rotation

import burg_drake as burg

Array = NDArray[np.float64]

MOST_RESIDUAL = 3.0
"""Of a valid pose of OpenCV's [pixels]."""
MOST_ERROR = 5.0
"""Of a valid pose of ours, in standard deviations."""
OTHERS = {
    "no board": None,
    "another dictionary": Board(dictionary="6X6_250"),
    "another first_id": Board(first_id=100),
    "ids shifted by 20": Board(first_id=20),
    "markers of 40 mm, gaps of 20": Board(side=0.040, spacing=0.020),
    "markers larger by 4 %": Board(side=0.0468, spacing=0.0132),
}
"""What lies there instead of the board; `no board` is a sheet with objects, its markers covered."""


@dataclass(frozen=True)
class Answer:
    """What one method says of a picture.

    Attributes:
        valid: it gave a pose.
        reason: why not, its figures left out.
        position: error [mm].
        rotation: error [deg].
        normalised, shift: squared errors by the covariance, of all (6 degrees of freedom) and of
            the position (3); NaN without a covariance.
        most: largest error of the six, independent of each other, over what the covariance says.
        milliseconds: CPU time.
    """

    valid: bool
    reason: str = ""
    position: float = np.nan
    rotation: float = np.nan
    normalised: float = np.nan
    shift: float = np.nan
    most: float = np.nan
    milliseconds: float = np.nan


@lru_cache(maxsize=4)
def ours_for(camera: Camera, center_off: float = 0.0) -> burg.cameras.BoardPose:
    """Our estimator of the default board, with intrinsics that are known to that many pixels."""
    intrinsics = burg.cameras.Intrinsics(
        width=camera.size[0],
        height=camera.size[1],
        focal=camera.focal,
        center=camera.center,
        distortion=camera.coefficients,
        known_to=center_off or None,
    )
    return burg.cameras.BoardPose(burg.load_scene("tabletop_six").board, intrinsics)


def ours(image: NDArray[np.uint8], camera: Camera, truth: Array, center_off: float = 0.0) -> Answer:
    """Ours, with its own word about validity."""
    estimator = ours_for(camera, center_off)
    start = time.process_time()
    estimate = estimator.estimate(image)
    spent = 1e3 * (time.process_time() - start)
    if not estimate.valid:
        return Answer(
            False, " ".join(map(_figureless, estimate.reason.split())), milliseconds=spent
        )
    return _answer(estimate.X_SC, truth, estimate.covariance, spent)


def opencv(image: NDArray[np.uint8], camera: Camera, truth: Array) -> Answer:
    """The plain way with OpenCV."""
    start = time.process_time()
    X_SC, reason = _opencv_pose(cv2.cvtColor(image, cv2.COLOR_RGB2GRAY), camera)
    spent = 1e3 * (time.process_time() - start)
    if X_SC is None:
        return Answer(False, reason, milliseconds=spent)
    return _answer(X_SC, truth, None, spent)


def _opencv_pose(grey: NDArray[np.uint8], camera: Camera) -> tuple[Array | None, str]:
    parameters = cv2.aruco.DetectorParameters()
    parameters.cornerRefinementMethod = cv2.aruco.CORNER_REFINE_SUBPIX
    dictionary = getattr(cv2.aruco, f"DICT_{BOARD.dictionary}")
    detector = cv2.aruco.ArucoDetector(cv2.aruco.getPredefinedDictionary(dictionary), parameters)
    corners, ids, _ = detector.detectMarkers(grey)
    known = dict(zip(BOARD.ids.tolist(), BOARD.p_SQ, strict=True))
    pairs = [
        (known[int(i)], found.reshape(4, 2))
        for i, found in zip(np.ravel([] if ids is None else ids), corners, strict=True)
        if int(i) in known
    ]
    if not pairs:
        return None, "no marker"
    p, pixels = (np.concatenate(part).astype(float) for part in zip(*pairs, strict=True))
    p_S = np.c_[p, np.zeros(len(p))]
    K = np.diag([*camera.focal, 1.0])
    K[:2, 2] = camera.center
    bend = np.array(camera.coefficients)
    fits, turn, shift = cv2.solvePnP(p_S, pixels, K, bend)
    if not fits:
        return None, "no pose"
    back, _ = cv2.projectPoints(p_S, turn, shift, K, bend)
    if np.sqrt(((back.reshape(-1, 2) - pixels) ** 2).sum(axis=1).mean()) >= MOST_RESIDUAL:
        return None, "residual"
    X_SC = np.eye(4)
    X_SC[:3, :3] = cv2.Rodrigues(turn)[0].T
    X_SC[:3, 3] = -X_SC[:3, :3] @ shift.ravel()
    return X_SC, ""


def _answer(X_SC: Array, truth: Array, covariance: Array | None, spent: float) -> Answer:
    turn = Rotation.from_matrix(X_SC[:3, :3] @ truth[:3, :3].T).as_rotvec()
    shift = X_SC[:3, 3] - truth[:3, 3]
    all_six = of_shift = most = np.nan
    if covariance is not None:
        error = np.r_[turn, shift]
        all_six = float(error @ np.linalg.solve(covariance, error))
        most = float(np.abs(np.linalg.solve(np.linalg.cholesky(covariance), error)).max())
        of_shift = float(shift @ np.linalg.solve(covariance[3:, 3:], shift))
    return Answer(
        True,
        "",
        1e3 * float(np.linalg.norm(shift)),
        float(np.degrees(np.linalg.norm(turn))),
        all_six,
        of_shift,
        most,
        spent,
    )


def _figureless(word: str) -> str:
    """A word of a reason; reasons that differ in figures alone are counted together."""
    return "N" if any(letter.isdigit() for letter in word) else word


def view(name: str, size: str, seed: int, k: int) -> tuple[Answer, Answer]:
    """What both say of a view of a row."""
    cv2.setNumThreads(1)
    camera = CAMERAS[size]
    row = ROWS[name]
    taken = picture(row, camera, (seed, k))
    return ours(taken.image, camera, taken.X_SC, row.center_off), opencv(
        taken.image, camera, taken.X_SC
    )


def negative(name: str, size: str, seed: int, k: int) -> Answer:
    """What we say of a picture in which the board is not."""
    cv2.setNumThreads(1)
    camera, board = CAMERAS[size], OTHERS[name]
    row = Row() if board is not None else Row(covered=0.999, hand=False)
    taken = picture(row, camera, (seed, 1, k), board or BOARD)
    return ours(taken.image, camera, taken.X_SC)


def printed_row(name: str, size: str, answers: list[tuple[Answer, Answer]]) -> None:
    """Prints a row of the table."""
    us, them = zip(*answers, strict=True)
    beside = [a.valid for a, b in answers if b.valid]
    for label, found in (("ours", us), ("OpenCV", them)):
        valid = [a for a in found if a.valid]
        columns = f"{name if label == 'ours' else '':16}{size:>9} {label:7}"
        columns += f"{len(valid):4}/{len(found):<4}"
        columns += f"{np.mean(beside):6.0%}" if label == "ours" and beside else f"{'':6}"
        if valid:
            for values in ([a.position for a in valid], [a.rotation for a in valid]):
                columns += "{:9.3f}{:9.3f}".format(*np.quantile(values, [0.5, 0.95]))
            columns += f"{max(a.position for a in valid):9.1f}"
            if label == "ours":
                normalised, shift = (
                    np.array([getattr(a, key) for a in valid]) for key in ("normalised", "shift")
                )
                bad = sum(a.most > MOST_ERROR for a in valid)
                columns += f"{np.sqrt(normalised.mean() / 6):7.2f}{np.sqrt(shift.mean() / 3):7.2f}"
                columns += f"{bad:6}"
            else:
                columns += f"{'':20}"
        else:
            columns += f"{'':65}"
        print(columns + f"{np.median([a.milliseconds for a in found]):7.1f}", flush=True)
    for reason, count in Counter(a.reason for a in us if not a.valid).most_common():
        print(f"{'':26}{count:4} refused: {reason}", flush=True)


def main() -> None:
    """Runs the benchmark."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--rows", nargs="+", choices=ROWS, default=list(ROWS), metavar="NAME")
    parser.add_argument("--views", type=int, default=20, help="of each row and size")
    parser.add_argument("--size", nargs="+", choices=CAMERAS, default=["640x480"])
    parser.add_argument("--jobs", type=int, default=1)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--negatives", type=int, metavar="N", help="pictures of each kind, no rows")
    arguments = parser.parse_args()
    with ProcessPoolExecutor(arguments.jobs, mp_context=get_context("spawn")) as pool:
        if arguments.negatives is not None:
            _print_negatives(arguments, pool)
        else:
            _print_rows(arguments, pool)


def _print_rows(arguments: argparse.Namespace, pool: ProcessPoolExecutor) -> None:
    print(
        f"{'':33}{'valid':^9}{'of cv':>6}{'mm':>9}{'95 %':>9}{'deg':>9}{'95 %':>9}{'worst':>9}"
        f"{'sigma':>7}{'shift':>7}{'>5 sd':>6}{'ms':>7}"
    )
    for name, size in _each(arguments.rows, arguments.size):
        answers = pool.map(partial(view, name, size, arguments.seed), range(arguments.views))
        printed_row(name, size, list(answers))


def _print_negatives(arguments: argparse.Namespace, pool: ProcessPoolExecutor) -> None:
    for name, size in _each(list(OTHERS), arguments.size):
        answers = list(
            pool.map(partial(negative, name, size, arguments.seed), range(arguments.negatives))
        )
        print(f"{name:30}{size:>9} valid {sum(a.valid for a in answers)}/{len(answers)}")
        for reason, count in Counter(a.reason for a in answers if not a.valid).most_common():
            print(f"{'':26}{count:4} refused: {reason}", flush=True)


def _each(names: list[str], sizes: list[str]) -> Iterator[tuple[str, str]]:
    return ((name, size) for name in names for size in sizes)


if __name__ == "__main__":
    main()
