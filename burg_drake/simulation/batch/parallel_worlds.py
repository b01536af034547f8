"""Steps many trials of one target at once on a device."""

from __future__ import annotations

import copy
from collections.abc import Callable
from dataclasses import dataclass, fields

import mujoco
import mujoco_warp
import numpy as np
import warp as wp
from mujoco_warp import OverflowType
from scipy.spatial.transform import Rotation

from burg_drake.core import Array, DeviceError, Indices, one_line
from burg_drake.simulation.batch import start_kernels, trial_kernels
from burg_drake.simulation.batch.device_arrays import (
    IDLE_PHASE,
    PER_WORLD,
    Bodies,
    Constants,
    Counts,
    Masses,
    Trials,
    WorldStates,
    element_types,
    physics_of,
)
from burg_drake.simulation.batch.fixed_order import ROWS_PER_CONTACT, fixed_order
from burg_drake.simulation.batch.trial_starts import End, TrialEnds, TrialStarts
from burg_drake.simulation.batch.warp_device import record_compilation
from burg_drake.simulation.mujoco_world import MujocoWorld

CHECKS_PER_LOOK = 10
"""Contact checks between two looks at how many trials are done."""
FATAL_OVERFLOWS = (
    OverflowType.NEFC
    | OverflowType.BROADPHASE
    | OverflowType.NARROWPHASE
    | OverflowType.CCD
    | OverflowType.EPA_HORIZON
)
"""Overflows that make a world wrong. The limits of the solver's iterations are not among them: the
engine on the CPU has them, too."""
SOLVER_TOLERANCE = 1e-14
"""As in the model, see `add_trial_options`; MuJoCo Warp would raise it to 1e-6."""


@dataclass(frozen=True)
class Room:
    """Room for the contacts of a world.

    Attributes:
        rows: number of constraint rows, three a contact; a power of two, as kernels are compiled
            for it.
        contacts: contacts, or pairs of geoms that are near, a world on the average.
    """

    rows: int = 512
    contacts: int = 192

    @classmethod
    def for_counts(cls, rows: int, contacts: float) -> Room:
        """Room for this many, with a reserve.

        Args:
            rows: largest number of rows of a world.
            contacts: largest number of contacts of all worlds, divided by that of worlds.
        """
        reserve = 1.25
        enough = 64
        while enough < reserve * rows:
            enough *= 2
        return cls(
            enough, max(int(np.ceil(reserve * contacts)) + 16, enough // ROWS_PER_CONTACT + 1)
        )


class ParallelWorlds:
    """Worlds of the target alone, or in which all objects can move.

    Args:
        world: the world on the CPU that they repeat.
        instance: the target.
        X_WO: (4, 4) its pose at the start.
        device: name of the device.
        approaches: whether trials begin at the pregrasp.
    """

    def __init__(
        self,
        world: MujocoWorld,
        instance: str,
        X_WO: Array,
        device: str,
        *,
        approaches: bool,
    ) -> None:
        self._device, self._world, self._instance = device, world, instance
        # Constants of the model depend a little on the pose of the hand, and here on nothing else.
        world.prepare(instance, np.eye(4), 0.0, np.array((0.0, 0.0, 1.0)), friction=None, mass=None)
        self._model = model = _without_gravity(world.model)
        target = world.index.objects[instance]
        self._target_mass = float(model.body_mass[target])
        self._mobility = float(model.body_invweight0[target, 0])
        self._fingers_mobility = np.array(model.body_invweight0[world.index.fingers, 0])
        self.others = [body for name, body in world.free.items() if name != instance]
        self._rows, self._contacts = 0, 0.0  # Largest numbers so far, see `Room`.
        self._limits: dict[Room, int] = {}  # Worlds that fit, where fewer did than asked for.
        with wp.ScopedDevice(device):
            self._constants = _constants(world, instance, X_WO, approaches=approaches)
            self._bodies = self._read_bodies()
            self._masses = self._read_masses()

    def run(
        self,
        starts: TrialStarts,
        worlds: int,
        progress: Callable[[], None] | None = None,
    ) -> TrialEnds:
        """Executes trials; those with more contacts than there is room for again, with more.

        Args:
            starts: the trials, at least one.
            worlds: largest number of worlds.
            progress: called several times a second.

        Raises:
            DeviceError: the device fails, or has not even memory for a few worlds.
        """
        first = 256  # Trials that are executed with room enough for most objects.
        every, ends = np.arange(len(starts)), _empty_ends(len(starts), len(self.others))
        if self._rows == 0:
            self._run_rows(starts, every[:first], ends, worlds, Room(), progress)
            every = every[first:]
        if len(every):
            room = Room.for_counts(self._rows, self._contacts)
            self._run_rows(starts, every, ends, worlds, room, progress)
        for factor in (1, 2):
            rows = np.flatnonzero(ends.end == End.OVERFLOW)
            if len(rows):
                usual = Room()
                room = Room.for_counts(
                    factor * max(self._rows, usual.rows),
                    factor * max(self._contacts, usual.contacts),
                )
                self._run_rows(starts, rows, ends, worlds, room, progress)
        return ends

    def _run_rows(
        self,
        starts: TrialStarts,
        rows: Indices,
        ends: TrialEnds,
        worlds: int,
        room: Room,
        progress: Callable[[], None] | None,
    ) -> None:
        """Executes some of the trials and writes how they end; in fewer worlds where there is no
        memory for so many, and so from then on."""
        few = 16
        worlds = min(worlds, len(rows), self._limit(room, worlds))
        while True:
            batch = None  # so that its memory is free
            try:
                with wp.ScopedDevice(self._device):
                    batch = _Batch(self, starts.at(rows), worlds, room)
                    batch.run(progress)
                    break
            except RuntimeError as error:
                text = str(error)
                has_no_memory = "Failed to allocate" in text or "out of memory" in text
                if not has_no_memory or worlds <= few:
                    raise DeviceError(f"device {self._device} failed: {one_line(error)}") from error
                worlds //= 2
                self._limits[room] = worlds
        self._rows = max(self._rows, int(batch.counts.rows.numpy()[0]))
        contacts = float(batch.counts.contacts.numpy()[0]) / worlds
        self._contacts = max(self._contacts, contacts)
        batch.write_ends(ends, rows)

    def _limit(self, room: Room, worlds: int) -> int:
        """Largest number of worlds that have fit into the memory with this room or less."""
        less = [
            limit
            for other, limit in self._limits.items()
            if other.rows <= room.rows and other.contacts <= room.contacts
        ]
        return min(less, default=worlds)

    def pads(self, mass: Array) -> Array:
        """Contact of the pads (N, 2, 3) with targets of masses (N,), see
        `MujocoWorld.pad_contacts`."""
        masses, rows = np.unique(mass, return_inverse=True)
        contacts = [
            self._world.pad_contacts(self._mobility * self._target_mass / m, self._fingers_mobility)
            for m in masses.tolist()
        ]
        return np.array(contacts).reshape(-1, 2, 3)[rows]

    def model_with(self, worlds: int) -> tuple[mujoco.MjModel, mujoco_warp.Model]:
        """The model on the CPU and on the device."""
        model = mujoco_warp.put_model(self._model, batch_sizes=dict.fromkeys(PER_WORLD, worlds))
        model.opt.tolerance.fill_(SOLVER_TOLERANCE)
        model.opt.warn_overflow = 0
        return self._model, model

    @property
    def shared(self) -> tuple[Constants, Bodies, Masses]:
        """What all trials share."""
        return self._constants, self._bodies, self._masses

    @property
    def sphere_count(self) -> int:
        """Number of spheres of both pads."""
        return sum(map(len, self._world.index.spheres))

    def _read_bodies(self) -> Bodies:
        world, index, model = self._world, self._world.index, self._model
        of_geom = np.array(model.geom_bodyid)
        of_geom[of_geom == 0] = index.table
        sphere, finger = np.full(model.ngeom, -1), np.zeros(model.ngeom, dtype=int)
        sphere[np.concatenate(index.spheres)] = np.arange(self.sphere_count)
        for k, spheres in enumerate(index.spheres):
            finger[spheres] = k
        own, table = world.own_friction(self._instance)
        pair_friction = np.full(model.npair, -1.0)
        pair_friction[index.pairs.get(self._instance, [])] = table
        flags = np.zeros((2, model.nbody), dtype=int)
        for row, named in enumerate((world.standing, world.fixed)):
            flags[row, [int(body) for body in named.values()]] = 1
        bodies = Bodies()
        for name, values in {
            "of_geom": of_geom,
            "standing": flags[0],
            "fixed": flags[1],
            "sphere": sphere,
            "finger": finger,
        }.items():
            setattr(bodies, name, wp.array(values, dtype=int))
        bodies.friction = wp.array(np.where(np.isnan(own), -1.0, own), dtype=wp.float64)
        bodies.pair_friction = wp.array(pair_friction, dtype=wp.float64)
        bodies.qpos = wp.array(world.data.qpos, dtype=float)
        bodies.corners = wp.array(world.corners(world.free[self._instance]), dtype=wp.vec3)
        self._read_others(bodies)
        return bodies

    def _read_others(self, bodies: Bodies) -> None:
        """Reads the other bodies that can move, at the start."""
        world, others = self._world, self.others
        X_WO = np.array([world.X_WB(body) for body in others]).reshape(-1, 4, 4)
        center = np.array([world.center(body) for body in others]).reshape(-1, 3)
        corners = [world.corners(body) for body in others]
        lowest = [(c @ X[2, :3]).min() + X[2, 3] for c, X in zip(corners, X_WO, strict=True)]
        bodies.others = wp.array(np.array(others, dtype=int), dtype=int)
        bodies.others_p = wp.array(X_WO[:, :3, 3], dtype=wp.vec3)
        bodies.others_q = wp.array(_quaternions(X_WO[:, :3, :3]), dtype=wp.quat)
        bodies.others_center = wp.array(center, dtype=wp.vec3)
        bodies.others_height = wp.array(center[:, 2] - np.array(lowest), dtype=float)
        flat = np.concatenate([np.zeros((0, 3)), *corners])
        bodies.others_corners = wp.array(flat, dtype=wp.vec3)
        bodies.others_first = wp.array(np.cumsum([0, *map(len, corners)]), dtype=int)

    def _read_masses(self) -> Masses:
        model, target = self._model, self._constants.target
        masses = Masses()
        masses.inertia = wp.vec3(*model.body_inertia[target])
        masses.mobility = wp.vec2(*model.body_invweight0[target])
        dof = self._constants.target_dof
        masses.dof_mobility = wp.spatial_vector(*model.dof_invweight0[dof : dof + 6])
        return masses


class _Batch:
    """Worlds that execute some trials."""

    def __init__(self, worlds: ParallelWorlds, starts: TrialStarts, count: int, room: Room) -> None:
        model, self._model = worlds.model_with(count)
        contacts = max(room.contacts, room.rows // ROWS_PER_CONTACT + 1)
        self._data = mujoco_warp.make_data(model, nworld=count, nconmax=contacts, njmax=room.rows)
        self._physics = physics_of(self._model, self._data)
        self._constants, self._bodies, self._masses = worlds.shared
        others = self._others = len(worlds.others)
        self._trials = _trials(starts, others)
        steady_checks = int(self._constants.steady_checks)
        self._state = _state(count, steady_checks, worlds.sphere_count, others)
        self.counts = Counts()
        for name in element_types(Counts):
            setattr(self.counts, name, wp.zeros(1, dtype=int))
        self._worlds, self._size = count, len(starts)

    def run(self, progress: Callable[[], None] | None) -> None:
        """Executes the trials. The first check also compiles the kernels."""
        self._begin_trials()
        with fixed_order(self._data):  # It also keeps the arrays that the graph uses.
            self._advance()
            record_compilation(wp.get_device())
            with wp.ScopedCapture() as capture:
                self._advance()
            while int(self.counts.done.numpy()[0]) < self._size:
                for _ in range(CHECKS_PER_LOOK):
                    wp.capture_launch(capture.graph)
                if progress is not None:
                    progress()

    def write_ends(self, ends: TrialEnds, rows: Indices) -> None:
        """Writes how the trials ended into rows of all ends."""
        for field in fields(TrialEnds):
            getattr(ends, field.name)[rows] = getattr(self._trials, field.name).numpy()

    def _advance(self) -> None:
        """Advances all worlds to the next check, and evaluates it."""
        c, data, physics = self._constants, self._data, self._physics
        for _ in range(int(c.steps_per_check)):
            wp.launch(
                trial_kernels.command_lift,
                dim=self._worlds,
                inputs=[c, self._trials, self._state, physics],
            )
            mujoco_warp.step(self._model, data)
        contact = data.contact
        found = [contact.dist, contact.frame, contact.geom, contact.worldid, contact.efc_address]
        wp.launch(
            trial_kernels.read_contacts,
            dim=data.naconmax,
            inputs=[c, self._bodies, self._state, physics, data.naconmax, *found, data.efc.force],
        )
        if self._others:
            wp.launch(
                trial_kernels.track_others,
                dim=(self._worlds, self._others),
                inputs=[c, self._bodies, self._state, physics],
            )
        wp.launch(
            trial_kernels.judge,
            dim=self._worlds,
            inputs=[c, self._bodies, self._trials, self._state, physics, self.counts],
        )
        self._begin_trials()

    def _begin_trials(self) -> None:
        shared = [self._constants, self._bodies, self._masses]
        wp.launch(
            start_kernels.begin_trials,
            dim=self._worlds,
            inputs=[*shared, self._trials, self._state, self._physics, self.counts],
        )


def _without_gravity(model: mujoco.MjModel) -> mujoco.MjModel:
    """A copy without gravity, which acts on the target alone, as a force: MuJoCo Warp compensates
    the hand's by sums in any order."""
    copied = copy.copy(model)
    copied.opt.gravity[:] = 0.0
    copied.body_gravcomp[:] = 0.0
    copied.opt.disableflags &= ~int(mujoco.mjtDisableBit.mjDSBL_AUTORESET)  # not known to Warp
    return copied


def _constants(world: MujocoWorld, instance: str, X_WO: Array, *, approaches: bool) -> Constants:
    settings, step, index = world.settings, world.engine.time_step, world.index
    hand = world.hand_document
    model, c = world.model, Constants()
    timeout = max(settings.close_timeout, 2.0 * hand.closing_time)
    c.step, c.poll, c.hold_time = step, settings.poll, settings.hold_time
    c.steps_per_check = max(1, round(settings.poll / step))
    check_time = c.steps_per_check * step
    c.close_timeout = int(np.ceil(timeout / check_time - 1e-9))
    c.settled_checks = int(np.ceil(settings.settled_time / check_time - 1e-6))
    c.hold_checks = max(1, round(settings.hold_time / settings.poll))
    c.steady_checks = settings.steady_polls
    c.settled_speed = settings.settled_speed
    c.creep_per_check = settings.creep_speed * settings.poll
    c.rest_per_check = settings.settled_speed * settings.poll
    c.slip_limit, c.tilt_limit = settings.slip_limit, settings.tilt_limit
    c.carried_mass = world.carried_mass
    c.early, c.approaches = int(not world.engine.whole_trial), int(approaches)
    c.overflows = int(FATAL_OVERFLOWS)
    c.target = index.objects[instance]
    c.hand, (c.finger_1, c.finger_2) = index.hand, index.fingers
    c.carrier, c.table = index.carrier, index.table
    c.lift_joint, c.lift_qpos, c.lift_dof = index.lift_joint, index.lift_qpos, index.lift_dof
    c.lift_position_servo, c.lift_speed_servo = index.lift_position_servo, index.lift_speed_servo
    c.finger_qpos = wp.vec2i(*index.finger_qpos.tolist())
    c.finger_dof = wp.vec2i(*index.finger_dofs.tolist())
    c.finger_servo = wp.vec2i(*index.finger_servos.tolist())
    c.closing_speed = wp.vec2(*world.closing_speeds.tolist())
    c.target_dof = int(model.body_dofadr[c.target])
    c.target_qpos = int(model.jnt_qposadr[model.body_jntadr[c.target]])
    c.target_mass = float(model.body_mass[c.target])
    c.gravity = wp.vec3(*model.opt.gravity)
    if settings.shake is not None:
        c.shakes, c.gravity = 1, wp.vec3(0.0)
        for name, value in vars(settings.shake).items():
            setattr(c, name, float(value))
    X_HG = hand.X_HG.matrix()
    c.p_HG, c.q_HG = wp.vec3(*X_HG[:3, 3]), wp.quat(*_quaternions(X_HG[:3, :3]))
    c.p_OCm = wp.vec3(*model.body_ipos[c.target])
    w, x, y, z = model.body_iquat[c.target]
    c.q_OI = wp.quat(x, y, z, w)
    c.p_WO, c.q_WO = wp.vec3(*X_WO[:3, 3]), wp.quat(*_quaternions(X_WO[:3, :3]))
    c.center = wp.vec3(*world.center(world.free[instance]))
    return c


def _quaternions(R: Array) -> Array:
    """Rotations (..., 3, 3) as quaternions (..., 4) of Warp, xyzw."""
    return np.asarray(Rotation.from_matrix(R).as_quat())


def _trials(starts: TrialStarts, others: int) -> Trials:
    """The trials on the device."""
    trials, n = Trials(), len(starts)
    trials.p_WH = wp.array(starts.p_WH, dtype=wp.vec3)
    trials.q_WH = wp.array(_quaternions(starts.R_WH), dtype=wp.quat)
    trials.p_GO = wp.array(starts.p_GO, dtype=wp.vec3)
    trials.q_GO = wp.array(_quaternions(starts.R_GO), dtype=wp.quat)
    trials.fingers = wp.array(starts.fingers, dtype=wp.vec2)
    trials.friction = wp.array(starts.friction, dtype=wp.float64)
    trials.mass = wp.array(starts.mass, dtype=float)
    trials.pads = wp.array(starts.pads, dtype=wp.vec3)
    trials.early = wp.array(starts.early, dtype=int)
    trials.turn_sign = wp.array(starts.turn_sign, dtype=int)
    trials.ways = wp.array(starts.ways, dtype=wp.vec4)
    trials.checks = wp.array(starts.checks, dtype=int)
    trials.time = wp.array(starts.time, dtype=float)
    for field in fields(TrialEnds):
        kind, shape = element_types(Trials)[field.name], _ends_shape(field.name, n, others)
        setattr(trials, field.name, wp.zeros(shape, dtype=kind))
    return trials


def _ends_shape(name: str, size: int, others: int) -> tuple[int, ...]:
    """Shape of an array of `TrialEnds`."""
    return (size, others) if name.startswith("others") else (size,)


def _empty_ends(size: int, others: int) -> TrialEnds:
    """Ends of trials that are not executed yet."""
    kinds = element_types(Trials)
    arrays = (
        wp.zeros(_ends_shape(f.name, size, others), dtype=kinds[f.name], device="cpu")
        for f in fields(TrialEnds)
    )
    return TrialEnds(*(array.numpy() for array in arrays))


def _state(worlds: int, steady_checks: int, spheres: int, others: int) -> WorldStates:
    """Worlds without trials."""
    columns = {"motions": steady_checks, "seen": spheres, "touch": 2, "force": 2, "spheres": 2}
    columns |= {f"others_{of}": others for of in ("moved", "turned", "over", "tilted", "last")}
    state = WorldStates()
    for name, kind in element_types(WorldStates).items():
        shape = (worlds, columns[name]) if name in columns else (worlds,)
        setattr(state, name, wp.zeros(shape, dtype=kind))
    state.phase.fill_(IDLE_PHASE)
    return state
