"""Two boxes and a table in a vertical plane: rigid, inelastic, with Coulomb friction.

Moreau's time stepping: at each step the impulses at all touching corners are found together by
projected Gauss-Seidel, so that no corner approaches and none pulls. No stiffness or damping is
chosen; a coefficient of restitution shows how much the result hinges on bouncing.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .arrays import Array
from .compiled import compiled

GRAVITY = 9.81
POLL = 0.01
"""Time between poses that are returned [s]."""
CONTACTS, SWEEPS = 16, 2000


@dataclass(frozen=True, eq=False)
class TwoBoxes:
    """What does not change.

    Attributes:
        half: (2, 2) half sizes along both axes of each box [m].
        mass: (2,) [kg].
        friction: (3,) coefficients: of each box on the table, and between them.
    """

    half: Array
    mass: Array
    friction: Array

    @property
    def mobility(self) -> Array:
        """(6,) inverse masses and inertias along x, z and the angle of each box."""
        inertia = self.mass * (self.half**2).sum(axis=1) / 3.0
        return np.column_stack((1.0 / self.mass, 1.0 / self.mass, 1.0 / inertia)).ravel()


def simulate(
    boxes: TwoBoxes,
    start: Array,
    speed: Array,
    time: float,
    step: float = 1e-4,
    restitution: float = 0.0,
) -> Array:
    """Poses (N, 2, 3) of both boxes every `POLL`: x, z of the middle [m], and angle [rad].

    Args:
        boxes: the boxes; the table's top is z = 0.
        start, speed: (2, 3) poses and their rates at the start.
        time: [s].
        step: [s].
        restitution: of all contacts that meet at more than 20 mm/s.
    """
    polls, every = round(time / POLL), round(POLL / step)
    pose, rate = start.astype(float).ravel(), speed.astype(float).ravel()
    found = np.zeros((polls, 6))
    for k in range(polls):
        _advance(boxes.half, boxes.mobility, boxes.friction, pose, rate, step, every, restitution)
        found[k] = pose
    return found.reshape(polls, 2, 3)


def farthest(half: Array, start: Array, poses: Array) -> float:
    """Largest motion of a corner of a box (2,) from its start (3,) along poses (N, 3) [m]."""
    corners = np.array([(x, z) for x in (-1, 1) for z in (-1, 1)]) * half
    c, s = np.cos(np.vstack((start, poses))[:, 2]), np.sin(np.vstack((start, poses))[:, 2])
    turned = np.einsum("nij,kj->nki", np.array([[c, -s], [s, c]]).transpose(2, 0, 1), corners)
    placed = turned + np.vstack((start, poses))[:, None, :2]
    return float(np.linalg.norm(placed - placed[0], axis=2).max())


@compiled
def _advance(half, mobility, friction, pose, rate, step, steps, restitution):  # type: ignore[no-untyped-def]
    """Advances `pose` and `rate` (6,) in place."""
    rows = np.zeros((CONTACTS, 2, 6))
    depth, limit = np.zeros(CONTACTS), np.zeros(CONTACTS)
    for _ in range(steps):
        count = _find_contacts(half, friction, pose, rows, depth, limit)
        rate[1] -= step * GRAVITY
        rate[4] -= step * GRAVITY
        for k in range(count):
            meeting = np.dot(rows[k, 0], rate)
            depth[k] = min(0.2 * max(depth[k], 0.0) / step, 0.02)  # speed that parts them
            if meeting < -0.02:
                depth[k] -= restitution * meeting
        _solve(rows[:count], mobility, depth, limit, rate)
        pose += step * rate


@compiled
def _find_contacts(half, friction, pose, rows, depth, limit):  # type: ignore[no-untyped-def]
    """Corners that touch the table or the other box.

    Fills in directions of the normal and of sliding (2, 6), depths and friction coefficients;
    returns how many there are.
    """
    count = 0
    for body in range(2):
        other = 1 - body
        c, s = np.cos(pose[3 * body + 2]), np.sin(pose[3 * body + 2])
        for corner in range(4):
            x = half[body, 0] * (1.0 if corner % 2 else -1.0)
            z = half[body, 1] * (1.0 if corner > 1 else -1.0)
            rx, rz = c * x - s * z, s * x + c * z
            px, pz = pose[3 * body] + rx, pose[3 * body + 1] + rz
            if pz < 1e-7:
                _set_rows(rows[count], body, rx, rz, 0.0, 1.0, -1, 0.0, 0.0)
                depth[count], limit[count] = -pz, friction[body]
                count += 1
            qx, qz = px - pose[3 * other], pz - pose[3 * other + 1]
            co, so = np.cos(pose[3 * other + 2]), np.sin(pose[3 * other + 2])
            ux, uz = co * qx + so * qz, -so * qx + co * qz
            dx, dz = half[other, 0] - abs(ux), half[other, 1] - abs(uz)
            if min(dx, dz) > -1e-7:
                nx, nz = (np.sign(ux), 0.0) if dx < dz else (0.0, np.sign(uz))
                nx, nz = co * nx - so * nz, so * nx + co * nz
                _set_rows(rows[count], body, rx, rz, nx, nz, other, qx, qz)
                depth[count], limit[count] = min(dx, dz), friction[2]
                count += 1
    return count


@compiled
def _set_rows(row, body, rx, rz, nx, nz, other, qx, qz):  # type: ignore[no-untyped-def]
    """Derivatives of a contact's distance and sliding by the poses, with the normal (nx, nz)."""
    row[:] = 0.0
    for k in range(2):
        ax, az = (nx, nz) if k == 0 else (nz, -nx)
        row[k, 3 * body], row[k, 3 * body + 1] = ax, az
        row[k, 3 * body + 2] = rx * az - rz * ax
        if other >= 0:
            row[k, 3 * other], row[k, 3 * other + 1] = -ax, -az
            row[k, 3 * other + 2] = -(qx * az - qz * ax)


@compiled
def _solve(rows, mobility, parting, limit, rate):  # type: ignore[no-untyped-def]
    """Changes `rate` by the impulses of all contacts."""
    impulse = np.zeros((len(rows), 2))
    for _ in range(SWEEPS):
        largest = 0.0
        for k in range(len(rows)):
            for a in range(2):
                row, before = rows[k, a], impulse[k, a]
                goal = parting[k] if a == 0 else 0.0
                after = before + (goal - np.dot(row, rate)) / np.dot(row * mobility, row)
                most = limit[k] * impulse[k, 0]
                after = max(0.0, after) if a == 0 else min(most, max(-most, after))
                impulse[k, a] = after
                rate += (after - before) * mobility * row
                largest = max(largest, abs(after - before))
        if largest < 1e-13:
            break
