"""Where things are in the arrays of a compiled trial model."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from burg_drake.core import Indices
from burg_drake.export.mjcf import (
    BACK,
    CARRIER,
    FIXED,
    LIFT,
    OBJECT,
    SHAPE,
    SPHERE,
    TABLE,
    link_name,
)
from burg_drake.station.diagram import HandDescription


@dataclass(frozen=True, eq=False)
class ModelIndex:
    """Bodies, and geoms, as numbers.

    Attributes:
        objects: bodies of what can move, by the names of instances.
        fixed: bodies of what cannot, by name, the table too.
        geoms: of both, by name.
        pairs: with the table's plane, by name.
        carrier, hand, fingers: bodies.
        spheres: geoms of each finger's pad.
        finger_geoms: geoms of both fingers.
        palm: geoms of the hand's body.
        lift_joint, lift_qpos, lift_dof: of the carrier's joint.
        lift_place, lift_speed: servos of the carrier.
        finger_qpos, finger_dofs, finger_servos: of both fingers.
    """

    objects: dict[str, int]
    fixed: dict[str, int]
    geoms: dict[str, Indices]
    pairs: dict[str, Indices]
    carrier: int
    hand: int
    fingers: tuple[int, int]
    spheres: tuple[Indices, Indices]
    finger_geoms: Indices
    palm: Indices
    lift_joint: int
    lift_qpos: int
    lift_dof: int
    lift_place: int
    lift_speed: int
    finger_qpos: Indices
    finger_dofs: Indices
    finger_servos: Indices

    @property
    def table(self) -> int:
        """Body of the table's box."""
        return self.fixed[TABLE]

    @classmethod
    def of(cls, model: Any, parts: HandDescription) -> ModelIndex:
        """Looks them up by their names."""
        bodies = {model.body(k).name: k for k in range(model.nbody)}
        geoms = [model.geom(k).name for k in range(model.ngeom)]
        pairs = [model.pair(k).name for k in range(model.npair)]
        objects, fixed = (_named(bodies, word) for word in (OBJECT, FIXED))
        named = {name: f"{OBJECT} {name} " for name in objects}
        named |= {name: f"{FIXED} {name} " for name in fixed}
        one, other = (finger.name for finger in parts.fingers)
        joints = [model.joint(link_name(f.joint)) for f in parts.document.fingers]
        lift = model.joint(LIFT.name)
        of_fingers = [f"{word} {name} " for name in (one, other) for word in (SPHERE, BACK, SHAPE)]
        return cls(
            objects=objects,
            fixed=fixed,
            geoms={name: _beginning(geoms, words) for name, words in named.items()},
            pairs={name: _beginning(pairs, named[name]) for name in objects},
            carrier=bodies[CARRIER],
            hand=bodies[link_name(parts.body.name)],
            fingers=(bodies[link_name(one)], bodies[link_name(other)]),
            spheres=(
                _beginning(geoms, f"{SPHERE} {one} "),
                _beginning(geoms, f"{SPHERE} {other} "),
            ),
            finger_geoms=np.concatenate([_beginning(geoms, words) for words in of_fingers]),
            palm=_beginning(geoms, f"{SHAPE} {parts.body.name} "),
            lift_joint=int(lift.id),
            lift_qpos=int(lift.qposadr[0]),
            lift_dof=int(lift.dofadr[0]),
            lift_place=int(model.actuator(LIFT.name).id),
            lift_speed=int(model.actuator(LIFT.speed).id),
            finger_qpos=np.array([joint.qposadr[0] for joint in joints]),
            finger_dofs=np.array([joint.dofadr[0] for joint in joints]),
            finger_servos=np.array(
                [model.actuator(link_name(f.joint)).id for f in parts.document.fingers]
            ),
        )


def _named(bodies: dict[str, int], word: str) -> dict[str, int]:
    begin = f"{word} "
    return {name[len(begin) :]: k for name, k in bodies.items() if name.startswith(begin)}


def _beginning(names: list[str], words: str) -> Indices:
    """Numbers of the names that begin so."""
    return np.array([k for k, name in enumerate(names) if name.startswith(words)], dtype=np.intp)
