"""A scene under the hand in MuJoCo: its model, how a trial begins, its commands and its contacts.

The model is compiled once. Each trial resets its state, surfaces and pad stiffness.
"""

from __future__ import annotations

import importlib
import importlib.util
from collections.abc import Callable, Iterable
from dataclasses import replace
from typing import Any, TypeVar

import numpy as np
from pydrake.multibody.tree import BodyIndex

from burg_drake.core import (
    Array,
    Indices,
    InvalidInputError,
    MissingDependencyError,
    quaternion_from_rotation,
)
from burg_drake.export import (
    HAND_CARRIER_BODY,
    HAND_SHAPE_PREFIX,
    LIFT_JOINT,
    PAD_BACKING_PREFIX,
    PAD_SPHERE_PREFIX,
    Layout,
    MjcfBodyNames,
    link_name,
    pad_contact,
    trial_mjcf,
)
from burg_drake.objects import hull_corners
from burg_drake.scene import SceneLike, as_scene
from burg_drake.simulation.contacts import BodyContact
from burg_drake.simulation.object_motions import MovingBody
from burg_drake.simulation.settings import TrialSettings
from burg_drake.simulation.trial_execution import OtherTouched
from burg_drake.station import Engine, HandDescription, StationLike, as_station, is_on_table


def require_mujoco() -> None:
    """Requires the package; the error says how to install it.

    Raises:
        MissingDependencyError: it is not installed.
    """
    if importlib.util.find_spec("mujoco") is None:
        raise MissingDependencyError(
            "engine mujoco needs the package mujoco; install it with"
            " pip install 'burg-drake[mujoco]'"
        )


def load_mujoco() -> Any:
    """Imports the module `mujoco`, without its log file; warnings are read from its data.

    Raises:
        MissingDependencyError: it is not installed.
    """
    require_mujoco()
    module = importlib.import_module("mujoco")
    module.set_mju_user_warning(lambda message: None)
    return module


class ModelIndex:
    """Numbers of bodies, geoms and joints in a model.

    Args:
        model: the MuJoCo model.
        parts: links and fingers of the hand.

    Attributes:
        objects: movable bodies, by the names of instances.
        fixed: fixed bodies by name, including the table.
        geoms: geoms of both, by name.
        pairs: contact pairs with the table's plane, by name.
        table: body of the table's box.
        carrier, hand, fingers: bodies.
        spheres: geoms of each finger's pad.
        finger_geoms: geoms of both fingers.
        palm: geoms of the hand's body.
        lift_joint, lift_qpos, lift_dof: the carrier's joint, its position and its velocity.
        lift_position_servo, lift_speed_servo: servos of the carrier.
        finger_qpos, finger_dofs, finger_servos: positions, velocities and servos of both fingers.
    """

    def __init__(self, model: Any, parts: HandDescription) -> None:
        bodies = {model.body(k).name: k for k in range(model.nbody)}
        geoms = [model.geom(k).name for k in range(model.ngeom)]
        pairs = [model.pair(k).name for k in range(model.npair)]
        self.objects = _name_bodies(bodies, MjcfBodyNames.object)
        self.fixed = _name_bodies(bodies, MjcfBodyNames.fixed)
        self.table = self.fixed[MjcfBodyNames.table]
        prefixes = {name: f"{MjcfBodyNames.object} {name} " for name in self.objects}
        self.pairs = {n: _numbers_with_prefix(pairs, words) for n, words in prefixes.items()}
        prefixes |= {name: f"{MjcfBodyNames.fixed} {name} " for name in self.fixed}
        self.geoms = {n: _numbers_with_prefix(geoms, words) for n, words in prefixes.items()}
        names = [finger.name for finger in parts.fingers]
        self.carrier = bodies[HAND_CARRIER_BODY]
        self.hand = bodies[link_name(parts.body.name)]
        self.fingers = [bodies[link_name(name)] for name in names]
        self.spheres = [_numbers_with_prefix(geoms, f"{PAD_SPHERE_PREFIX} {n} ") for n in names]
        of_fingers = [
            _numbers_with_prefix(geoms, f"{word} {name} ")
            for name in names
            for word in (PAD_SPHERE_PREFIX, PAD_BACKING_PREFIX, HAND_SHAPE_PREFIX)
        ]
        self.finger_geoms = np.concatenate(of_fingers)
        self.palm = _numbers_with_prefix(geoms, f"{HAND_SHAPE_PREFIX} {parts.body.name} ")
        lift = model.joint(LIFT_JOINT.name)
        self.lift_joint, self.lift_qpos = int(lift.id), int(lift.qposadr[0])
        self.lift_dof = int(lift.dofadr[0])
        self.lift_position_servo = int(model.actuator(LIFT_JOINT.name).id)
        self.lift_speed_servo = int(model.actuator(LIFT_JOINT.speed).id)
        joints = [link_name(finger.joint) for finger in parts.document.fingers]
        self.finger_qpos = np.array([model.joint(name).qposadr[0] for name in joints])
        self.finger_dofs = np.array([model.joint(name).dofadr[0] for name in joints])
        self.finger_servos = np.array([model.actuator(name).id for name in joints])


def _name_bodies(bodies: dict[str, int], word: str) -> dict[str, int]:
    begin = f"{word} "
    return {name[len(begin) :]: k for name, k in bodies.items() if name.startswith(begin)}


def _numbers_with_prefix(names: list[str], words: str) -> Indices:
    """Indices of the names that begin with a prefix."""
    return np.array([k for k, name in enumerate(names) if name.startswith(words)], dtype=np.intp)


def summarize_contacts(model: Any, data: Any, shares: Array, table: int) -> list[BodyContact]:
    """Contacts, one per pair of touching bodies.

    Args:
        model, data: MuJoCo's model and data, after a step with elliptic cones.
        shares: (geoms,) contact area that each geom represents [m^2]; 0 for geoms without one.
        table: the body to which the world's own geoms belong.
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
        rows = np.flatnonzero((pair.reshape(-1) == k) & (soft > 0.0))
        pads = np.take_along_axis(geoms[rows], share[rows].argmax(axis=1)[:, None], axis=1)
        area[k] = shares[np.unique(pads)].sum()
    return [
        BodyContact(BodyIndex(int(a)), BodyIndex(int(b)), force[k], float(area[k]))
        for k, (a, b) in enumerate(pairs)
    ]


def _forces(data: Any, contacts: Indices) -> Array:
    """Contact forces (N, 3) on the second geom in the world; 0 without contact."""
    address = np.asarray(data.contact.efc_address)[contacts]
    solved = address >= 0
    frame = np.asarray(data.contact.frame)[contacts[solved]].reshape(-1, 3, 3)
    in_frame = np.asarray(data.efc_force)[address[solved, None] + np.arange(3)]
    f_W = np.zeros((len(contacts), 3))
    f_W[solved] = np.einsum("nij,ni->nj", frame, in_frame)
    return f_W


class MujocoWorld:
    """The world of trials in one scene.

    Bodies are identified by their numbers in the model, as in Drake. Movable objects are never
    locked: all objects, or only `alone`.

    Args:
        scene, station: the scene and the station.
        layout: poses of the bodies in the world.
        hand: the station's hand.
        engine: engine with the time step.
        settings: phases of a trial.
        alone: the only object that can move; None if all can.
        shown: called at each contact check.

    Attributes:
        model, data: MuJoCo's model and data.
        index: numbers of bodies, geoms and joints in the model.
        engine: as given.
        settings: as given, but `steady_time` is at least 0.1 s.
        free: bodies that can move, by name.
        standing: bodies that can move only in another world, by name.
        fixed: bodies that never move, by name, including the table.
        table: body of the table.
        robot, robot_bodies: bodies of the hand.
        fingers: bodies of the two fingers.
        body_names: display names of all bodies.
        hand_document: the hand's document.
        robot_meets_hull: False: no hull replaces a target.

    Raises:
        InvalidInputError: MuJoCo refuses the model.
    """

    robot_meets_hull = False

    def __init__(
        self,
        scene: SceneLike,
        station: StationLike,
        layout: Layout,
        hand: HandDescription,
        *,
        engine: Engine,
        settings: TrialSettings,
        alone: str | None = None,
        shown: Callable[[MujocoWorld], None] | None = None,
    ) -> None:
        scene, station = as_scene(scene), as_station(station)
        self._mj = mj = load_mujoco()
        self._scene, self._station, self._parts = scene, station, hand
        self._shown = shown
        # With 0.05 s, 1 of 60 grasps is decided early and wrongly.
        steady_time = max(settings.steady_time, 0.1)
        self.settings = replace(settings, steady_time=steady_time)
        self.engine, step = engine, engine.time_step
        self.hand_document = hand.document
        on_table = {name for name in scene.instances if is_on_table(scene, station, name)}
        xml = trial_mjcf(layout, hand, step=step, on_table=on_table, alone=alone)
        try:
            self.model: Any = mj.MjModel.from_xml_string(xml)
        except ValueError as error:
            raise InvalidInputError(
                f"{scene.path}: MuJoCo cannot load the scene: {' '.join(str(error).split())}"
            ) from error
        self.data: Any = mj.MjData(self.model)
        self._scratch: Any = mj.MjData(self.model)
        self.index = index = ModelIndex(self.model, hand)
        could_move = {name: index.objects[name] for name in scene.instances}
        moving = (alone,) if alone is not None else tuple(scene.instances)
        self.free = {name: BodyIndex(could_move[name]) for name in moving}
        self.standing = {n: BodyIndex(k) for n, k in could_move.items() if n not in moving}
        self.fixed = {name: BodyIndex(k) for name, k in index.fixed.items()}
        self.table = BodyIndex(index.table)
        self.fingers = (BodyIndex(index.fingers[0]), BodyIndex(index.fingers[1]))
        self.robot_bodies = (BodyIndex(index.hand), *self.fingers)
        self.robot = frozenset(self.robot_bodies)
        self._mass, self._inertia = self.model.body_mass.copy(), self.model.body_inertia.copy()
        self._shares = np.zeros(self.model.ngeom)
        for finger, spheres in zip(hand.fingers, index.spheres, strict=True):
            self._shares[spheres] = finger.front.area / len(spheres)
        self._friction_of_palm = np.array([s.friction for s in hand.body.shapes])
        self._standing = frozenset(self.standing.values())
        named = {**self.free, **self.standing, **self.fixed}
        links = [hand.body.name, *(finger.name for finger in hand.fingers)]
        self.body_names = {index: name for name, index in named.items()}
        self.body_names |= dict(zip(self.robot_bodies, links, strict=True))
        self._corners: dict[BodyIndex, Array] = {}
        self._usable = not self.standing or not self._may_lean(moving[0])

    def is_usable(self) -> bool:
        """Whether trials can begin here: False if the target may lean on a locked object."""
        return self._usable

    def invalidate(self) -> None:
        """Does nothing, as every trial resets the whole world."""

    def prepare(
        self,
        instance: str,
        X_WG: Array,
        closed: float | None,
        direction_W: Array,
        *,
        friction: float | None,
        mass: float | None,
    ) -> None:
        """Resets model and state to the start of a trial.

        Args:
            instance: the target.
            X_WG: (4, 4) start pose of the grasp frame in the world.
            closed: how far the fingers are closed at the start, from 0 (open) to 1 (pads together),
                from where they close further; None if they stay open.
            direction_W: (3,) unit vector of the hand's first motion.
            friction, mass: the target's, if not the library's.
        """
        model, data, hand = self.model, self.data, self._station.hand
        target = self.index.objects[instance]
        model.body_mass[:], model.body_inertia[:] = self._mass, self._inertia
        if mass is not None:
            model.body_inertia[target] *= mass / self._mass[target]
            model.body_mass[target] = mass
        X_WH = hand.X_AH(X_WG)
        model.body_quat[self.index.hand] = quaternion_from_rotation(X_WH[:3, :3])
        self._place_lift(X_WH[:3, 3], direction_W)
        self._mj.mj_resetData(model, data)
        for at, finger in zip(self.index.finger_qpos, hand.fingers, strict=True):
            data.qpos[at] = finger.position(closed or 0.0)
        self._command_fingers(-1.0 if closed is None else 1.0)
        if closed is not None:
            data.qvel[self.index.finger_dofs] = data.ctrl[self.index.finger_servos]
        own = self._scene.entry(instance).friction
        self._set_surfaces(instance, own if friction is None else friction)
        self._set_pads(target)
        self._mj.mj_forward(model, data)

    def close_hand(self) -> None:
        """Closes the fingers."""
        self._command_fingers(1.0)

    def turn_lift(self, direction_W: Array) -> None:
        """Turns the carrier's joint to another direction (3,), at rest at the hand's current place;
        all other bodies keep moving."""
        data, index = self.data, self.index
        self._mj.mj_kinematics(self.model, data)
        self._place_lift(np.array(data.xpos[index.hand]), direction_W)
        data.qpos[index.lift_qpos] = data.qvel[index.lift_dof] = 0.0
        self.command_lift(0.0, 0.0, 0.0)

    def command_lift(self, travelled: float, speed: float, acceleration: float) -> None:
        """Commands position [m] and speed [m/s] of the carrier's joint after the next step, and its
        acceleration until then [m/s^2]."""
        self.data.qfrc_applied[self.index.lift_dof] = self.carried_mass * acceleration
        self.data.ctrl[self.index.lift_position_servo] = travelled
        self.data.ctrl[self.index.lift_speed_servo] = speed

    def advance(self, steps: int) -> None:
        """Advances the simulation with the current commands."""
        self._mj.mj_step(self.model, self.data, nstep=steps)

    def moving_body(self, body: BodyIndex) -> MovingBody:
        """State of a free body."""
        # From positions and speeds, as poses of bodies are those before the last step.
        model, data, k = self.model, self.data, int(body)
        at, dof = model.jnt_qposadr[model.body_jntadr[k]], model.body_dofadr[k]
        R_WB, R_BI = np.zeros((3, 3)), np.zeros((3, 3))
        self._mj.mju_quat2Mat(R_WB.ravel(), data.qpos[at + 3 : at + 7])
        self._mj.mju_quat2Mat(R_BI.ravel(), model.body_iquat[k])
        p_BCm_W, axes = R_WB @ model.body_ipos[k], R_WB @ R_BI
        w_W, v_WCm = R_WB @ data.qvel[dof + 3 : dof + 6], np.zeros(3)
        self._mj.mju_cross(v_WCm, w_W, p_BCm_W)
        return MovingBody(
            float(model.body_mass[k]),
            (axes * model.body_inertia[k]) @ axes.T,
            data.qpos[at : at + 3] + p_BCm_W,
            data.qvel[dof : dof + 3] + v_WCm,
            w_W,
        )

    def shift(self, body: BodyIndex, distance_W: Array) -> None:
        """Shifts a free body by a distance (3,) [m]."""
        at = self.model.jnt_qposadr[self.model.body_jntadr[int(body)]]
        self.data.qpos[at : at + 3] += distance_W

    def push(self, body: BodyIndex, force_W: Array, torque_W: Array) -> None:
        """Applies a force (3,) at the centre of mass of a body [N] and a torque (3,) [N m], and
        none to others, until the next call."""
        self.data.xfrc_applied[:] = 0.0
        self.data.xfrc_applied[int(body)] = *force_W, *torque_W

    @property
    def gravity(self) -> Array:
        """(3,) gravity in the world [m/s^2]."""
        return np.array(self.model.opt.gravity)

    @property
    def time(self) -> float:
        """Time since the start of the trial [s]."""
        return float(self.data.time)

    def read_contacts(self) -> list[BodyContact]:
        """Current contacts, one per pair of bodies; areas are those of the pads.

        Raises:
            OtherTouched: a moving body meets a body that only the complete world lets move.
        """
        contacts = summarize_contacts(self.model, self.data, self._shares, int(self.table))
        if any(c.body_A in self._standing or c.body_B in self._standing for c in contacts):
            raise OtherTouched
        if self._shown is not None:
            self._shown(self)
        return contacts

    def state(self) -> Array:
        """The state that `restore_state` restores."""
        kind = self._mj.mjtState.mjSTATE_INTEGRATION
        state = np.zeros(self._mj.mj_stateSize(self.model, kind))
        self._mj.mj_getState(self.model, self.data, state, kind)
        return state

    def restore_state(self, time: float, state: Array) -> None:
        """Restores a state and its time [s]."""
        self._mj.mj_setState(self.model, self.data, state, self._mj.mjtState.mjSTATE_INTEGRATION)
        self._mj.mj_forward(self.model, self.data)

    def with_neighbours(self, bodies: Iterable[BodyIndex]) -> set[BodyIndex]:
        """The bodies themselves, as none is locked."""
        return set(bodies)

    def release(self, released: set[BodyIndex], still: set[BodyIndex]) -> None:
        """Does nothing, as no body is locked."""

    def finger_speed(self) -> float:
        """Speed of the faster finger [m/s]."""
        return float(np.abs(self.data.qvel[self.index.finger_dofs]).max())

    def robot_positions(self, model: str) -> Array | None:
        """Positions of `hand` and `lift`, in the order of a station diagram."""
        if model == "lift":
            return np.array([self.travelled()])
        fingers = np.array(self.data.qpos[self.index.finger_qpos])
        return self.in_plant_order(fingers) if model == "hand" else None

    def in_plant_order(self, fingers: Array) -> Array:
        """Positions (2,) of both fingers in the order of a station diagram."""
        return fingers[list(self._parts.plant_order)]

    def travelled(self) -> float:
        """Position of the carrier's joint [m]."""
        return float(self.data.qpos[self.index.lift_qpos])

    def X_WG(self) -> Array:
        """Grasp frame (4, 4) in the world."""
        X_WG: Array = self.X_WB(self.robot_bodies[0]) @ self._station.hand.X_HG.matrix()
        return X_WG

    def X_WB(self, body: BodyIndex) -> Array:
        """Pose (4, 4) of a body in the world."""
        X_WB, k = np.eye(4), int(body)
        X_WB[:3, :3] = self.data.xmat[k].reshape(3, 3)
        X_WB[:3, 3] = self.data.xpos[k]
        return X_WB

    def center(self, body: BodyIndex) -> Array:
        """Centre of mass (3,) of a body in the world [m]."""
        return np.array(self.data.xipos[int(body)])

    def corners(self, body: BodyIndex) -> Array:
        """(N, 3) corners of the convex hull of a free object in its frame [m]; read once."""
        if body not in self._corners:
            entry = self._scene.entry(self.body_names[body])
            self._corners[body] = hull_corners(self._scene.library, entry)
        return self._corners[body]

    def _command_fingers(self, closing: float) -> None:
        """Commands the fingers to close (1), or to open (-1) against their stops."""
        self.data.ctrl[self.index.finger_servos] = closing * self.closing_speeds

    def _place_lift(self, p_WH: Array, direction_W: Array) -> None:
        """Places the carrier, with its joint along a direction (3,)."""
        self.model.body_pos[self.index.carrier] = p_WH
        self.model.jnt_axis[self.index.lift_joint] = direction_W
        self._mj.mj_setConst(self.model, self._scratch)

    def _set_surfaces(self, instance: str, mu: float) -> None:
        """Sets Drake's friction coefficients 2ab/(a+b) for contacts with the target, the hand or
        the table. Other objects meet each other with the coefficient that they have with the
        target."""
        # MuJoCo uses the surface of the geom with the higher priority; the target has 0.
        hand_priority = 1
        others_priority = 2  # Priority of free objects other than the target.
        fixed_priority = 3  # Priority of bodies that do not move.
        model, index = self.model, self.index
        own, table = self.own_friction(instance)
        model.geom_friction[:, 0] = np.where(np.isnan(own), mu, combined_friction(own, mu))
        for geoms in (index.finger_geoms, index.palm):
            model.geom_priority[geoms] = hand_priority
        for name, geoms in index.geoms.items():
            others = fixed_priority if name in index.fixed else others_priority
            model.geom_priority[geoms] = 0 if name == instance else others
        for name, pairs in index.pairs.items():
            known = mu if name == instance else self._scene.entry(name).friction
            model.pair_friction[pairs, :2] = combined_friction(known, table)

    def own_friction(self, instance: str) -> tuple[Array, float]:
        """Friction coefficients that `combined_friction` combines with the target's.

        Args:
            instance: the target.

        Returns:
            (geoms,) coefficients; NaN for fingers and target, for which the target's counts as it
            is. The coefficient of the table's plane.
        """
        index, table = self.index, self._station.document.table.friction
        own = np.full(self.model.ngeom, np.nan)
        own[index.palm] = self._friction_of_palm
        for name, geoms in index.geoms.items():
            known = name in self._scene.instances or name in self._scene.background
            if name != instance:
                own[geoms] = self._scene.entry(name).friction if known else table
        return own, table

    def _set_pads(self, target: int) -> None:
        """Sets the stiffness of the pads, which in MuJoCo depends on the body that they touch."""
        model = self.model
        mobility = float(model.body_invweight0[target, 0])
        contacts = self.pad_contacts(mobility, model.body_invweight0[self.index.fingers, 0])
        for spheres, contact in zip(self.index.spheres, contacts, strict=True):
            model.geom_solref[spheres] = contact[:2]
            model.geom_solimp[spheres, :2] = contact[2]

    def pad_contacts(self, mobility: float, fingers_mobility: Array) -> Array:
        """Stiffness, damping and impedance (2, 3) of the pads' contact with a target; see
        `pad_contact`.

        Args:
            mobility: inverse mass of the target [1/kg].
            fingers_mobility: (2,) those of the fingers [1/kg].
        """
        contacts = []
        for finger, own in zip(self._parts.fingers, fingers_mobility.tolist(), strict=True):
            solref, impedance = pad_contact(finger.front, own + mobility, self.engine.time_step)
            contacts.append((*solref, impedance))
        return np.array(contacts)

    @property
    def carried_mass(self) -> float:
        """Mass that the carrier's joint accelerates, with the inertia of its drive [kg]."""
        index = self.index
        inertia = self.model.dof_armature[index.lift_dof]
        return float(inertia + self.model.body_subtreemass[index.carrier])

    @property
    def sphere_areas(self) -> Array:
        """(2,) contact area that a sphere of each pad stands for [m^2]."""
        return np.array([self._shares[spheres[0]] for spheres in self.index.spheres])

    @property
    def closing_speeds(self) -> Array:
        """(2,) signed speeds with which the joints of the fingers close [m/s]."""
        hand = self._station.hand
        return np.array([np.sign(f.closed - f.open) * hand.closing_speed for f in hand.fingers])

    def _may_lean(self, instance: str) -> bool:
        """Whether the target is so close to a movable object that it may lean on it."""
        leaning_distance = 0.001  # Metres.
        model, data, mj = self.model, self._scratch, self._mj
        mj.mj_resetData(model, data)
        mj.mj_kinematics(model, data)
        fromto = np.zeros(6)
        others = [g for name in self.standing for g in self.index.geoms[name]]
        return any(
            mj.mj_geomDistance(model, data, int(one), int(other), leaning_distance, fromto)
            < leaning_distance
            for one in self.index.geoms[instance]
            for other in others
        )


Coefficient = TypeVar("Coefficient", float, Array)


def combined_friction(a: Coefficient, b: float) -> Coefficient:
    """Friction coefficient that Drake uses for two surfaces."""
    both: Coefficient = 2.0 * a * b / np.maximum(a + b, np.finfo(float).tiny)
    return both
