"""Estimate the pose of a camera over a board from one image."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from burg_drake.cameras.intrinsics import Intrinsics
from burg_drake.cameras.pose.board_estimate import BoardEstimate
from burg_drake.cameras.pose.coarse_pose import CoarsePose, estimate_coarse_pose
from burg_drake.cameras.pose.edge_measurement import marker_edges, pose_difference
from burg_drake.cameras.pose.edge_refinement import EdgeRefinement, EdgeRound, RefinedPose
from burg_drake.cameras.pose.marker_detection import (
    MIN_FOREIGN_MARKERS,
    Detection,
    MarkerDetector,
    format_marker_count,
    misplaced_reason,
    no_markers_reason,
)
from burg_drake.cameras.pose.sheet_deviations import (
    MIN_SCALE_DEVIATION,
    implausible_reason,
    print_doubt,
    scale_by_depth,
    scale_by_height,
    wrong_marker_size,
)
from burg_drake.cameras.pose.wrong_board import WrongBoardCheck
from burg_drake.core import (
    Array,
    Bytes,
    Indices,
    InvalidInputError,
    Single,
    rotation_angle,
    srgb_to_linear,
)
from burg_drake.scene import Board


class BoardPose:
    """Estimates poses of one camera over one board.

    Making its tables takes some milliseconds; reuse it for successive images.

    Args:
        board: the board.
        intrinsics: of the camera.
        scale: size of the print relative to the document along x and y, if measured. The origin
            of S stays in the corner of the sheet.
    """

    def __init__(
        self, board: Board, intrinsics: Intrinsics, scale: tuple[float, float] = (1.0, 1.0)
    ) -> None:
        if min(scale) <= 0.0:
            raise InvalidInputError(f"scale {list(scale)} of a print must be positive")
        self.board = board
        self.intrinsics = intrinsics
        self.scale = scale
        self._layout = board.layout
        self._p_SQ = self._layout.p_SQ * [*scale, 1.0]
        self._detector = MarkerDetector(self._layout)
        self._edges = marker_edges(self._layout, scale)
        self._refinement = EdgeRefinement(self._edges, self._p_SQ, intrinsics)
        self._wrong_board = WrongBoardCheck(board, intrinsics, scale)

    def estimate(
        self,
        image: Bytes,
        *,
        depth: NDArray[np.floating[Any]] | None = None,
        X_SC_known: Array | None = None,
    ) -> BoardEstimate:
        """Estimates the pose.

        Args:
            image: (H, W), RGB (H, W, 3) or RGBA (H, W, 4).
            depth: (H, W) depth image of the same camera [m], to measure the print's size.
            X_SC_known: (4, 4) known pose of the camera, also to measure the print's size.

        Raises:
            InvalidInputError: the image is none, or has another size than the intrinsics.
        """
        grey = grey_image(image)
        self.intrinsics.require_size(grey.shape[1], grey.shape[0], "the image")
        if depth is not None and np.shape(depth) != grey.shape:
            raise InvalidInputError(
                f"the depth image has shape {np.shape(depth)}, but the image {grey.shape}; give"
                " images of the same camera"
            )
        try:
            return self._estimate_coarse_to_fine(grey, _untinted_light(image), depth, X_SC_known)
        except (np.linalg.LinAlgError, cv2.error):  # a degenerate view, such as one line of edges
            return BoardEstimate(reason="the visible part of the board does not determine a pose")

    def _estimate_coarse_to_fine(
        self,
        grey: Bytes,
        light: Single,
        depth: NDArray[np.floating[Any]] | None,
        X_SC_known: Array | None,
    ) -> BoardEstimate:
        """Detects markers and estimates the pose from corners, then edges."""
        seen = self._detector.detect(grey)
        if len(seen.duplicated) >= MIN_FOREIGN_MARKERS:
            # It is unknown on which of the sheets the objects belong.
            return BoardEstimate(
                reason=f"two copies of this board in sight: {len(seen.duplicated)} markers appear"
                " twice; remove or cover one of them"
            )
        if not len(seen.index):
            reason = self._mirrored_reason(grey, seen)
            return BoardEstimate(
                reason=reason or no_markers_reason(grey, self._layout, seen.candidates)
            )
        coarse = estimate_coarse_pose(self._p_SQ[seen.index], seen.corners, self.intrinsics)
        wrong = self._copy_reason(seen, coarse) or self._other_board_reason(seen, coarse)
        if wrong:
            return BoardEstimate(reason=self._mirrored_reason(grey, seen) or wrong)
        found = seen.index[coarse.inliers]
        refined, wrong = self._refine(light, coarse.X_SC, found, seen.corners[coarse.inliers])
        if refined is None:
            return BoardEstimate(reason=self._mirrored_reason(grey, seen) or wrong)
        wrong = self._wrong_print_reason(refined)
        if wrong:
            return BoardEstimate(reason=wrong)
        return self._build_estimate(grey, light, refined, depth, X_SC_known)

    def _refine(
        self,
        light: Single,
        poses: list[Array],
        found: Indices,
        corners: Array,
    ) -> tuple[RefinedPose | None, str]:
        """The pose that fits the edges best, or the reason why there is none."""
        max_same_turn = 0.01  # Radians. Poses that differ by less are the same.
        attempts = [self._refinement.refine(light, X_SC, found, corners) for X_SC in poses]
        rounds = sorted((r for r in attempts if r), key=lambda r: self._median_residual(r, found))
        if not rounds:
            return None, (
                "the edges of the markers are not clear enough; improve focus, contrast or light"
            )
        best = self._refinement.with_disturbance(light, rounds[0])
        turn = 0.0
        if len(rounds) > 1:
            one, other = (r.X_SC[:3, :3] for r in rounds[:2])
            turn = float(rotation_angle(one.T @ other))
        if turn > max_same_turn and not self._is_clearly_better(rounds[0], rounds[1], found):
            # Radians. Poses that differ by less are merged with a larger covariance.
            if turn > 0.03:
                return None, (
                    f"{format_marker_count(len(found))} in sight: two poses fit equally well; move"
                    " closer or show more of the board"
                )
            step = pose_difference(best.X_SC, rounds[1].X_SC)
            best = replace(best, covariance=best.covariance + np.outer(step, step))
        position_sd = np.sqrt(np.linalg.eigvalsh(best.covariance[3:, 3:])[-1])
        max_position_sd = (
            0.05
            * np.linalg.norm(  # a fraction of the distance from the board
                best.X_SC[:3, 3] - self._p_SQ[found].mean(axis=(0, 1))
            )
        )
        if position_sd > max_position_sd:
            return None, (
                f"{format_marker_count(len(found))} in sight: the position of the camera is only"
                f" known to {1e3 * position_sd:.0f} mm; move closer or show more of the board"
            )
        own = np.isin(self._edges.marker[best.views.which], found)
        # Fraction of the read markers' edges that must be seen.
        if (best.weight[own] > 0.0).mean() < 0.3:
            return None, "the cells of the markers do not match their corners: is it another board?"
        return best, ""

    def _is_clearly_better(self, best: EdgeRound, second: EdgeRound, found: Indices) -> bool:
        """Whether the edges of the detected markers clearly fit the first pose better than the
        second.
        """
        # For one marker. Wrong poses fitted up to 0.6 worse in 92 test images.
        ratio = 1.0 + 0.7 / len(found)
        return self._median_residual(second, found) > ratio * self._median_residual(best, found)

    def _median_residual(self, last: EdgeRound, found: Indices) -> float:
        """Median residual of the detected markers' edges [pixels]."""
        own = np.isin(self._edges.marker[last.views.which], found)
        return float(np.median(np.abs(last.residual[own])))

    def _build_estimate(
        self,
        grey: Bytes,
        light: Single,
        refined: RefinedPose,
        depth: NDArray[np.floating[Any]] | None,
        X_SC_known: Array | None,
    ) -> BoardEstimate:
        """Builds the estimate of a refined pose."""
        wrong = self._wrong_board.describe_foreign_markers(grey, light, refined.X_SC)
        if wrong:
            return BoardEstimate(reason=wrong)
        used, corners, error = self._seen_corners(refined)
        p_SQ = self._p_SQ[used]
        scale = float("nan")
        if depth is not None:
            scale = scale_by_depth(p_SQ, self.intrinsics, refined.X_SC, depth)
        if X_SC_known is not None:
            scale = scale_by_height(refined.X_SC, X_SC_known)
        if abs(scale - 1.0) > MIN_SCALE_DEVIATION:
            # A wrong print size makes distances wrong by the same ratio.
            reason = (
                f"the board is printed at {scale:.3g} of its size: print it at 100 %, or give the"
                " measured lengths of its rulers"
            )
            return BoardEstimate(reason=reason, scale=scale)
        blank = ""
        if len(used):
            blank = self._wrong_board.describe_blank_line(light, refined.X_SC, used)
        return BoardEstimate(
            X_SC=refined.X_SC,
            valid=True,
            reason=blank or print_doubt(refined.disturbance) or _residual_doubt(error),
            reprojection_error=error,
            covariance=refined.covariance,
            ids=tuple(int(i) for i in self._layout.ids[used]),
            corners=corners,
            scale=scale,
        )

    def _seen_corners(self, refined: RefinedPose) -> tuple[Indices, Array, float]:
        """Used markers, their corners (N, 4, 2) by their measured edges, and the root mean square
        reprojection error [pixels].
        """
        marker = self._edges.marker[refined.views.which]
        count = np.bincount(marker[refined.weight > 0.0], minlength=len(self._p_SQ))
        G, g = refined.shift_equations(self._edges)
        # A used marker shows 6 edges at least.
        used = np.flatnonzero((count >= 6) & (np.linalg.cond(G) < 1e3))
        shift = np.linalg.solve(G[used], g[used][..., None])[..., 0]
        p_C = (self._p_SQ[used] - refined.X_SC[:3, 3]) @ refined.X_SC[:3, :3]
        error = float(np.sqrt((shift**2).sum(axis=1).mean())) if len(used) else float("nan")
        return used, self.intrinsics.project(p_C) + shift[:, None], error

    def _mirrored_reason(self, grey: Bytes, seen: Detection) -> str:
        """Reason if more markers can be read in the mirrored image, else empty."""
        if seen.candidates < MIN_FOREIGN_MARKERS:
            return ""
        mirrored = self._detector.detect(np.ascontiguousarray(grey[:, ::-1]))
        # Markers in the mirrored image; two may be read by chance.
        if mirrored.count < max(4, len(seen.index) + 1):
            return ""
        return (
            f"the image is mirrored: {mirrored.count} markers of the board can be read in the"
            " flipped image; turn off mirroring in the camera's settings or driver"
        )

    def _copy_reason(self, seen: Detection, coarse: CoarsePose) -> str:
        """Reason why there are two boards: markers beside the board belong to a second print of it
        or to a larger board; else empty.
        """
        min_copy_markers = 3  # Markers of a second print of the board.
        rest = ~coarse.inliers
        if not coarse.X_SC or rest.sum() < min_copy_markers:
            return ""
        places, corners = self._p_SQ[seen.index[rest]], seen.corners[rest]
        copy = estimate_coarse_pose(places, corners, self.intrinsics)
        if not copy.X_SC or copy.inliers.sum() < min_copy_markers:
            return ""
        # A larger board's markers would be on this board's grid; so two sheets lie side by side.
        rays = self.intrinsics.rays(corners[copy.inliers].mean(axis=1)) @ coarse.X_SC[0][:3, :3].T
        at = coarse.X_SC[0][:2, 3] - coarse.X_SC[0][2, 3] * rays[:, :2] / rays[:, 2:]
        low, high = self._p_SQ.min(axis=(0, 1))[:2], self._p_SQ.max(axis=(0, 1))[:2]
        if ((at > low) & (at < high)).all(axis=1).any():
            return ""
        return (
            f"two copies of this board in sight, or another board: {int(coarse.inliers.sum())} of"
            f" {format_marker_count(len(seen.index))} are where this one has them, and {len(at)}"
            " fit beside it; remove or cover one copy, or correct columns, rows and first_id"
        )

    def _other_board_reason(self, seen: Detection, coarse: CoarsePose) -> str:
        """Reason why the detected markers belong to another board, else empty."""
        deviation = abs(coarse.marker_scale - 1.0)
        # Overexposure shifts sides by a pixel.
        if deviation > 0.05 and deviation * _median_side(seen.corners) / 2.0 > 1.5:
            return self._other_size_reason(coarse.marker_scale)
        n, fit = len(seen.index), int(coarse.inliers.sum())
        if not coarse.X_SC or fit < max(1, n / 2) or (n > 1 and fit < 2):
            return misplaced_reason(n, fit)
        return ""

    def _wrong_print_reason(self, refined: RefinedPose) -> str:
        """Reason why the print is of another board, else empty."""
        at = self.intrinsics.project((self._p_SQ - refined.X_SC[:3, 3]) @ refined.X_SC[:3, :3])
        used = np.unique(self._edges.marker[refined.views.which[refined.weight > 0.0]])
        marker_scale = wrong_marker_size(refined.disturbance, _median_side(at[used]))
        if marker_scale != 1.0:
            return self._other_size_reason(marker_scale)
        return implausible_reason(refined.disturbance)

    def _other_size_reason(self, marker_scale: float) -> str:
        markers = self.board.markers
        return (
            f"another board: its markers are {marker_scale:.2f} times as large, relative to their"
            f" spacing, as those of this one (side {1e3 * markers.side:g} mm, spacing"
            f" {1e3 * markers.spacing:g} mm)"
        )


def estimate_board(
    image: Bytes,
    intrinsics: Intrinsics,
    board: Board,
    *,
    depth: NDArray[np.floating[Any]] | None = None,
    X_SC_known: Array | None = None,
) -> BoardEstimate:
    """The pose of a camera over a board, from one image; see `BoardPose.estimate`."""
    return BoardPose(board, intrinsics).estimate(image, depth=depth, X_SC_known=X_SC_known)


def _untinted_light(image: Bytes) -> Single:
    """(H, W) linear light of the lightest channel, in which the tints of a height map printed below
    the markers look white.
    """
    image = np.asarray(image)
    if image.ndim == 2:
        return srgb_to_linear(np.ascontiguousarray(image))
    red, green, blue = cv2.split(image[..., :3])
    return srgb_to_linear(cv2.max(red, cv2.max(green, blue)))


def grey_image(image: Bytes) -> Bytes:
    """(H, W) brightness of an image (H, W), RGB (H, W, 3) or RGBA (H, W, 4).

    Raises:
        InvalidInputError: it is of another shape or type.
    """
    image = np.asarray(image)
    if image.dtype != np.uint8 or image.ndim not in (2, 3):
        raise InvalidInputError(
            f"the image has shape {image.shape} and type {image.dtype}; expected (H, W), (H, W, 3)"
            " or (H, W, 4) uint8"
        )
    if image.ndim == 2:
        return np.ascontiguousarray(image)
    codes = {3: cv2.COLOR_RGB2GRAY, 4: cv2.COLOR_RGBA2GRAY}
    if image.shape[2] not in codes:
        raise InvalidInputError(f"the image has {image.shape[2]} channels; expected 3 or 4")
    return np.asarray(cv2.cvtColor(np.ascontiguousarray(image), codes[image.shape[2]]))


def _median_side(corners: Array) -> float:
    """Median length of the sides of markers (N, 4, 2) [pixels]."""
    return float(np.median(np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2)))


def _residual_doubt(error: float) -> str:
    """Describes a too large reprojection error; empty if it is small."""
    if error > 0.3:  # Pixels. With more, intrinsics are wrong or the board is not flat.
        return (
            f"markers are off by {error:.1f} pixels on average: check the intrinsics, and that the"
            " board is flat"
        )
    return ""
