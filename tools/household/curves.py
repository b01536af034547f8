"""Polylines that the solids are made of: rounded corners, sections, and frames along a path."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.interpolate import PchipInterpolator

Array = NDArray[np.float64]


def rounded(points: ArrayLike, radii: ArrayLike, steps: int = 4) -> Array:
    """Replace the inner corners of a polyline by circular arcs.

    Args:
        points: (K, D) corners [m], any dimension D.
        radii: K - 2 arc radii [m], one for each inner corner; 0 keeps the corner.
        steps: Straight segments per arc. The arc's points lie on the circle.

    Returns:
        (M, D) points of the rounded polyline, ends unchanged.

    Raises:
        ValueError: An arc does not fit between its neighbours.
    """
    corners = np.asarray(points, dtype=float)
    lengths = np.linalg.norm(np.diff(corners, axis=0), axis=1)
    used = np.zeros(len(lengths))
    out = [corners[0]]
    for i, radius in enumerate(np.asarray(radii, dtype=float), start=1):
        u = (corners[i - 1] - corners[i]) / lengths[i - 1]
        v = (corners[i + 1] - corners[i]) / lengths[i]
        half = 0.5 * np.arccos(np.clip(u @ v, -1.0, 1.0))
        if radius <= 0.0 or np.isclose(half, 0.5 * np.pi):
            out.append(corners[i])
            continue
        tangent = radius / np.tan(half)
        used[i - 1 : i + 1] += tangent
        axis = (u + v) / np.linalg.norm(u + v)
        centre = corners[i] + axis * radius / np.sin(half)
        side = (v - u) / np.linalg.norm(v - u)
        sweep = np.linspace(half - 0.5 * np.pi, 0.5 * np.pi - half, steps + 1)[:, None]
        out.extend(centre + radius * (np.sin(sweep) * side - np.cos(sweep) * axis))
    if np.any(used > lengths + 1e-9):
        raise ValueError(f"corner arcs overlap: {used} [m] used of {lengths} [m]")
    out.append(corners[-1])
    keep = [True, *(np.linalg.norm(np.diff(out, axis=0), axis=1) > 1e-9)]
    return np.array(out)[keep]


def resampled(points: ArrayLike, count: int) -> Array:
    """Place `count` points at equal arc length along a polyline (K, D) [m]; ends are kept."""
    line = np.asarray(points, dtype=float)
    s = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(line, axis=0), axis=1))])
    at = np.linspace(0.0, s[-1], count)
    return np.stack([np.interp(at, s, column) for column in line.T], axis=1)


def smooth(stations: ArrayLike, at: ArrayLike) -> Array:
    """Interpolate a table by a monotone cubic (no overshoot between the given values).

    Args:
        stations: (K, 1 + D) rows of parameter (increasing) and D values.
        at: (M,) parameters.

    Returns:
        (M, D) values.
    """
    table = np.asarray(stations, dtype=float)
    values = PchipInterpolator(table[:, 0], table[:, 1:])(np.asarray(at, dtype=float))
    return np.asarray(values, dtype=float)


def angles(count: int) -> Array:
    """(count,) equally spaced angles [rad] of a full turn, the first at 0."""
    return np.arange(count) * (2.0 * np.pi / count)


def ellipse(a: float, b: float, count: int) -> Array:
    """(count, 2) points [m] of an ellipse with half axes `a` and `b` [m], anticlockwise."""
    t = angles(count)
    return np.stack([a * np.cos(t), b * np.sin(t)], axis=1)


def rounded_rectangle(a: float, b: float, radius: float, steps: int = 3) -> Array:
    """(4 (steps + 1), 2) points [m] of a rectangle, half sides `a`, `b`, corner `radius` [m]."""
    turn = np.linspace(0.0, 0.5 * np.pi, steps + 1)
    quarters = []
    for k, (sx, sy) in enumerate([(1, 1), (-1, 1), (-1, -1), (1, -1)]):
        t = turn + 0.5 * np.pi * k
        centre = np.array([sx * (a - radius), sy * (b - radius)])
        quarters.append(centre + radius * np.stack([np.cos(t), np.sin(t)], axis=1))
    return np.concatenate(quarters)


def equal_area_factor(count: int) -> float:
    """Radius of a regular polygon with `count` corners over that of the circle of equal area."""
    step = 2.0 * np.pi / count
    return float(np.sqrt(step / np.sin(step)))
