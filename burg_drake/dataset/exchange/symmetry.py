"""Symmetries of models by the names of BOP, found from the mesh and its colours."""

from __future__ import annotations

from typing import Any

import numpy as np
import trimesh

from burg_drake.core import Array, make_pose
from burg_drake.dataset.exchange.model_file import VisualModel
from burg_drake.objects.physics import SymmetrySearch

TOLERANCE = 0.01
"""How far a turned surface may be from itself anywhere, as a share of the diameter. BOP takes a
symmetry for possible up to 0.1 (Hodan et al., "BOP Challenge 2020", section 2.2), and looks at the
object then; nobody looks here."""
MM = 1e3
DECIMALS = 9


def symmetries(model: VisualModel, diameter: float) -> dict[str, Any]:
    """Symmetries by the names of `models_info.json`; empty if there are none.

    Args:
        model: what the object looks like. Turns that do not take each colour onto itself do not
            count; what a texture shows is not known, so that a model with one has none.
        diameter: of the model [m].

    Returns:
        `symmetries_continuous`: axes, each with a point on it in millimetres, and
        `symmetries_discrete`: 4 x 4 matrices, row by row, in millimetres; those there are. A sphere
        gets three axes, as BOP has no more than axes.
    """
    if model.image is not None:
        return {}
    mesh = trimesh.Trimesh(model.vertices, model.faces, process=False)
    p_OC, tolerance = np.asarray(mesh.centroid), TOLERANCE * diameter
    found = SymmetrySearch(mesh, p_OC, tolerance, covered=1.0).find()
    parts = [SymmetrySearch(part, p_OC, tolerance, covered=1.0) for part in _colored_parts(model)]
    axes = list(np.eye(3)) if found.sphere else [] if found.axis is None else [found.axis]
    axes = [axis for axis in axes if all(part.turns_about(axis) for part in parts)]
    turns = [R for R in found.rotations[1:] if all(part.fits(R) for part in parts)]
    info: dict[str, Any] = {}
    if axes:
        info["symmetries_continuous"] = [
            {"axis": _listed(axis), "offset": _listed(MM * p_OC)} for axis in axes
        ]
    if turns:
        info["symmetries_discrete"] = [_flat(R, p_OC) for R in turns]
    return info


def _colored_parts(model: VisualModel) -> list[trimesh.Trimesh]:
    """The surface of each colour, if there are several."""
    if model.colors is None:
        return []
    _, color = np.unique(model.colors[model.faces[:, 0]], axis=0, return_inverse=True)
    color = color.reshape(-1)
    if color.max() == 0:
        return []
    return [
        trimesh.Trimesh(model.vertices, model.faces[color == k], process=False)
        for k in range(int(color.max()) + 1)
    ]


def _flat(R: Array, p_OC: Array) -> list[float]:
    """A rotation about the model's middle, in the object frame."""
    return _listed(make_pose(R, MM * (p_OC - R @ p_OC)).reshape(-1))


def _listed(values: Array) -> list[float]:
    return [float(x) for x in np.asarray(values).round(DECIMALS) + 0.0]
