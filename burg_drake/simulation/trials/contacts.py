"""Reads Drake's contact results: which bodies touch, how hard the fingers press, on what area."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass

import numpy as np
from pydrake.geometry import GeometryId, SceneGraph
from pydrake.multibody.plant import ContactResults, MultibodyPlant
from pydrake.multibody.tree import BodyIndex

from burg_drake.core import Array


@dataclass(frozen=True)
class BodyContact:
    """Contact between two bodies at one pair of geometries.

    Attributes:
        body_A, body_B: the bodies.
        f_B_W: (3,) force on body B in the world [N].
        area: of the contact patch [m^2]; 0 for contact at a point.
    """

    body_A: BodyIndex
    body_B: BodyIndex
    f_B_W: Array
    area: float = 0.0


@dataclass(frozen=True)
class FingerContact:
    """Contact of the two fingers with the target.

    Attributes:
        touching: whether each finger touches the target.
        force: (2, 3) force of each finger on the target in the world [N].
        area: (2,) area of the patches of each finger [m^2].
    """

    touching: tuple[bool, bool]
    force: Array
    area: Array

    @property
    def both(self) -> bool:
        """Both fingers touch the target."""
        return all(self.touching)

    @property
    def any(self) -> bool:
        """A finger touches the target."""
        return any(self.touching)


NO_CONTACT = FingerContact((False, False), np.zeros((2, 3)), np.zeros(2))
"""Neither finger touches anything."""


class ContactReader:
    """Maps the geometries of contact results to bodies.

    Args:
        plant: a finalized plant.
        scene_graph: its scene graph.
    """

    def __init__(self, plant: MultibodyPlant, scene_graph: SceneGraph) -> None:
        inspector = scene_graph.model_inspector()
        self._body_of = {
            geometry: plant.GetBodyFromFrameId(inspector.GetFrameId(geometry)).index()
            for geometry in inspector.GetAllGeometryIds()
        }

    def read(self, results: ContactResults) -> list[BodyContact]:
        """All contacts of a value of the plant's contact results port."""
        contacts = []
        for i in range(results.num_hydroelastic_contacts()):
            info = results.hydroelastic_contact_info(i)
            surface = info.contact_surface()
            body_M, body_N = self._body_of[surface.id_M()], self._body_of[surface.id_N()]
            f_M_W = info.F_Ac_W().translational()
            contacts.append(BodyContact(body_N, body_M, f_M_W, surface.total_area()))
        for i in range(results.num_point_pair_contacts()):
            pair = results.point_pair_contact_info(i)
            contacts.append(
                BodyContact(pair.bodyA_index(), pair.bodyB_index(), pair.contact_force())
            )
        return contacts

    @staticmethod
    def has_any(results: ContactResults, geometries: Collection[GeometryId]) -> bool:
        """Whether one of these geometries meets something at a point."""
        pairs = map(results.point_pair_contact_info, range(results.num_point_pair_contacts()))
        points = (pair.point_pair() for pair in pairs)
        return any(p.id_A in geometries or p.id_B in geometries for p in points)


def finger_contact(
    contacts: list[BodyContact], fingers: tuple[BodyIndex, BodyIndex], target: BodyIndex
) -> FingerContact:
    """Sums the contacts of each finger with the target."""
    force, area = np.zeros((2, 3)), np.zeros(2)
    touching = [False, False]
    for i, finger in enumerate(fingers):
        for contact in contacts:
            if (contact.body_A, contact.body_B) == (finger, target):
                force[i] += contact.f_B_W
            elif (contact.body_A, contact.body_B) == (target, finger):
                force[i] -= contact.f_B_W
            else:
                continue
            area[i] += contact.area
            touching[i] = True
    return FingerContact((touching[0], touching[1]), force, area)


def reached(
    contacts: list[BodyContact], moving: Collection[BodyIndex], still: Collection[BodyIndex]
) -> set[BodyIndex]:
    """Those of the bodies in `still` that a body in `moving` touches."""
    found = set()
    for contact in contacts:
        one, other = contact.body_A, contact.body_B
        if one in moving and other in still:
            found.add(other)
        elif other in moving and one in still:
            found.add(one)
    return found


def touched_from_outside(contacts: list[BodyContact], bodies: Collection[BodyIndex]) -> bool:
    """Whether one of the bodies touches a body that is not one of them."""
    return any((c.body_A in bodies) != (c.body_B in bodies) for c in contacts)
