"""Reads from Drake's contact results which finger presses on the target, and how hard."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from pydrake.geometry import SceneGraph
from pydrake.multibody.plant import ContactResults, MultibodyPlant
from pydrake.multibody.tree import BodyIndex

from burg_drake.core.frames import Array


@dataclass(frozen=True)
class FingerContact:
    """Contact of the two fingers with the target.

    Attributes:
        touching: whether each finger touches the target.
        force: (2, 3) force of each finger on the target in the world [N].
    """

    touching: tuple[bool, bool]
    force: Array

    @property
    def both(self) -> bool:
        """Both fingers touch the target."""
        return all(self.touching)

    @property
    def any(self) -> bool:
        """A finger touches the target."""
        return any(self.touching)


class ContactReader:
    """Maps contact results to fingers of one hand.

    Args:
        plant: a finalized plant.
        scene_graph: its scene graph.
        fingers: bodies of the two fingers.
    """

    def __init__(
        self, plant: MultibodyPlant, scene_graph: SceneGraph, fingers: tuple[BodyIndex, BodyIndex]
    ) -> None:
        self._fingers = {index: i for i, index in enumerate(fingers)}
        inspector = scene_graph.model_inspector()
        self._body_of = {
            geometry: plant.GetBodyFromFrameId(inspector.GetFrameId(geometry)).index()
            for geometry in inspector.GetAllGeometryIds()
        }

    def read(self, results: ContactResults, target: BodyIndex) -> FingerContact:
        """Contact of the fingers with one body.

        Args:
            results: value of the plant's contact results port.
            target: the body.
        """
        force = np.zeros((2, 3))
        touching = [False, False]
        for i in range(results.num_hydroelastic_contacts()):
            info = results.hydroelastic_contact_info(i)
            surface = info.contact_surface()
            body_M, body_N = self._body_of[surface.id_M()], self._body_of[surface.id_N()]
            if target in (body_M, body_N):
                finger = self._fingers.get(body_N if body_M == target else body_M)
                if finger is not None:
                    F_M_W = info.F_Ac_W().translational()
                    force[finger] += F_M_W if body_M == target else -F_M_W
                    touching[finger] = True
        for i in range(results.num_point_pair_contacts()):
            pair = results.point_pair_contact_info(i)
            body_A, body_B = pair.bodyA_index(), pair.bodyB_index()
            if target in (body_A, body_B):
                finger = self._fingers.get(body_B if body_A == target else body_A)
                if finger is not None:
                    f_B_W = pair.contact_force()
                    force[finger] += f_B_W if body_B == target else -f_B_W
                    touching[finger] = True
        return FingerContact((touching[0], touching[1]), force)
