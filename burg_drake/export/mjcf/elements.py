"""Attributes of MJCF elements as texts that keep every bit."""

from __future__ import annotations

import numpy as np

from burg_drake.core import Array, quaternion_from_rotation


def numbers(values: object) -> str:
    """Numbers as an attribute."""
    return " ".join(repr(v) for v in np.ravel(np.asarray(values, dtype=float)).tolist())


def place(X_AB: Array) -> dict[str, str]:
    """Attributes of a pose (4, 4)."""
    quaternion = quaternion_from_rotation(X_AB[:3, :3])
    return {"pos": numbers(X_AB[:3, 3]), "quat": numbers(quaternion)}


def full_inertia(mass: float, p_BCm: object, moments: object) -> dict[str, str]:
    """Attributes of an `inertial`: mass [kg], centre of mass [m], and xx, yy, zz, xy, xz, yz of the
    inertia about it [kg m^2]."""
    return {"pos": numbers(p_BCm), "mass": repr(mass), "fullinertia": numbers(moments)}


def box_size(size: object) -> dict[str, str]:
    """Attributes of a box by its extents [m]."""
    return {"type": "box", "size": numbers(np.asarray(size, dtype=float) / 2)}


def round_size(kind: str, size: tuple[float, ...]) -> dict[str, str]:
    """Attributes of a `sphere` by its radius, of a `cylinder` by radius and length [m]."""
    half = (size[0], size[1] / 2) if kind == "cylinder" else size
    return {"type": kind, "size": numbers(half)}
