"""Inverse kinematics of the UR5e in closed form, by its DH table: what a user would bring along."""

from __future__ import annotations

from itertools import product

import numpy as np

A2, A3 = -0.425, -0.3922
D1, D4, D5, D6 = 0.1625, 0.1333, 0.0997, 0.0996


def link(theta: float, d: float, a: float, alpha: float) -> np.ndarray:
    """A row of the DH table as a pose (4, 4)."""
    c, s, ca, sa = np.cos(theta), np.sin(theta), np.cos(alpha), np.sin(alpha)
    return np.array(
        [
            [c, -s * ca, s * sa, a * c],
            [s, c * ca, -c * sa, a * s],
            [0.0, sa, ca, d],
            [0.0, 0.0, 0.0, 1.0],
        ]
    )


def solve(X_AF: np.ndarray) -> np.ndarray:
    """All arm positions (S, 6) with the flange at a pose (4, 4), each joint in [-pi, pi]."""
    found = []
    R, p = X_AF[:3, :3], X_AF[:3, 3]
    wrist = p - D6 * R[:, 2]
    radius = np.hypot(wrist[0], wrist[1])
    if radius < D4:
        return np.empty((0, 6))
    for shoulder, turn in product((1.0, -1.0), repeat=2):
        q1 = np.arctan2(wrist[1], wrist[0]) + shoulder * np.arccos(D4 / radius) + np.pi / 2
        s1, c1 = np.sin(q1), np.cos(q1)
        c5 = (p[0] * s1 - p[1] * c1 - D4) / D6
        if abs(c5) > 1.0:
            continue
        q5 = turn * np.arccos(c5)
        if abs(np.sin(q5)) < 1e-9:
            continue
        side = np.sign(np.sin(q5))
        q6 = np.arctan2(side * (-R[0, 1] * s1 + R[1, 1] * c1), side * (R[0, 0] * s1 - R[1, 0] * c1))
        X_01 = link(q1, D1, 0.0, np.pi / 2)
        X_46 = link(q5, D5, 0.0, -np.pi / 2) @ link(q6, D6, 0.0, 0.0)
        X_14 = np.linalg.inv(X_01) @ X_AF @ np.linalg.inv(X_46)
        x, y = X_14[:2, 3]
        c3 = (x * x + y * y - A2 * A2 - A3 * A3) / (2.0 * A2 * A3)
        if abs(c3) > 1.0:
            continue
        total = np.arctan2(X_14[1, 0], X_14[0, 0])
        for q3 in (np.arccos(c3), -np.arccos(c3)):
            q2 = np.arctan2(y, x) - np.arctan2(A3 * np.sin(q3), A2 + A3 * np.cos(q3))
            found.append([q1, q2, q3, total - q2 - q3, q5, q6])
    q = np.array(found).reshape(-1, 6)
    return (q + np.pi) % (2 * np.pi) - np.pi


def forward(q: np.ndarray) -> np.ndarray:
    """The flange's pose (4, 4) at arm positions (6,)."""
    table = (
        (D1, 0.0, np.pi / 2),
        (0.0, A2, 0.0),
        (0.0, A3, 0.0),
        (D4, 0.0, np.pi / 2),
        (D5, 0.0, -np.pi / 2),
        (D6, 0.0, 0.0),
    )
    X = np.eye(4)
    for theta, (d, a, alpha) in zip(q, table, strict=True):
        X = X @ link(theta, d, a, alpha)
    return X
