"""A grasp trial on MuJoCo, as a peer of this project's: the same phases, by another engine.

Force, speed, phases, geometry, masses and friction are those of a trial with the hand alone in
Drake, and the pads are as stiff as there. Unlike there all objects are simulated from the start to
the end of the trial, the fingers begin open, and an object is its convex pieces where pads meet it:
a neck that tapers in them by two degrees is lost with little friction. Where a grasp meets the
table or fixed things on its way, nothing is reported. The hand rises straight up, without retreat.
The model is compiled once for a scene; a trial sets its state, friction and the stiffness of the
pads, and nothing of an earlier one remains. See `peer_mujoco_model` for what is in it.
"""

from __future__ import annotations

import importlib.util
import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from peer_mujoco_model import (
    BACK,
    BOX,
    CARRIER,
    FULL,
    GRID,
    HEIGHT,
    RISE,
    SPHERE,
    STEP,
    TABLE,
    scene_mjcf,
)
from peer_pybullet import HAND, PAD_SIZE, TOUCHING, numbers

from burg_drake.core.arrays import Array
from burg_drake.core.errors import InvalidInputError
from burg_drake.core.frames import quaternion_from_rotation
from burg_drake.core.grasps.outcome import Outcome
from burg_drake.scene.document.scene import Scene
from burg_drake.simulation.trials.execution import MINIMUM_LIFT
from burg_drake.simulation.trials.trial_settings import DEFAULT_TRIAL
from burg_drake.station.document.station_document import Station

PAD_MODULUS, HAND_FRICTION = 1e7, 0.24
"""Of the hand's model: hydroelastic modulus of the pads [Pa], friction of what is no finger."""
PAD_RATE = 400.0
"""Frequency of the pads' contacts in MuJoCo's terms [1/s]; a step is 0.8 of its inverse."""
PAD_DAMPING = 0.1
"""Damping ratio in the same terms. The force then grows by stiffness times 0.5 ms times the speed
of approach, as by Drake's dissipation of 5 s/m at a depth of 0.1 mm. With a ratio of 1, pads hold
what pivots between them: the oracle finds twice as many verdicts too strong."""


def is_installed() -> bool:
    """Whether `Peer` can be made."""
    return importlib.util.find_spec("mujoco") is not None


class Peer:
    """Executes grasps of one scene on MuJoCo.

    Args:
        scene: the scene.
        station: table and hand; its obstacles are left out.

    Raises:
        ImportError: MuJoCo is not installed.
        InvalidInputError: the hand is not the Panda's, whose pads are written down here.
    """

    def __init__(self, scene: Scene, station: Station) -> None:
        import mujoco

        if station.hand.name != HAND:
            raise InvalidInputError(
                f"station {station.name!r} has the hand {station.hand.name!r}; MuJoCo runs beside"
                f" {HAND!r} alone (without MuJoCo installed, every hand is measured)"
            )
        self._mj: Any = mujoco
        self._scene, self._station = scene, station
        self.model: Any = mujoco.MjModel.from_xml_string(scene_mjcf(scene, station))
        self.data: Any = mujoco.MjData(self.model)
        self._index = _Index.of(self.model, scene, station)
        self._steps = round(DEFAULT_TRIAL.poll / STEP)

    def run(self, instance: str, X_OG: Array, friction: float | None = None) -> Outcome:
        """Executes a grasp (4, 4) on an instance.

        Args:
            instance: the target.
            X_OG: grasp in its frame.
            friction: the target's coefficient, in place of the library's.
        """
        mu = self._scene.entry(instance).friction if friction is None else friction
        self._place(self._X_WO(instance) @ X_OG)
        self._set_surfaces(instance, mu)
        self._screen(True)
        blocked = self._overlap(instance)
        if blocked is not None:
            return blocked
        self._screen(False)
        try:
            return self._execute(instance)
        except FloatingPointError:
            return Outcome.SIMULATION_FAILED

    def _execute(self, instance: str) -> Outcome:
        target = self._index.objects[instance]
        start = {name: self._center(body) for name, body in self._index.objects.items()}
        ended = self._close(target)
        if ended is None:
            at_grip = self._center(target)[2]
            ended = self._lift(target, at_grip) or self._hold(target)
        others = (b for b in self._index.objects if b != instance)
        moved = [math.dist(start[b], self._center(self._index.objects[b])) for b in others]
        if ended is Outcome.LIFTED and max(moved, default=0.0) > DEFAULT_TRIAL.disturbance:
            return Outcome.LIFTED_DISTURBED
        return ended

    def _close(self, target: int) -> Outcome | None:
        """Closes until the fingers rest; None if both touch the target then."""
        fingers = self._index.finger_dofs
        speed = self._station.hand.closing_speed
        self.data.qvel[fingers] = self._index.towards_closed * speed
        self.data.ctrl[self._index.finger_drives] = self._index.towards_closed * speed
        touched, rested = False, 0.0
        touching = (False, False)
        for _ in range(round(DEFAULT_TRIAL.close_timeout / DEFAULT_TRIAL.poll)):
            touching = self._advance(target)
            touched = touched or any(touching)
            if np.abs(self.data.qvel[fingers]).max() > DEFAULT_TRIAL.settled_speed:
                rested = 0.0
                continue
            rested += DEFAULT_TRIAL.poll
            if rested > DEFAULT_TRIAL.settled_time + 0.5 * DEFAULT_TRIAL.poll:
                break
        if all(touching):
            return None
        if any(touching):
            return Outcome.ONE_FINGER
        return Outcome.CLOSED_EMPTY if touched else Outcome.NO_CONTACT

    def _lift(self, target: int, at_grip: float) -> Outcome | None:
        """Lifts; None if the target is held at the top."""
        height = self._station.document.motion.lift_height
        duration = DEFAULT_TRIAL.time_of(height)
        polls = 2 * max(1, round(duration / DEFAULT_TRIAL.poll / 2))
        touching = (True, True)
        for poll in range(polls):
            touching = self._advance(target, poll * self._steps)
            if not any(touching):
                return Outcome.SLIPPED
        risen = self._center(target)[2] - at_grip
        return None if all(touching) and risen >= MINIMUM_LIFT * height else Outcome.SLIPPED

    def _rise(self, step: int) -> None:
        """Commands height and speed: half of the way accelerates, half of it brakes."""
        height = self._station.document.motion.lift_height
        duration = DEFAULT_TRIAL.time_of(height)
        share = min(1.0, (step + 1) * STEP / duration)
        left = min(share, 1.0 - share)
        way = 2.0 * left * left
        self.data.ctrl[self._index.height] = height * (way if share < 0.5 else 1.0 - way)
        self.data.ctrl[self._index.rise] = 4.0 * height * left / duration

    def _hold(self, target: int) -> Outcome:
        self.data.ctrl[self._index.rise] = 0.0
        touching = (True, True)
        for _ in range(round(DEFAULT_TRIAL.hold_time / DEFAULT_TRIAL.poll)):
            touching = self._advance(target)
            if not any(touching):
                return Outcome.DROPPED
        return Outcome.LIFTED if all(touching) else Outcome.DROPPED

    def _advance(self, target: int, lifted: int | None = None) -> tuple[bool, bool]:
        """Steps to the next look at the contacts.

        Args:
            target: the body.
            lifted: steps of the lift before these; None if the hand stands.

        Returns:
            Whether each finger touches the target.

        Raises:
            FloatingPointError: the state is not finite any more.
        """
        if lifted is None:
            self._mj.mj_step(self.model, self.data, nstep=self._steps)
        else:
            for k in range(lifted, lifted + self._steps):
                self._rise(k)
                self._mj.mj_step(self.model, self.data)
        if not np.isfinite(self.data.qpos).all():
            raise FloatingPointError
        contact = self.data.contact
        bodies = self.model.geom_bodyid[contact.geom[contact.dist < 0.0]]
        met = bodies[(bodies == target).any(axis=1)]
        left, right = ((met == finger).any() for finger in self._index.fingers)
        return bool(left), bool(right)

    def _overlap(self, instance: str) -> Outcome | None:
        """What the open hand overlaps."""
        self._mj.mj_fwdPosition(self.model, self.data)
        contact = self.data.contact
        geoms = contact.geom[contact.dist < -TOUCHING]
        geoms = geoms[np.isin(geoms, self._index.screened).any(axis=1)]
        bodies = set(self.model.geom_bodyid[geoms].ravel().tolist())
        target = self._index.objects[instance]
        if target in bodies:
            return Outcome.COLLISION_TARGET
        if (geoms == self._index.table).any():
            return Outcome.COLLISION_TABLE
        if bodies & set(self._index.objects.values()):
            return Outcome.COLLISION_CLUTTER
        return None

    def _place(self, X_WG: Array) -> None:
        """Brings everything to the start of a trial: first the model, then the state."""
        model, data, hand = self.model, self.data, self._station.hand
        X_WH = hand.X_AH(X_WG)
        model.body_pos[self._index.carrier] = X_WH[:3, 3]
        model.body_quat[self._index.hand] = quaternion_from_rotation(X_WH[:3, :3])
        self._mj.mj_setConst(model, data)
        self._mj.mj_resetData(model, data)
        for name in self._index.objects:
            X_WO = self._X_WO(name)
            data.joint(name).qpos = [*X_WO[:3, 3], *quaternion_from_rotation(X_WO[:3, :3])]
        for finger in hand.fingers:
            data.joint(finger.joint).qpos = finger.open

    def _set_surfaces(self, instance: str, mu: float) -> None:
        """Gives every contact Drake's coefficient 2ab/(a+b), and the pads their stiffness.

        MuJoCo takes the coefficient of the geometry with the higher priority: the hand's with the
        target, the others' with hand and target. With the table each piece has its own pair.
        """
        model, index = self.model, self._index
        model.geom_friction[index.hand_geoms, 0] = mu
        model.geom_friction[index.palm_geoms, 0] = combined(mu, HAND_FRICTION)
        for name, geoms in index.pieces.items():
            own = mu if name == instance else self._scene.entry(name).friction
            model.geom_priority[geoms] = 0 if name == instance else 2
            model.geom_friction[geoms, 0] = combined(own, mu)
            with_table = combined(own, self._station.document.table.friction)
            model.pair_friction[index.pairs[name], :2] = with_table
        self._set_pads(index.objects[instance])

    def _set_pads(self, target: int) -> None:
        """A sphere bears its share of the pad's front times modulus over half the thickness.

        MuJoCo's stiffness is one of acceleration: a force is that over a regularization R, which
        follows from the impedance d and from what the two bodies together would accelerate by.
        """
        width, thickness, length = numbers(PAD_SIZE)
        share = width * length / math.prod(GRID)
        force_stiffness = PAD_MODULUS / (thickness / 2) * share
        regularization = PAD_RATE**2 / force_stiffness
        for finger, spheres in zip(self._index.fingers, self._index.spheres, strict=True):
            mobility = self.model.body_invweight0[[finger, target], 0].sum()
            d = mobility / (mobility + regularization)
            self.model.geom_solimp[spheres, :2] = d
            # With a constant impedance MuJoCo divides both by it.
            self.model.geom_solref[spheres] = -d * PAD_RATE**2, -d * 2.0 * PAD_DAMPING * PAD_RATE

    def _screen(self, on: bool) -> None:
        """Has pads of full size collide, or else what they consist of."""
        self.model.geom_contype[self._index.full] = int(on)
        self.model.geom_contype[self._index.pad_parts] = int(not on)

    def _center(self, body: int) -> Array:
        """Centre of mass (3,) in the world [m]."""
        return np.array(self.data.xipos[body])

    def _X_WO(self, name: str) -> Array:
        return self._station.document.X_WS.matrix() @ self._scene.X_SO(name)


@dataclass(frozen=True, eq=False)
class _Index:
    """Where things are in the arrays of a model; geometries but for `table` as arrays of numbers.

    Attributes:
        objects: bodies by instance.
        pieces, pairs: geometries, and pairs with the table, by instance.
        carrier, hand, fingers: bodies.
        table: geometry.
        finger_dofs, finger_drives: of the fingers' joints.
        towards_closed: (2,) signs of their velocities while the hand closes.
        height, rise: drives of the lift.
        hand_geoms: all of the hand.
        palm_geoms: those of its body.
        spheres: of each finger.
        pad_parts: spheres and backs.
        full: pads of full size.
        screened: of the hand where it is screened.
    """

    objects: dict[str, int]
    pieces: dict[str, Array]
    pairs: dict[str, Array]
    carrier: int
    hand: int
    fingers: tuple[int, int]
    table: int
    finger_dofs: list[int]
    finger_drives: list[int]
    towards_closed: Array
    height: int
    rise: int
    hand_geoms: Array
    palm_geoms: Array
    spheres: tuple[Array, Array]
    pad_parts: Array
    full: Array
    screened: Array

    @classmethod
    def of(cls, model: Any, scene: Scene, station: Station) -> _Index:
        """Looks them up by their names."""
        names = [model.geom(k).name for k in range(model.ngeom)]
        pairs = [model.pair(k).name for k in range(model.npair)]
        one, other = station.hand.fingers
        joints = (one.joint, other.joint)
        full = _beginning(names, f"{FULL}/")
        parts = np.concatenate([_beginning(names, f"{word}/") for word in (SPHERE, BACK)])
        boxes = _beginning(names, f"{BOX}/")
        return cls(
            objects={name: model.body(name).id for name in scene.instances},
            pieces={name: _beginning(names, f"{name}/") for name in scene.instances},
            pairs={name: _beginning(pairs, f"{name}/") for name in scene.instances},
            carrier=model.body(CARRIER).id,
            hand=model.body(station.hand.body).id,
            fingers=(model.body(one.body).id, model.body(other.body).id),
            table=model.geom(TABLE).id,
            finger_dofs=[int(model.joint(name).dofadr[0]) for name in joints],
            finger_drives=[model.actuator(name).id for name in joints],
            towards_closed=np.sign([f.closed - f.open for f in station.hand.fingers]),
            height=model.actuator(HEIGHT).id,
            rise=model.actuator(RISE).id,
            hand_geoms=np.concatenate((parts, boxes, full)),
            palm_geoms=_beginning(names, f"{BOX}/{station.hand.body}/"),
            spheres=(
                _beginning(names, f"{SPHERE}/{one.body}/"),
                _beginning(names, f"{SPHERE}/{other.body}/"),
            ),
            pad_parts=parts,
            full=full,
            screened=np.concatenate((boxes, full)),
        )


def _beginning(names: list[str], word: str) -> Array:
    """Numbers of the names that begin so."""
    return np.array([k for k, name in enumerate(names) if name.startswith(word)], dtype=int)


def combined(a: float, b: float) -> float:
    """Drake's coefficient for two surfaces."""
    return 2.0 * a * b / (a + b) if a + b > 0.0 else 0.0
