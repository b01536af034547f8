"""Rotational symmetries of a surface, within a tolerance."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import trimesh
from numpy.typing import NDArray
from scipy.spatial import cKDTree
from scipy.spatial.transform import Rotation
from trimesh.triangles import closest_point

from burg_drake.core import Array, rot_z

SURFACE_POINTS = 16000  # Points that represent the surface.
PROBE_POINTS = 1000  # Points that are rotated and compared.
COARSE_POINTS = 100  # Points of the first comparison.
NORMAL_WEIGHT = 0.025  # Share of the diagonal per unit difference of normals.
FIRST_SEARCH_ANGLES = 72  # Angles about an axis in the first search.


@dataclass(frozen=True, eq=False)
class Symmetries:
    """Rotations about a point that take an object onto itself.

    Attributes:
        rotations: (N, 3, 3) rotations in O, the identity first; for a body of revolution one of
            each kind.
        axis: (3,) unit vector; any rotation about it is a symmetry. None if there is no such axis.
        sphere: any rotation is a symmetry.
    """

    rotations: Array
    axis: Array | None = None
    sphere: bool = False

    def images(self, direction: Array, towards: Array) -> Array:
        """Images of a direction under the symmetries.

        Args:
            direction: (3,) unit vector of O.
            towards: (3,) unit vector; of all rotations about `axis`, the one whose image is nearest
                to it is used.

        Returns:
            (M, 3) unit vectors.
        """
        if self.sphere:
            return towards[None]
        turned = self.rotations @ direction
        if self.axis is None:
            return turned
        across = towards - (towards @ self.axis) * self.axis
        length = float(np.linalg.norm(across))
        if length < 1e-9:
            return turned
        along = turned @ self.axis
        radius = np.sqrt(np.maximum(1.0 - along**2, 0.0))
        return along[:, None] * self.axis + radius[:, None] * across / length

    def maps_close(self, a: Array, b: Array, max_angle: float) -> bool:
        """Whether a symmetry takes direction a (3,) to within `max_angle` [rad] of b (3,)."""
        return bool((self.images(a, b) @ b).max() >= np.cos(max_angle))


class SymmetrySearch:
    """Finds the rotations that take a surface onto itself.

    Args:
        surface: surface in O [m].
        p_OC: (3,) fixed point of all rotations, such as the centre of mass [m].
        tolerance: largest deviation that counts as equal [m]; if None, 0.2 mm, or 0.5 % of the
            diagonal if that is less.
        covered: share of the surface that must be within the tolerance.

    Attributes:
        tolerance: largest deviation that counts as equal [m].
    """

    def __init__(
        self,
        surface: trimesh.Trimesh,
        p_OC: Array,
        tolerance: float | None = None,
        covered: float = 0.98,
    ) -> None:
        max_deviation = 2e-4  # Metres; poses whose surfaces differ by more are two poses.
        max_deviation_share = 0.005  # Over the object's diagonal; the smaller limit holds.
        self._triangles = np.asarray(surface.triangles) - p_OC
        self.diagonal = float(np.linalg.norm(np.ptp(self._triangles.reshape(-1, 3), axis=0)))
        default_tolerance = min(max_deviation, max_deviation_share * self.diagonal)
        self.tolerance = default_tolerance if tolerance is None else tolerance
        self._covered = covered
        points, face = spread_samples(surface, SURFACE_POINTS)
        self._sample = points - p_OC
        order = _evenly_spread_order(SURFACE_POINTS)[:: SURFACE_POINTS // PROBE_POINTS]
        normals = _triangle_normals(self._triangles)
        self._probe, self._probe_normals = self._sample[order], normals[face[order]]
        # triangles too small to have a sample are represented by their centres
        self._face = np.concatenate([face, np.arange(len(self._triangles))])
        self._points = np.vstack([self._sample, self._triangles.mean(axis=1)])
        self._normals = normals[self._face]
        weight = NORMAL_WEIGHT * self.diagonal
        self._tree = cKDTree(np.hstack([self._points, weight * self._normals]))

    def find(self) -> Symmetries:
        """All symmetries of the surface, computed once. Their order depends only on the surface."""
        return self._symmetries

    @cached_property
    def _symmetries(self) -> Symmetries:
        equal_moments = 0.02  # Relative difference below which moments give no axes.
        radius = np.linalg.norm(self._points, axis=1)
        if np.ptp(radius) <= 2.0 * self.tolerance:
            return Symmetries(np.eye(3)[None], sphere=True)
        moments, axes = np.linalg.eigh(_second_moments(self._triangles))
        unequal = [bool(moments[k + 1] - moments[k] > equal_moments * moments[2]) for k in range(2)]
        pairs = [(axis, sign * axis) for axis in axes.T for sign in (1.0, -1.0)]
        candidates = list(axes.T)
        if not any(unequal):
            far = self._farthest_directions()
            pairs = [(far[0], b) for b in far]
            candidates += far
        axis = next((a for a in candidates if self.turns_about(a)), None)
        if axis is not None:
            pairs = [(axis, -axis)]
        found = [np.eye(3)]
        for a, b in pairs:
            for R in self._candidate_rotations(a, b):
                if _is_known_rotation(R, found):
                    continue
                refined = self._refine_rotation(R)
                if refined is None or _is_known_rotation(refined, found) or not self.fits(refined):
                    continue
                if axis is not None:
                    return Symmetries(np.stack([np.eye(3), refined]), axis)
                found = self._close_group([*found, refined])
        return Symmetries(np.stack(found), axis)

    def turns_about(self, axis: Array) -> bool:
        """Whether the surface is a surface of revolution about an axis (3,) through the fixed
        point."""
        # Shares of a full turn; no multiples of one another, so prisms fail.
        turn_shares = (0.0382, 0.1459, 0.2361, 0.3090, 0.4271)
        return all(
            self.fits(Rotation.from_rotvec(2.0 * np.pi * share * axis).as_matrix())
            for share in turn_shares
        )

    def fits(self, R: Array) -> bool:
        """Whether a rotation (3, 3) maps the surface onto itself."""
        few = self._share_within_tolerance(R, COARSE_POINTS)
        if not few > self._covered - 0.1:
            return False
        return self._share_within_tolerance(R, PROBE_POINTS) >= self._covered

    def _farthest_directions(self) -> list[Array]:
        """Unit vectors to the farthest corners, farthest first, without near-duplicates.

        The farthest point of a surface is a corner. A symmetry takes it to a corner at the same
        distance, within the tolerance.
        """
        same_angle = np.deg2rad(8.0)  # Radians below which two directions are one.
        max_directions = 12  # Directions to the most distant corners that are tried.
        corners = self._triangles.reshape(-1, 3)
        radius = np.linalg.norm(corners, axis=1)
        far = np.flatnonzero(radius >= radius.max() - self.tolerance)
        far = far[np.argsort(-radius[far], kind="stable")]
        left = corners[far] / radius[far, None]
        directions: list[Array] = []
        while len(left) and len(directions) < max_directions:
            directions.append(left[0])
            left = left[left @ left[0] < np.cos(same_angle)]
        return directions

    def _share_within_tolerance(self, R: Array, count: int) -> float:
        """Share of the first `count` points that R (3, 3) takes to within the tolerance."""
        candidates = 8  # Points of the surface whose triangles are compared.
        turned, facing = self._probe[:count] @ R.T, self._probe_normals[:count] @ R.T
        index = self._nearest(turned, facing, candidates)
        corners = self._triangles[self._face[index]].reshape(-1, 3, 3)
        foot = closest_point(corners, np.repeat(turned, candidates, axis=0))
        gaps = np.linalg.norm(foot.reshape(-1, candidates, 3) - turned[:, None], axis=2)
        alike = np.einsum("ij,ikj->ik", facing, self._normals[index]) > 0.0
        near = (alike & (gaps <= self.tolerance)).any(axis=1)
        return float(near.mean())

    def _candidate_rotations(self, a: Array, b: Array) -> Iterator[Array]:
        """Rotations (3, 3) that take direction a to b, those whose area profiles fit best first."""
        max_angles = 8  # Angles about an axis that are refined.
        profile_a, profile_b = self._area_profile(a), self._area_profile(b)
        shape_a, shape_b = profile_a.sum(axis=0), profile_b.sum(axis=0)
        if np.abs(shape_a - shape_b).sum() > 0.5 * shape_a.sum():
            return
        match = np.fft.irfft(
            (np.fft.rfft(profile_b, axis=0) * np.conj(np.fft.rfft(profile_a, axis=0))).sum(axis=1),
            FIRST_SEARCH_ANGLES,
        )
        R_Ba, R_Bb = rotation_from_down(a), rotation_from_down(b)
        chosen: list[int] = []
        for k in np.argsort(-match, kind="stable").tolist():
            if all(
                min((k - c) % FIRST_SEARCH_ANGLES, (c - k) % FIRST_SEARCH_ANGLES) > 2
                for c in chosen
            ):
                chosen.append(k)
                yield R_Bb.T @ rot_z(2.0 * np.pi * k / FIRST_SEARCH_ANGLES) @ R_Ba
            if len(chosen) == max_angles:
                return

    def _area_profile(self, down: Array) -> Array:
        """(FIRST_SEARCH_ANGLES, bins) area by azimuth, and by height and radius, about `down`."""
        p = self._sample @ rotation_from_down(down).T
        azimuth = (np.arctan2(p[:, 1], p[:, 0]) / (2.0 * np.pi) % 1.0) * FIRST_SEARCH_ANGLES
        radius = np.hypot(p[:, 0], p[:, 1]) / self.diagonal
        height = p[:, 2] / self.diagonal + 1.0
        bins = (
            azimuth.astype(int) % FIRST_SEARCH_ANGLES,
            np.clip((height * 8).astype(int), 0, 16),
            np.clip((radius * 8).astype(int), 0, 8),
        )
        flat = np.ravel_multi_index(bins, (FIRST_SEARCH_ANGLES, 17, 9))
        return (
            np.bincount(flat, minlength=FIRST_SEARCH_ANGLES * 17 * 9)
            .reshape(FIRST_SEARCH_ANGLES, -1)
            .astype(float)
        )

    def _refine_rotation(self, R: Array) -> Array | None:
        """The rotation near R (3, 3) that maps the surface best onto itself; None if it does not
        fit.

        Iterated closest points, with distances along the normals.
        """
        max_median_share = 0.02  # Median distance over the diagonal; above it the search stops.
        for count, rounds in ((COARSE_POINTS, 8), (PROBE_POINTS // 2, 6)):
            probe, normals = self._probe[:count], self._probe_normals[:count]
            for _ in range(rounds):
                turned = probe @ R.T
                index = self._nearest(turned, normals @ R.T, 1)
                facing = self._normals[index]
                apart = self._points[index] - turned
                slope = np.cross(turned, facing)
                # surfaces that slide along themselves, as a cylinder about its axis, are not turned
                step = np.linalg.lstsq(slope, (apart * facing).sum(axis=1), rcond=1e-3)[0]
                R = Rotation.from_rotvec(step).as_matrix() @ R
                if float(np.linalg.norm(step)) < 1e-5:
                    break
            if np.median(np.linalg.norm(apart, axis=1)) > max_median_share * self.diagonal:
                return None
        return R

    def _nearest(self, points: Array, normals: Array, count: int) -> NDArray[np.int64]:
        """(N,) or (N, count) indices of the nearest points of the surface."""
        weight = NORMAL_WEIGHT * self.diagonal
        return np.asarray(self._tree.query(np.hstack([points, weight * normals]), k=count)[1])

    def _close_group(self, found: Sequence[Array]) -> list[Array]:
        """The rotations and their products, which are symmetries as well."""
        max_rotations = 120  # Rotations kept; polyhedra have at most 60.
        group = list(found)
        for a in group:  # grows meanwhile
            for b in found[1:]:
                if len(group) >= max_rotations:
                    return group
                if _is_known_rotation(b @ a, group):
                    continue
                product = self._refine_rotation(b @ a)
                if (
                    product is not None
                    and not _is_known_rotation(product, group)
                    and self.fits(product)
                ):
                    group.append(product)
        return group


def _second_moments(triangles: Array) -> Array:
    """(3, 3) area-weighted mean of p p^T over triangles (F, 3, 3)."""
    cross = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    area = np.linalg.norm(cross, axis=1)
    total = triangles.sum(axis=1)
    moments = np.einsum("f,fki,fkj->ij", area, triangles, triangles)
    moments += np.einsum("f,fi,fj->ij", area, total, total)
    mean: Array = moments / (12.0 * area.sum())
    return mean


def _is_known_rotation(R: Array, found: Sequence[Array]) -> bool:
    """Whether a rotation is near one of the rotations in `found`."""
    same_angle = np.deg2rad(3.0)  # Radians below which two rotations are one.
    traces = np.einsum("kij,ij->k", np.stack(found), R)
    return bool(traces.max() >= 1.0 + 2.0 * np.cos(same_angle))


def sample_surface(surface: trimesh.Trimesh, count: int) -> tuple[Array, Array]:
    """Points (count, 3) spread evenly over a surface, and their normals; deterministic."""
    points, face = spread_samples(surface, count)
    order = _evenly_spread_order(count)
    return points[order], _triangle_normals(np.asarray(surface.triangles))[face][order]


def _evenly_spread_order(count: int) -> NDArray[np.int64]:
    """(count,) permutation in which every run is spread evenly over the whole range."""
    return np.argsort((np.arange(count) * 0.6180339887498949) % 1.0, kind="stable")


def _triangle_normals(triangles: Array) -> Array:
    """(F, 3) unit normals of triangles (F, 3, 3); zero where one has no area."""
    cross = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    normals: Array = cross / np.maximum(np.linalg.norm(cross, axis=1), 1e-300)[:, None]
    return normals


def spread_samples(surface: trimesh.Trimesh, count: int) -> tuple[Array, NDArray[np.int64]]:
    """Points (count, 3) spread evenly over a surface, in the order of its triangles, and their
    triangle indices (count,); deterministic.

    Systematic sampling by area, with the points of each triangle from the R2 sequence.
    """
    triangles = np.asarray(surface.triangles)
    cross = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    edges = np.cumsum(np.linalg.norm(cross, axis=1))
    at = (np.arange(count) + 0.5) / count * edges[-1]
    face = np.minimum(np.searchsorted(edges, at), len(triangles) - 1)
    uv = (np.arange(1, count + 1)[:, None] * (0.7548776662466927, 0.5698402909980532)) % 1.0
    uv = np.where(uv.sum(axis=1, keepdims=True) > 1.0, 1.0 - uv, uv)
    t = triangles[face]
    return t[:, 0] + uv[:, :1] * (t[:, 1] - t[:, 0]) + uv[:, 1:] * (t[:, 2] - t[:, 0]), face


def rotation_from_down(down: Array) -> Array:
    """(3, 3) rotation whose third row is -`down`: takes vectors of O to a frame with z up."""
    up = -down
    x = np.cross(up, np.eye(3)[int(np.abs(up).argmin())])
    x /= np.linalg.norm(x)
    return np.stack([x, np.cross(up, x), up])
