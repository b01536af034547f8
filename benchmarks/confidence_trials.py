"""The grasps that confidence is calibrated on: ordinary and hard ones of the oracle's objects."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from itertools import islice
from typing import Literal

import numpy as np
from oracle.cases import Case, draw_cases
from oracle.catalogue import HELD_OUT, TUNED, thing
from oracle.hand import DEFAULT_PHASES
from oracle.strangers import HELD_OUT_STRANGERS, STRANGERS
from scipy.spatial.transform import Rotation

from burg_drake.core import make_pose, rng_from
from burg_drake.simulation import DEFAULT_TRIAL, GripLoad

OBJECTS = (*STRANGERS, *TUNED, *HELD_OUT)
ORDINARY_FRICTION, ORDINARY_MASS = (0.25, 0.7), (0.08, 0.8)
"""Friction and mass [kg] of ordinary grasps; drawn evenly in the logarithm."""
LIMIT_SD = 0.1
"""Standard deviation of the logarithm of friction about its limit."""
CHANGED_FRICTION_SD, CHANGED_POSITION_SD, CHANGED_ANGLE_SD = 0.05, 0.0005, np.deg2rad(0.5)
"""Standard deviations of what the oracle's trial changes: the logarithm of friction, and the hand's
position [m] and orientation [rad] by each axis."""

Kind = Literal["hard", "ordinary", "limit"]


@dataclass(frozen=True)
class Grasp:
    """A grasp to execute.

    Attributes:
        case: the grasp, its friction and its mass.
        kind: `ordinary` if friction and mass are those of everyday objects, `hard` if friction is
            half to twice a rough guess of what holds the object, `limit` if it is within some 10 %
            of what carries an object that hangs straight below the pads.
    """

    case: Case
    kind: Kind

    @property
    def held_out(self) -> bool:
        """Whether nothing may be fitted on the object: every second object of each kind of
        `oracle.strangers`."""
        return self.case.object in HELD_OUT_STRANGERS


def draw(name: str, each: int) -> list[Grasp]:
    """Grasps of an object: a third of each kind, or fewer `limit` and more `hard` ones where few
    hang straight below the pads."""
    rng = rng_from("confidence", name)
    grasps = []
    for k, case in enumerate(islice(draw_cases(name, "confidence"), each)):
        friction, mass = np.exp(
            [rng.uniform(*np.log(ORDINARY_FRICTION)), rng.uniform(*np.log(ORDINARY_MASS))]
        ).round(4)
        shift = rng.normal(0.0, LIMIT_SD)
        if k % 3 == 1:
            case = dataclasses.replace(case, friction=float(friction), mass=float(mass))
            grasps.append(Grasp(case, "ordinary"))
        elif k % 3 == 2 and (limit := friction_limit(case)) is not None:
            case = dataclasses.replace(case, friction=round(limit * float(np.exp(shift)), 4))
            grasps.append(Grasp(case, "limit"))
        else:
            grasps.append(Grasp(case, "hard"))
    return grasps


def changed(case: Case, number: int) -> Case:
    """The case as a laboratory can hardly tell it from the first: with friction 5 % other, and the
    hand half a millimetre and half a degree off.

    Args:
        case: the case.
        number: of the change, from 0.
    """
    rng = rng_from("confidence change", case.id)
    for _ in range(number + 1):
        turned = Rotation.from_rotvec(rng.normal(0.0, CHANGED_ANGLE_SD, 3))
        X_GG = make_pose(turned.as_matrix(), rng.normal(0.0, CHANGED_POSITION_SD, 3))
        friction = case.friction * float(np.exp(rng.normal(0.0, CHANGED_FRICTION_SD)))
    rows = tuple(tuple(row) for row in (case.matrix @ X_GG)[:3].tolist())
    return dataclasses.replace(case, X_OG=rows, friction=friction)


def friction_limit(case: Case) -> float | None:
    """Smallest friction that carries the object; None if it turns in the pads first."""
    found = thing(case.object)
    X_WO = found.X_WO(case.pose)
    load = GripLoad.of(
        X_WO @ case.matrix,
        X_WO[:3, :3] @ found.mass_properties.center + X_WO[:3, 3],
        friction=1.0,
        force=DEFAULT_PHASES.force,
        mass=case.mass,
        acceleration=DEFAULT_TRIAL.acceleration,
    )
    return float(np.hypot(load.carried, load.turned)) if load.turned < load.carried else None
