"""Symmetries of objects that are as good as boxes, cylinders and spheres, as BOP has them."""

from __future__ import annotations

from itertools import permutations, product
from typing import Any

import numpy as np

from burg_drake.core import Array, inverse, make_pose
from burg_drake.objects.library import ObjectEntry

TOLERANCE = 0.01
"""How far a surface may be from its primitive, as a share of the diameter. BOP takes a symmetry for
possible up to 0.1 (Hodan et al., "BOP Challenge 2020", section 2.2), and looks at the object then;
nobody looks here."""
MM = 1e3
DECIMALS = 9


def symmetries(entry: ObjectEntry, diameter: float) -> dict[str, Any]:
    """Symmetries by the names of `models_info.json`; empty if none are known.

    Args:
        entry: of the object. Its contact geometry tells which primitive it is; what a texture shows
            is not looked at.
        diameter: of the object [m].

    Returns:
        `symmetries_continuous`: axes, each with a point on it in millimetres, and
        `symmetries_discrete`: 4 x 4 matrices, row by row, in millimetres; those there are. A sphere
        gets three axes, as BOP has no more than axes.
    """
    contact = entry.contact
    primitive, fit = contact.primitive, contact.fit
    if contact.kind != "primitive" or primitive is None or fit is None:
        return {}
    if fit.hausdorff > TOLERANCE * diameter:
        return {}
    X_OP = primitive.X_OP.matrix()
    if primitive.shape == "box":
        size = np.array(primitive.size)
        turns = [R for R in _cube_rotations() if _maps(R, size, TOLERANCE * diameter)]
        return {"symmetries_discrete": [_flat(X_OP, R) for R in turns]}
    if primitive.shape == "cylinder":
        over = np.diag([1.0, -1.0, -1.0])
        return {
            "symmetries_continuous": [_axis(X_OP, 2)],
            "symmetries_discrete": [_flat(X_OP, over)],
        }
    return {"symmetries_continuous": [_axis(X_OP, k) for k in range(3)]}


def _axis(X_OP: Array, k: int) -> dict[str, list[float]]:
    return {"axis": _listed(X_OP[:3, k]), "offset": _listed(MM * X_OP[:3, 3])}


def _flat(X_OP: Array, R: Array) -> list[float]:
    """A rotation about the primitive's middle, in the object frame."""
    X = X_OP @ make_pose(R, np.zeros(3)) @ inverse(X_OP)
    X[:3, 3] *= MM
    return _listed(X.reshape(-1))


def _listed(values: Array) -> list[float]:
    return [float(x) for x in values.round(DECIMALS) + 0.0]


def _cube_rotations() -> list[Array]:
    """The 23 rotations that map a cube to itself, besides the identity."""
    found = []
    for order, signs in product(permutations(range(3)), product((1.0, -1.0), repeat=3)):
        R = np.diag(signs)[:, order]
        if np.linalg.det(R) > 0.0 and not np.array_equal(R, np.eye(3)):
            found.append(R)
    return found


def _maps(R: Array, size: Array, tolerance: float) -> bool:
    """Whether a rotation maps a box to itself."""
    return bool((np.abs(np.abs(R) @ size - size) <= tolerance).all())
