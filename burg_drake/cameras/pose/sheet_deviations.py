"""Deviations of a printed sheet from its document, and their effect on the pose.

A page may be glued beside its place, the sheet may bulge, the print may be longer along one
axis, and a camera may move while its rows are exposed. `print_doubt` reports them.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from burg_drake.cameras.intrinsics import Intrinsics
from burg_drake.cameras.pose.edge_measurement import MIN_VISIBLE_DEPTH, EdgeViews
from burg_drake.core import Array, Indices

MARKER_SIGMAS_PX = 0.006, 0.02, 0.06, 0.2
"""Standard deviations that are tried for shifts of single markers by unmodelled errors [pixels].
The first one suits images without noise.
"""
MIN_MODE_VARIANCE = 1e-3
"""Variance of a pattern, as a fraction of the strongest one's."""
SHIFT_SIGMAS: dict[str, tuple[float, ...]] = {
    "rows": (0.8, 4.0),
    "aspect": (0.01,),
    "size": (0.01,),
    "in_plane": (1.5e-4, 6e-4, 2e-3),
    "out_of_plane": (4e-4, 1.5e-3, 4e-3),
}
"""Standard deviations that are tried: rows in pixels, ratios, pages and heights in metres."""


@dataclass(frozen=True)
class MarkerShifts:
    """Standard deviations of marker shifts by cause; 0 for an absent cause.

    Attributes:
        marker: of shifts of single markers [pixels].
        in_plane: of shifts along the sheet [m].
        out_of_plane: of the sheet's height [m].
        rows: of the camera's motion while the image's rows are exposed [pixels].
        aspect: of the ratio of the print's length along y to that along x [-].
        size: of the ratio of the markers' size to their distances [-].
    """

    marker: float = MARKER_SIGMAS_PX[0]
    in_plane: float = 0.0
    out_of_plane: float = 0.0
    rows: float = 0.0
    aspect: float = 0.0
    size: float = 0.0


@dataclass(frozen=True, eq=False)
class Disturbance:
    """A correction of a pose that accounts for marker shifts.

    Attributes:
        step: (6,) from the pose at which the edges were measured, see `perturbed_pose`.
        covariance: (6, 6) of the step.
        shifts: standard deviations of the shifts.
        in_plane: largest shift of a visible marker along the sheet [m]. This and the following
            shifts are 0 where the residuals do not show them beyond chance.
        out_of_plane: largest height of a visible marker [m].
        rows: root mean square motion of markers from the first to the last row of the image
            [pixels].
        aspect: excess length of the print along y over x [-].
        size: excess size of the markers relative to their distances [-].
        mean_square_aspect: expected square of the excess length along y over x, whether `aspect`
            is reported or 0 [-].
        residual: (N,) offsets of all edges minus the most probable shifts [pixels].
    """

    step: Array
    covariance: Array
    shifts: MarkerShifts
    in_plane: float
    out_of_plane: float
    rows: float
    aspect: float
    size: float
    mean_square_aspect: float
    residual: Array


class SheetModes:
    """Independent shift patterns of a board's edges. The first few explain nearly all variance.

    The frame S of a sheet with errors is the frame that fits all its markers best. So a pattern
    neither shifts nor turns the whole sheet.

    Attributes:
        middle: (2,) middle of the markers [m].
        in_plane: (N, 2, K) patterns of shifts along x and y, of unit variance.
        out_of_plane: (N, L) patterns of heights, of unit variance.
    """

    def __init__(self, p_SQ: Array, p_SE: Array) -> None:
        """Takes the markers' corners (M, 4, 3) and the edges' middles (N, 3) [m]."""
        center = p_SQ.mean(axis=1)
        n = len(center)
        self.middle = center[:, :2].mean(axis=0)
        x, y = (center[:, :2] - self.middle).T
        one, zero = np.ones(n), np.zeros(n)
        moved = np.stack([[one, zero], [zero, one], [-y, x]], axis=-1)  # (2, n, 3)
        # Metres within which shifts along the sheet are correlated: half an A4 page.
        alike, between = _correlated_covariance(center, p_SE, 0.15)
        along_both = np.asarray(np.kron(alike, np.eye(2)), dtype=float)
        modes = _covariance_modes(along_both, moved.transpose(1, 0, 2).reshape(2 * n, 3))
        self.in_plane = np.tensordot(between, modes.reshape(n, 2, -1), axes=1)
        # Corners, not only middles: a curling sheet rises most beyond the outermost middles.
        corners = p_SQ.reshape(-1, 3)
        # Metres within which heights are correlated.
        alike, between = _correlated_covariance(corners, p_SE, 0.14)
        plane = np.column_stack([np.ones(len(corners)), corners[:, :2] - self.middle])
        self.out_of_plane = between @ _covariance_modes(alike, plane)


def _correlated_covariance(points: Array, p_SE: Array, within: float) -> tuple[Array, Array]:
    """(M, M) covariance of shifts of points (M, 3), correlated within a distance [m]; and (N, M)
    interpolation of shifts of edges (N, 3) from the shifts of the points.
    """
    covariance, to_edges = (
        np.exp(-((p[:, None] - points) ** 2).sum(axis=-1) / (2.0 * within**2))
        for p in (points, p_SE)
    )
    known = covariance + MIN_MODE_VARIANCE * np.eye(len(points))
    return covariance, np.linalg.solve(known, to_edges.T).T


def _covariance_modes(covariance: Array, whole: Array) -> Array:
    """(N, K) independent modes of a covariance (N, N) without common motions `whole` (N, 3)."""
    Q, _ = np.linalg.qr(whole)
    rest = np.eye(len(covariance)) - Q @ Q.T
    variance, patterns = np.linalg.eigh(rest @ covariance @ rest)
    # At most 40 patterns of a kind of shift.
    kept = np.flatnonzero(variance > MIN_MODE_VARIANCE * variance[-1])[-40:]
    return np.asarray(patterns[:, kept] * np.sqrt(variance[kept]))


@dataclass(frozen=True, eq=False)
class _ShiftSolution:
    """The pose step for assumed standard deviations of the shifts.

    Attributes:
        logarithm: log likelihood of the measurements, up to a constant.
        shifts: assumed standard deviations.
        x: (K,) step of pose and bloom, then amplitudes of the shift patterns.
        covariance: (K, K) of `x`.
        columns: (K,) indices of the columns of the full problem that are used.
    """

    logarithm: float
    shifts: MarkerShifts
    x: Array
    covariance: Array
    columns: Indices


class DisturbanceFit:
    """Fits shifts of markers to the edges of an image.

    Args:
        views: edges as predicted by a pose.
        offset: (N,) offset of each measured edge from the predicted one [pixels].
        information: (N,) inverse variance of each offset by the image's noise, 0 for excluded
            edges.
        marker: (N,) index of each edge's marker.
        modes: patterns of shifts of the sheet.
        height: of the image [pixels].
    """

    def __init__(
        self,
        views: EdgeViews,
        offset: Array,
        information: Array,
        marker: Indices,
        modes: SheetModes,
        height: int,
    ) -> None:
        kept = information > 0.0
        used, belongs = np.unique(marker, return_inverse=True)
        self._kept, self._marker = kept, belongs
        self._normal = views.normal
        self._offset = offset
        # Weighted sums over the edges of each marker.
        self._sums = np.zeros((len(used), len(belongs)))
        self._sums[belongs, np.arange(len(belongs))] = information
        self._sums /= self._variance_ratio_within_markers(views, information)
        self._modes = modes.in_plane[views.which], modes.out_of_plane[views.which]
        J = views.motion
        row = views.at[:, 1:] / height - 0.5
        x, y = modes.middle  # of the stretch: S is the frame that fits best
        strength = np.sqrt((J[kept] ** 2).mean(axis=0)) + 1e-9
        # Pixels. Motion of each edge by the camera's motion from the first row to the last one.
        self._rolling_motion = J / strength / np.sqrt(6.0)
        parts = {
            "pose": np.column_stack([J, views.bloom]),
            "rows": row * self._rolling_motion,
            "aspect": 0.5 * (views.print[:, :1] + (J[:, 3:5] * [-x, y]).sum(axis=1)[:, None]),
            "size": views.print[:, 1:],
            "in_plane": (J[:, None, 3:5] @ self._modes[0])[:, 0],
            "out_of_plane": J[:, 5:] * self._modes[1],
            "center": self._normal,
        }
        ends = np.cumsum([0, *(part.shape[1] for part in parts.values())])
        self._columns = {kind: np.arange(*ends[k : k + 2]) for k, kind in enumerate(parts)}
        self._J = np.column_stack(list(parts.values()))
        self._sum_equations()
        self._equations = {sd: self._normal_equations(sd) for sd in MARKER_SIGMAS_PX}

    def fit(self, prior: Array, center: float = 0.0) -> Disturbance:
        """Finds the most probable shifts and the pose step they imply.

        Args:
            prior: (7, 7) prior information about the step of pose and bloom.
            center: standard deviation of the camera's principal point along u and v [pixels].
        """
        solved = {s: self._solve(s, prior) for s in map(MarkerShifts, MARKER_SIGMAS_PX)}
        best = max(solved.values(), key=lambda s: s.logarithm)
        for _ in range(len(SHIFT_SIGMAS)):
            others = [s for s in _neighbouring_shifts(best.shifts) if s not in solved]
            solved |= {s: self._solve(s, prior) for s in others}
            better = max(solved.values(), key=lambda s: s.logarithm)
            if better is best:
                break
            best = better
        return self._build_disturbance(best, list(solved.values()), center)

    def _shift_equations(self) -> tuple[Array, Array]:
        """(n, 2, 2) normal matrix of each marker's shift, and (n, 2) right-hand sides."""
        G = self._sums @ (self._normal[:, :, None] * self._normal[:, None]).reshape(-1, 4)
        return G.reshape(-1, 2, 2), self._sums @ (self._normal * self._offset[:, None])

    def _variance_ratio_within_markers(self, views: EdgeViews, information: Array) -> float:
        """Ratio of the offsets' variance within markers to the variance by the image's noise."""
        common_motions = np.column_stack([views.motion, views.bloom, views.print])
        rest = residuals_within_markers(
            self._normal, common_motions, self._offset, information, self._marker
        )
        markers = len(np.unique(self._marker[self._kept]))
        freedom = np.count_nonzero(self._kept) - 2 * markers - common_motions.shape[1]
        if freedom < 5:  # too few degrees of freedom for an estimate
            return 1.0
        # Relative to noise; keeps probabilities finite.
        return float(max((information * rest**2).sum() / freedom, 1e-3))

    def _sum_equations(self) -> None:
        """Sum the normal equations over all edges and by marker."""
        G, g = self._shift_equations()
        both = self._sums @ (self._normal[:, :, None] * self._J[:, None]).reshape(len(self._J), -1)
        both = np.concatenate([both.reshape(*g.shape, -1), g[..., None]], axis=2)
        self._G, self._shares = G, both  # (n, 2, 2), (n, 2, K + 1)
        weight = self._sums.sum(axis=0)
        seen = np.column_stack([self._J, self._offset])
        self._squares = (seen * weight[:, None]).T @ seen

    def _normal_equations(self, marker_sd: float) -> tuple[Array, Array, float]:
        """(K, K) and (K,) normal equations of all columns with shifts of single markers, and their
        contribution to the log likelihood.
        """
        inner = self._G + np.eye(2) / marker_sd**2
        a, b, c = inner[:, 0, 0], inner[:, 0, 1], inner[:, 1, 1]
        det = a * c - b * b
        inverse = np.stack([c, -b, -b, a], axis=-1).reshape(-1, 2, 2) / det[:, None, None]
        shares = self._shares.reshape(-1, self._shares.shape[2])
        reduced = self._squares - shares.T @ (inverse @ self._shares).reshape(shares.shape)
        volume = float(np.log(det * marker_sd**4).sum())
        return reduced[:-1, :-1], reduced[:-1, -1], -0.5 * (float(reduced[-1, -1]) + volume)

    def _solve(self, shifts: MarkerShifts, prior: Array) -> _ShiftSolution:
        pose = self._columns["pose"]
        sds = {kind: getattr(shifts, kind) for kind in SHIFT_SIGMAS if getattr(shifts, kind)}
        columns = np.concatenate([pose, *(self._columns[kind] for kind in sds)])
        known = np.repeat(np.array(list(sds.values())), [len(self._columns[kind]) for kind in sds])
        A, b, logarithm = self._equations[shifts.marker]
        A, b = A[np.ix_(columns, columns)], b[columns]
        A[: len(pose), : len(pose)] += prior
        A[range(len(pose), len(A)), range(len(pose), len(A))] += known**-2.0
        covariance = np.linalg.inv(A)
        x = covariance @ b
        logarithm += 0.5 * float(b @ x) - 0.5 * float(np.linalg.slogdet(A)[1])
        penalty_count = sum(
            1 + (sds[k] == SHIFT_SIGMAS[k][-1] and len(SHIFT_SIGMAS[k]) > 1)
            for k in _present_kinds(shifts)
        )
        # A penalty for each kind of shift, twice for the largest standard deviation of a kind.
        logarithm -= float(np.log(known).sum()) + 6.0 * penalty_count
        return _ShiftSolution(logarithm, shifts, x, covariance, columns)

    def _build_disturbance(
        self, best: _ShiftSolution, solved: list[_ShiftSolution], center: float
    ) -> Disturbance:
        """The shifts of the best solution, and the step averaged over all solutions by probability.
        The step assumes the given principal point, so that the pose fits the image with it.
        """
        x = np.zeros(self._J.shape[1])
        x[best.columns] = best.x
        chosen = _present_kinds(best.shifts)
        for kind in SHIFT_SIGMAS:
            without = (s for s in solved if not _present_kinds(s.shifts) - (chosen - {kind}))
            # A kind of shift is reported if it raises the log likelihood by 8.
            if best.logarithm - max(s.logarithm for s in without) < 8.0:
                x[self._columns[kind]] = 0.0
        rows, aspect, size, in_plane, out_of_plane = (
            x[self._columns[kind]] for kind in SHIFT_SIGMAS
        )
        # The division flattens the probabilities: the patterns only approximate a real sheet.
        weight = np.exp((np.array([s.logarithm for s in solved]) - best.logarithm) / 4.0)
        weight /= weight.sum()
        aspects = [s.x[s.columns == self._columns["aspect"][0]].sum() for s in solved]
        steps = np.array([s.x[:6] for s in solved])
        step = weight @ steps
        differences = steps - step
        covariance = np.einsum("s,sij->ij", weight, [s.covariance[:6, :6] for s in solved])
        covariance += (differences * weight[:, None]).T @ differences
        A, _, _ = self._equations[best.shifts.marker]
        by_center = (best.covariance @ A[np.ix_(best.columns, self._columns["center"])])[:6]
        covariance += center**2 * by_center @ by_center.T
        return Disturbance(
            step,
            covariance,
            best.shifts,
            float(np.linalg.norm(self._modes[0][self._kept] @ in_plane, axis=1).max()),
            float(np.abs(self._modes[1][self._kept] @ out_of_plane).max()),
            float(np.sqrt(2.0 * ((self._rolling_motion[self._kept] @ rows) ** 2).mean())),
            float(aspect[0]),
            float(size[0]),
            float(weight @ np.square(aspects)),
            self._offset - self._J[:, best.columns] @ best.x,
        )


def residuals_within_markers(
    normal: Array, common_motions: Array, offset: Array, information: Array, marker: Indices
) -> Array:
    """(N,) edge offsets that neither a shift of each marker nor changes common to all markers
    explain [pixels].

    Args:
        normal: (N, 2) directions of the offsets.
        common_motions: (N, K) motion of the edges by each common change.
        offset: (N,) offsets of the edges [pixels].
        information: (N,) inverse variance of each offset.
        marker: (N,) index of each edge's marker.
    """
    seen = np.column_stack([common_motions, offset])
    n = marker.max() + 1
    G, g = np.zeros((n, 2, 2)), np.zeros((n, 2, seen.shape[1]))
    weighted = information[:, None, None] * normal[:, :, None]
    np.add.at(G, marker, weighted * normal[:, None])
    np.add.at(g, marker, weighted * seen[:, None])
    G += (1e-6 * np.trace(G, axis1=1, axis2=2)[:, None, None] + 1e-9) * np.eye(2)
    seen = seen - np.einsum("ni,nik->nk", normal, np.linalg.solve(G, g)[marker])
    root = np.sqrt(information)
    factors = np.linalg.lstsq(seen[:, :-1] * root[:, None], seen[:, -1] * root, rcond=1e-9)[0]
    return np.asarray(seen[:, -1] - seen[:, :-1] @ factors)


def _present_kinds(shifts: MarkerShifts) -> set[str]:
    return {kind for kind in SHIFT_SIGMAS if getattr(shifts, kind)}


def _neighbouring_shifts(shifts: MarkerShifts) -> Iterator[MarkerShifts]:
    """Variants of shifts in which one kind, or the shift of single markers, differs."""
    for marker_sd in {shifts.marker, MARKER_SIGMAS_PX[0]}:
        for kind, values in SHIFT_SIGMAS.items():
            for value in values:
                yield replace(shifts, marker=marker_sd, **{kind: value})


MIN_SCALE_DEVIATION = 0.01
"""Least deviation of the print's scale that is reported; depth cameras err by as much."""


def wrong_marker_size(found: Disturbance, side: float) -> float:
    """Size of the markers relative to their distances if they belong to another board, as light
    cannot explain that size; 1 otherwise.

    Args:
        found: disturbance in the image.
        side: side of a marker in the image [pixels].
    """
    # Overexposure may shift a marker's outline by half a pixel.
    is_other_board = abs(found.size) > 0.015 and abs(found.size) * side / 2.0 > 0.5
    return 1.0 + found.size if is_other_board else 1.0


def implausible_reason(found: Disturbance) -> str:
    """Explains why no print of the board can look like that; empty if it can."""
    if abs(found.aspect) > 0.05:
        return (
            f"another board, or wrong intrinsics: it is {1.0 + found.aspect:.2f} times as long"
            " along y as along x"
        )
    if found.rows > 10.0 or found.in_plane > 5e-3 or found.out_of_plane > 8e-3:  # Pixels, metres
        return (
            "markers are not where a flat board at rest has them: check the intrinsics and the"
            " light, and that the board is one sheet"
        )
    return ""


def print_doubt(found: Disturbance) -> str:
    """Describes doubts about the print, its flatness, or camera motion; empty if there are none."""
    if abs(found.aspect) > 0.003:
        return (
            f"the board is printed {1.0 + found.aspect:.3f} times as long along y as along x:"
            " measure its rulers and print it again with the measured lengths, or check the"
            " intrinsics"
        )
    if abs(found.size) > 0.01:
        return (
            f"the scale is uncertain: markers look {1.0 + found.size:.3f} times as large, relative"
            " to their spacing: too much light, or another board?"
        )
    if found.rows > 0.5:  # Pixels between first and last row that are reported.
        return (
            f"the camera moved by {found.rows:.1f} pixels during its rolling shutter: hold it"
            " still, or add light"
        )
    if found.in_plane > 2e-4:  # Metres that are reported.
        return (
            f"markers are up to {1e3 * found.in_plane:.1f} mm from their positions in the plane:"
            " check the intrinsics, and that pages are glued exactly"
        )
    if found.out_of_plane > 5e-4:  # Metres that are reported.
        return (
            f"the sheet is up to {1e3 * found.out_of_plane:.1f} mm out of its plane: check the"
            " intrinsics, and that it lies flat"
        )
    return ""


def scale_by_depth(
    p_SQ: Array, intrinsics: Intrinsics, X_SC: Array, depth: NDArray[np.floating[Any]]
) -> float:
    """Size of the printed board relative to the document, from a depth image; NaN with too few
    depths.

    Args:
        p_SQ: (..., 3) points of the board that are in sight [m].
        intrinsics: of the camera and its depth image.
        X_SC: (4, 4) pose that the image gives if the print has the document's size.
        depth: (H, W) distance along the optical axis [m]; 0, NaN or infinite where unknown.
    """
    p_C = (p_SQ.reshape(-1, 3) - X_SC[:3, 3]) @ X_SC[:3, :3]
    p_C = p_C[p_C[:, 2] > MIN_VISIBLE_DEPTH]
    columns, rows = np.rint(intrinsics.project(p_C)).astype(np.intp).reshape(-1, 2).T
    inside = (columns >= 0) & (columns < depth.shape[1]) & (rows >= 0) & (rows < depth.shape[0])
    measured = np.asarray(depth, dtype=float)[rows[inside], columns[inside]]
    ratio = measured / p_C[inside, 2]
    ratio = ratio[np.isfinite(ratio) & (measured > 0.0)]
    return float(np.median(ratio)) if len(ratio) >= 12 else float("nan")  # Corners with a depth.


def scale_by_height(X_SC: Array, X_SC_known: Array) -> float:
    """Size of the printed board relative to the document, from the camera's known height."""
    return float(X_SC_known[2, 3] / X_SC[2, 3])
