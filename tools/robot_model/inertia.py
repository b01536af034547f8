"""Mass properties of a link."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from tools.robot_model.shapes import Box


@dataclass(frozen=True)
class Inertia:
    """Mass properties of a link B.

    Attributes:
        mass: [kg].
        p_BBcm: centre of mass in the link frame [m].
        moments: Ixx, Iyy, Izz about the centre of mass, axes of the link frame [kg m^2].
        products: Ixy, Ixz, Iyz, likewise (entries of the tensor).
    """

    mass: float
    p_BBcm: tuple[float, float, float]
    moments: tuple[float, float, float]
    products: tuple[float, float, float] = (0.0, 0.0, 0.0)


LENGTH_DIGITS, INERTIA_DIGITS = 12, 15
"""Decimals of metres and kg m^2: sums differ in the last digits from processor to processor, the
files that are written must not."""


def box_inertia(boxes: Sequence[Box], mass: float) -> Inertia:
    """Mass properties of boxes of one density, rounded; where boxes overlap both count.

    Args:
        boxes: in the link frame; turned about x only.
        mass: total mass [kg].
    """
    volumes = np.array([np.prod(b.size) for b in boxes])
    masses = mass * volumes / volumes.sum()
    centres = np.array([b.p_BG for b in boxes])
    p_BBcm = masses @ centres / mass
    I_Bcm = np.zeros((3, 3))
    for box, m, centre in zip(boxes, masses, centres, strict=True):
        squares = np.square(box.size)
        c, s = np.cos(box.rpy[0]), np.sin(box.rpy[0])
        R_BG = np.array([[1.0, 0.0, 0.0], [0.0, c, -s], [0.0, s, c]])
        r = centre - p_BBcm
        I_Bcm += R_BG @ np.diag(m / 12.0 * (squares.sum() - squares)) @ R_BG.T
        I_Bcm += m * (r @ r * np.eye(3) - np.outer(r, r))
    x, y, z = (np.round(p_BBcm, LENGTH_DIGITS) + 0.0).tolist()
    I_Bcm = np.round(I_Bcm, INERTIA_DIGITS) + 0.0
    xx, yy, zz = np.diag(I_Bcm).tolist()
    xy, xz, yz = I_Bcm[[0, 0, 1], [1, 2, 2]].tolist()
    return Inertia(mass, (x, y, z), (xx, yy, zz), (xy, xz, yz))
