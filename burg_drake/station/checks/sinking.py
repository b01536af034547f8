"""How hard the table pushes back what is in it: what stands on a tip sinks in until it is borne.

The pressure of Drake's hydroelastic box grows in proportion to the depth, from 0 at the face to the
modulus in the middle. What it pushes up with is therefore proportional to the volume that is below
the face, of each convex shape by itself.
"""

from __future__ import annotations

import itertools

import numpy as np
from pydrake.geometry import Box, Convex, Cylinder, Mesh, Shape
from pydrake.math import RigidTransform
from scipy.spatial import ConvexHull, QhullError

from burg_drake.core import Array, transform_points
from burg_drake.objects.library import DEFAULT_CONTACT, Primitive, resolution_hint
from burg_drake.station.checks.body_shapes import PosedShapes
from burg_drake.station.world import TABLE_MODULUS


def push_up(shapes: PosedShapes, X_WO: RigidTransform, thickness: float) -> float:
    """The force of the table on an object at rest [N].

    Args:
        shapes: of the object, in its frame.
        X_WO: its pose.
        thickness: of the table [m].

    Returns:
        The force; infinite if the volume of a shape is not looked at: that of a sphere, which
        meets the table at a point.
    """
    volume = sum(_volume_below(shape, X_WO @ X_OG) for X_OG, shape in shapes)
    return volume * TABLE_MODULUS / (thickness / 2)


def _volume_below(shape: Shape, X_WG: RigidTransform) -> float:
    """Of the part of a convex shape that is below z = 0 [m^3]."""
    if isinstance(shape, Box):
        corners = np.array(list(itertools.product((-0.5, 0.5), repeat=3)))
        p_WV = transform_points(X_WG.GetAsMatrix4(), corners * shape.size())
    elif isinstance(shape, Cylinder):
        p_WV = transform_points(X_WG.GetAsMatrix4(), _rims(shape.radius(), shape.length()))
    elif isinstance(shape, (Convex, Mesh)):
        hull = shape.GetConvexHull()
        p_GV = np.array([hull.vertex(i) for i in range(hull.num_vertices())])
        p_WV = transform_points(X_WG.GetAsMatrix4(), p_GV)
    else:
        return np.inf
    below = p_WV[p_WV[:, 2] < 0.0]
    return _hull_volume(np.vstack([below, _crossings(below, p_WV[p_WV[:, 2] >= 0.0])]))


def _rims(radius: float, length: float) -> Array:
    """(N, 3) corners of the prism that Drake presses into the table for a cylinder along z [m]."""
    primitive = Primitive(shape="cylinder", size=(radius, length))
    sides = round(2.0 * np.pi * radius / resolution_hint(primitive, DEFAULT_CONTACT.faceting))
    angle = 2.0 * np.pi * np.arange(sides) / sides
    rim = radius * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    return np.vstack([np.insert(rim, 2, end, axis=1) for end in (-length / 2, length / 2)])


def _crossings(below: Array, above: Array) -> Array:
    """Where the lines between points below (N, 3) and above (M, 3) z = 0 cross it: (N M, 3)."""
    share = below[:, None, 2:] / (below[:, None, 2:] - above[None, :, 2:])
    return (below[:, None] + share * (above[None] - below[:, None])).reshape(-1, 3)


def _hull_volume(points: Array) -> float:
    """Of the convex hull of points (N, 3); 0 if they are flat or too few."""
    try:
        return float(ConvexHull(points).volume) if len(points) > 3 else 0.0
    except QhullError:
        return 0.0
