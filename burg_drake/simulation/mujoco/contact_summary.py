"""MuJoCo's contacts, of which each geom may have several, as contacts of bodies."""

from __future__ import annotations

from typing import Any

import numpy as np
from pydrake.multibody.tree import BodyIndex

from burg_drake.core import Array, Indices
from burg_drake.simulation.trials import BodyContact


def summarize_contacts(model: Any, data: Any, shares: Array, table: int) -> list[BodyContact]:
    """What touches, one a pair of bodies.

    Args:
        model, data: MuJoCo's, after a step with elliptic cones.
        shares: (geoms,) area that a geom stands for where it touches; 0 of those without [m^2].
        table: body that the world's own geoms count as.
    """
    found = data.contact
    near = np.flatnonzero(found.dist < 0.0)
    if not len(near):
        return []
    geoms = np.asarray(found.geom)[near]
    bodies = model.geom_bodyid[geoms]
    bodies[bodies == 0] = table
    swapped = bodies[:, 0] > bodies[:, 1]
    f_W = _forces(data, near) * np.where(swapped, -1.0, 1.0)[:, None]
    bodies = np.sort(bodies, axis=1)
    pairs, pair = np.unique(bodies, axis=0, return_inverse=True)
    force = np.zeros((len(pairs), 3))
    np.add.at(force, pair.reshape(-1), f_W)
    area = np.zeros(len(pairs))
    share = shares[geoms]
    soft = share.max(axis=1)
    for k in np.unique(pair.reshape(-1)[soft > 0.0]):
        mine = np.flatnonzero((pair.reshape(-1) == k) & (soft > 0.0))
        one = np.take_along_axis(geoms[mine], share[mine].argmax(axis=1)[:, None], axis=1)
        area[k] = shares[np.unique(one)].sum()
    return [
        BodyContact(BodyIndex(int(a)), BodyIndex(int(b)), force[k], float(area[k]))
        for k, (a, b) in enumerate(pairs)
    ]


def _forces(data: Any, contacts: Indices) -> Array:
    """(N, 3) force of contacts on the second geom in the world; 0 where there is none."""
    address = np.asarray(data.contact.efc_address)[contacts]
    solved = address >= 0
    frame = np.asarray(data.contact.frame)[contacts[solved]].reshape(-1, 3, 3)
    in_frame = np.asarray(data.efc_force)[address[solved, None] + np.arange(3)]
    f_W = np.zeros((len(contacts), 3))
    f_W[solved] = np.einsum("nij,ni->nj", frame, in_frame)
    return f_W
