"""Trials of many grasps at once with the hand alone, on a graphics card.

Screen, phases, decisions and margins are those of `MujocoTrial`; the worlds are stepped together by
MuJoCo Warp. Trials begin in worlds in which only the target can move. Where another object is
touched, or the target may lean on one, all objects can. What is rare is executed one by one on the
CPU: an approach on which the hand touches something, scenes of more than seven objects, and worlds
that have more contacts than fit.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import lru_cache, partial
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike
from pydrake.multibody.tree import BodyIndex
from scipy.spatial.transform import Rotation

from burg_drake.core import Array, Indices, Margins, Outcome, check_pose, make_pose
from burg_drake.grasping import Clearance
from burg_drake.scene import SceneLike
from burg_drake.simulation.batch.trial_starts import (
    End,
    Loads,
    TrialEnds,
    TrialStarts,
    trial_starts,
)
from burg_drake.simulation.batch.warp_device import (
    claimed,
    describe_devices,
    find_devices,
)
from burg_drake.simulation.mujoco_trial import MujocoTrial
from burg_drake.simulation.mujoco_world import MujocoWorld
from burg_drake.simulation.settings import DEFAULT_TRIAL, TrialSettings
from burg_drake.simulation.trial_result import (
    GripLoad,
    TrialResult,
    collision_result,
    confidence,
    simulation_failure_result,
)
from burg_drake.simulation.trial_world import check_overrides
from burg_drake.station import ENGINES, Engine, GraspMotion, StationLike

if TYPE_CHECKING:
    from burg_drake.simulation.batch.parallel_worlds import ParallelWorlds

WORLDS_ON_A_CARD = 16384
"""Most trials a second on an H100; each world takes about 1 MB."""
WORLDS_ON_THE_CPU = 8
"""More are not faster there."""
TRIALS_PER_WORLD = 3
"""Trials of a batch: worlds whose trial is done begin another, but wait at the end of a batch."""
LOST_OUTCOMES = {
    End.SLIPPED: Outcome.SLIPPED,
    End.DROPPED: Outcome.DROPPED,
    End.ONE_FINGER: Outcome.ONE_FINGER,
    End.CLOSED_EMPTY: Outcome.CLOSED_EMPTY,
    End.NO_CONTACT: Outcome.NO_CONTACT,
    End.BLOCKED: Outcome.BLOCKED,
}
"""Outcomes of trials in which the target was not held to the end."""
KEPT_WORLDS = 16
"""Targets whose constants are kept on the device, some 100 kB each."""
NOT_SCREENED = Clearance(None, "", 0.0, np.nan, "")
"""Of an open hand that is known to be clear."""
NEEDS_CPU = (End.OTHER_TOUCHED, End.UNPLANNED_TOUCH, End.OVERFLOW)
"""Ends of trials that are then executed on the CPU."""


class BatchTrial:
    """Executes many grasps of a scene with the hand alone, in parallel worlds.

    Results are those of `MujocoTrial` but for rounding, and for fingers that may start elsewhere by
    a fortieth of their travel. A grasp has the same result, to the bit, alone or among others, in
    any order, on the same device with the same versions.

    Example::

        trial = burg.simulation.BatchTrial("tabletop_six", "panda_tabletop")
        grasps = burg.sample_grasps("tabletop_six", "panda_tabletop", 10_000, only=["mug"])
        results = trial.run("mug", grasps.X_OG)

    Args:
        scene: the scene.
        station: table, board pose and hand.
        engine: engine with the time step, or the name of a preset.
        settings: phases of a trial.
        motion: the hand's motion around the grasp; by default that of the settings, else the
            station's.
        device: `cuda:0` and so on, or `cpu`; if None all cards, of which each batch takes one that
            no other process uses.
        worlds: number of worlds; as many as fit, up to `WORLDS_ON_A_CARD`, if None.

    Attributes:
        single: the trial that executes grasps one by one on the CPU.
        device: name of the device, with the versions of CUDA, see `describe_devices`.
        worlds: largest number of worlds.
        batch_size: number of grasps beyond which a trial gets hardly cheaper.
        on_cpu: number of grasps that were executed on the CPU so far.
        feeding_time: CPU time spent so far on screens, starts and results [s].

    Raises:
        MissingDependencyError: MuJoCo or Warp are not installed in the required versions.
        InvalidInputError: there is no such device; or see `MujocoTrial`.
    """

    def __init__(
        self,
        scene: SceneLike,
        station: StationLike,
        *,
        engine: Engine | str = ENGINES["mujoco-gpu"],
        settings: TrialSettings = DEFAULT_TRIAL,
        motion: GraspMotion | None = None,
        device: str | None = None,
        worlds: int | None = None,
    ) -> None:
        self._devices = find_devices(device)
        self.device = describe_devices(self._devices)
        on_card = self._devices[0].is_cuda
        self.worlds = worlds or (WORLDS_ON_A_CARD if on_card else WORLDS_ON_THE_CPU)
        self.batch_size = TRIALS_PER_WORLD * self.worlds
        self.single = MujocoTrial(scene, station, engine=engine, settings=settings, motion=motion)
        self.on_cpu, self.feeding_time = 0, 0.0
        self._worlds_of = lru_cache(KEPT_WORLDS)(self._build_worlds)

    def run(
        self,
        instance: str,
        X_OG: Array,
        *,
        friction: ArrayLike | None = None,
        mass: ArrayLike | None = None,
        lift: ArrayLike | None = None,
        known_clear: bool = False,
        progress: Callable[[], None] | None = None,
    ) -> list[TrialResult]:
        """Executes grasps.

        Args:
            instance: name of the target in the scene.
            X_OG: (N, 4, 4) grasps in the target's frame.
            friction: the target's friction coefficients, a number or (N,); the library's if None,
                and where NaN.
            mass: its masses [kg], likewise.
            lift: lengths of the lift [m], likewise; those of the motion if None, and where NaN.
            known_clear: whether a screen has found the open hand clear at all grasps; then there is
                no other one, and `Margins.clearance` is NaN.
            progress: called several times a second; may raise, to end the work.

        Returns:
            The outcome of each grasp with its margins, in order. A failure of the simulator is an
            outcome, too.

        Raises:
            InvalidInputError: `X_OG` are not poses, `instance` cannot be grasped, a friction
                coefficient is below 0, a mass is not above 0, or a lift has no length.
        """
        begun, single = time.process_time(), self.single
        X_WO = single.X_WO(instance)
        X_OG = check_pose(np.asarray(X_OG, dtype=float), "X_OG").reshape(-1, 4, 4)
        entry, n = single.scene.entry(instance), len(X_OG)
        loads = Loads(
            _filled(friction, entry.friction, n),
            _filled(mass, entry.mass, n),
            _filled(lift, single.motion.lift_height, n),
        )
        for one in np.unique(loads.friction):
            check_overrides(float(one), None)
        for one in np.unique(loads.mass):
            check_overrides(None, float(one))
        # One by one: products of stacked matrices may differ in the last bit.
        X_WG = np.array([X_WO @ X for X in X_OG]).reshape(-1, 4, 4)
        batch = _Batch(single, instance, X_OG, X_WG, loads)
        batch.screen(known_clear=known_clear)
        for world in dict.fromkeys((single.world_of(instance), single.complete_world)):
            if batch.has_open and self._fits(world, instance):
                step = partial(self._step_worlds, world, instance, progress)
                pads = self._worlds_of(world, instance, self._devices[0].alias).pads
                batch.step_worlds(world, pads, step)
        self.feeding_time += time.process_time() - begun - batch.stepping_time
        self.on_cpu += batch.execute_rest()
        return batch.results()

    def _step_worlds(
        self,
        world: MujocoWorld,
        instance: str,
        progress: Callable[[], None] | None,
        starts: TrialStarts,
    ) -> TrialEnds:
        """Executes trials on a device that no other process uses."""
        with claimed(self._devices) as device:
            worlds = self._worlds_of(world, instance, device.alias)
            return worlds.run(starts, self.worlds, progress)

    def _fits(self, world: MujocoWorld, instance: str) -> bool:
        """Whether parallel worlds can repeat a world: not one of many objects, nor where the hand
        comes to them."""
        max_dofs = 50  # Beyond it MuJoCo Warp adds parts of each row by atomics, in any order.
        if set(world.free) == {instance}:
            return True
        return world.model.nv <= max_dofs and not self.single.approaches

    def _build_worlds(self, world: MujocoWorld, instance: str, device: str) -> ParallelWorlds:
        from burg_drake.simulation.batch.parallel_worlds import ParallelWorlds

        single = self.single
        return ParallelWorlds(
            world,
            instance,
            single.X_WO(instance),
            device,
            approaches=single.approaches,
        )


class _Batch:
    """Trials of one target.

    Args:
        trial: executes them one by one.
        instance: the target.
        X_OG, X_WG: (N, 4, 4) grasps in its frame and in the world.
        loads: what differs between them.

    Attributes:
        stepping_time: CPU time while the worlds were stepped [s].
    """

    def __init__(
        self, trial: MujocoTrial, instance: str, X_OG: Array, X_WG: Array, loads: Loads
    ) -> None:
        self._trial, self._instance = trial, instance
        self._X_OG, self._X_WG, self._loads = X_OG, X_WG, loads
        X_WO = trial.X_WO(instance)
        center = trial.scene.entry(instance).mass_properties.center_of_mass
        self._p_WCm = X_WO[:3, :3] @ center + X_WO[:3, 3]
        self._results: dict[int, TrialResult] = {}
        self._screens: list[Clearance] = []
        self.stepping_time = 0.0

    @property
    def has_open(self) -> bool:
        """Whether there are grasps without a result."""
        return len(self._results) < len(self._X_WG)

    def results(self) -> list[TrialResult]:
        """The results in the order of the grasps."""
        return [self._results[k] for k in range(len(self._X_WG))]

    def screen(self, *, known_clear: bool) -> None:
        """Screens the open hand at the grasps, unless it is known to be clear there, and at the
        starts of their approaches."""
        trial, instance = self._trial, self._instance
        if known_clear:
            self._screens = [NOT_SCREENED] * len(self._X_WG)
        else:
            self._screens = trial.clearance.check_all(instance, self._X_WG)
        for k, screen in enumerate(self._screens):
            if screen.outcome is not None:
                self._results[k] = collision_result(screen)
        rows = self._open_rows()
        if trial.approaches and len(rows):
            starts = np.array([trial.pregrasp_of(X) for X in self._X_WG[rows]])
            for k, screen in zip(rows, trial.clearance.check_all(instance, starts), strict=True):
                if screen.outcome is not None:
                    blocked = replace(screen, outcome=Outcome.HAND_COLLISION_APPROACH)
                    self._results[int(k)] = collision_result(blocked)

    def step_worlds(
        self,
        world: MujocoWorld,
        pads: Callable[[Array], Array],
        step: Callable[[TrialStarts], TrialEnds],
    ) -> None:
        """Executes the open grasps in parallel worlds; leaves open what these cannot decide.

        Args:
            world: the world that they repeat.
            pads: see `ParallelWorlds.pads`.
            step: executes trials.
        """
        rows = self._open_rows()
        loads = Loads(*(values[rows] for values in vars(self._loads).values()))
        X_WG, instance = self._X_WG[rows], self._instance
        starts = trial_starts(self._trial, instance, X_WG, loads, pads(loads.mass))
        while len(rows):
            begun = time.process_time()
            ends = step(starts)
            self.stepping_time += time.process_time() - begun
            blocked = self._record(rows, world, starts, ends)
            rows, starts = rows[blocked], starts.at(blocked)
            starts = replace(starts, early=np.zeros(len(rows), dtype=bool))

    def execute_rest(self) -> int:
        """Executes open grasps on the CPU; returns their number."""
        rows, loads = self._open_rows(), self._loads
        for k in rows.tolist():
            result = self._trial.run(
                self._instance,
                self._X_OG[k],
                friction=float(loads.friction[k]),
                mass=float(loads.mass[k]),
                lift=float(loads.lift[k]),
            )
            self._results[k] = replace(result, on_cpu=True)
        return len(rows)

    def _open_rows(self) -> Indices:
        return np.array(
            [k for k in range(len(self._X_WG)) if k not in self._results], dtype=np.intp
        )

    def _record(
        self, rows: Indices, world: MujocoWorld, starts: TrialStarts, ends: TrialEnds
    ) -> Indices:
        """Records decided trials; returns those that ended early though their path is blocked."""
        may_be_blocked = set(self._rows_near_others(rows, world, starts, ends).tolist())
        blocked = []
        for k, row in enumerate(rows.tolist()):
            end = End(ends.end[k])
            if end in NEEDS_CPU:
                continue
            if k in may_be_blocked and not self._is_free_ahead(row, k, world, starts, ends):
                blocked.append(k)
                continue
            self._results[row] = self._result(row, k, world, ends)
        return np.array(blocked, dtype=np.intp)

    def _rows_near_others(
        self, rows: Indices, world: MujocoWorld, starts: TrialStarts, ends: TrialEnds
    ) -> Indices:
        """Trials that ended early, and whose path ahead has to be checked."""
        early = np.flatnonzero(ends.end == End.HELD_IF_FREE)
        last = np.where(starts.checks[early, 2] > 0, 2, 1)
        direction, X_WG = starts.ways[early, last, :3], self._X_WG[rows[early]]
        X_WG[:, :3, 3] = ends.p_WG[early] + ends.travelled[early, None] * direction
        X_WO = np.tile(np.eye(4), (len(early), 1, 1))
        X_WO[:, :3, :3] = Rotation.from_quat(ends.q_WO[early]).as_matrix().reshape(-1, 3, 3)
        X_WO[:, :3, 3] = ends.p_WO[early]
        if len(world.free) > 1:
            return early
        clearance = self._trial.lift_clearance(self._instance)
        left = ends.left[early, None] * direction
        return early[~clearance.clearly_free(X_WG, X_WO, left)]

    def _is_free_ahead(
        self, row: int, k: int, world: MujocoWorld, starts: TrialStarts, ends: TrialEnds
    ) -> bool:
        """Whether the rest of the last segment is free of collisions."""
        way = starts.ways[k, 2 if starts.checks[k, 2] else 1]
        X_WG = make_pose(self._X_WG[row, :3, :3], ends.p_WG[k])
        target = _HeldTarget(world, self._instance, ends, k)
        clearance = self._trial.lift_clearance(self._instance)
        return clearance.is_free(target, X_WG, float(ends.left[k]), way[:3])

    def _result(self, row: int, k: int, world: MujocoWorld, ends: TrialEnds) -> TrialResult:
        """The result of a trial, as `Execution` has it."""
        trial, settings, end = self._trial, self._trial.settings, End(ends.end[k])
        step = trial.engine.time_step
        check_time = max(1, round(settings.poll / step)) * step
        time = float(ends.check[k]) * check_time
        if end is End.NOT_FINITE:
            error = RuntimeError(f"the state is not finite at {time:.3f} s")
            return simulation_failure_result(error, self._screens[row], time)
        slip, tilt = float(ends.slip[k]), float(ends.tilt[k])
        has_gripped = slip >= 0.0
        others = [name for name in world.free if name != self._instance]
        still = dict.fromkeys(world.standing, 0.0)
        moved = still | dict(zip(others, ends.others_moved[k].tolist(), strict=True))
        turned = still | dict(zip(others, ends.others_turned[k].tolist(), strict=True))
        toppled = [n for n, over in zip(others, ends.others_toppled[k], strict=True) if over]
        outcome = LOST_OUTCOMES.get(end)
        if outcome is None:
            outcome = Outcome.LIFTED
            if slip > settings.slip_limit or tilt > settings.tilt_limit:
                outcome = Outcome.LIFTED_TURNED
            elif max(moved.values(), default=0.0) > settings.disturbance:
                outcome = Outcome.LIFTED_DISTURBED
        left = float(ends.left[k]) if end is End.HELD_IF_FREE else 0.0
        pushed = {**still, self._instance: float(ends.pushed[k])} if trial.approaches else {}
        margins = Margins(
            overlap=0.0,
            clearance=self._screens[row].clearance,
            slip=slip if has_gripped else np.nan,
            tilt=tilt if has_gripped else np.nan,
            pad_force=float(np.abs(ends.force[k]).min()) if has_gripped else np.nan,
            patch_area=float((ends.spheres[k] * world.sphere_areas).min())
            if has_gripped
            else np.nan,
            lift=np.nan if settings.shake else float(ends.lift[k]) + left,
            others_moved=max(moved.values(), default=0.0),
            others_turned=max(turned.values(), default=0.0),
            end_time=time,
            pushed=max(pushed.values(), default=np.nan),
        )
        load = GripLoad.of(
            self._X_WG[row],
            self._p_WCm,
            friction=float(self._loads.friction[row]),
            force=trial.station.hand.force,
            mass=float(self._loads.mass[row]),
            acceleration=settings.acceleration,
        )
        return TrialResult(
            outcome=outcome,
            margins=margins,
            confidence=None if settings.shake else confidence(trial.engine, outcome, margins, load),
            blocker=world.body_names[BodyIndex(int(ends.blocker[k]))]
            if outcome is Outcome.BLOCKED
            else "",
            displacements=moved,
            turned=turned,
            toppled=", ".join(toppled),
            pushed=pushed,
        )


class _HeldTarget:
    """A target in the hand, and all others, at the end of a trial; see `PlacedRobot`."""

    def __init__(self, world: MujocoWorld, instance: str, ends: TrialEnds, k: int) -> None:
        self.free: Mapping[str, BodyIndex] = world.free
        self._world, self._ends, self._k = world, ends, k
        others = [body for name, body in world.free.items() if name != instance]
        self._number = {body: number for number, body in enumerate(others)}

    def X_WB(self, body: BodyIndex) -> Array:
        """Pose (4, 4) of a body in the world."""
        ends, k = self._ends, self._k
        q, p = ends.q_WO[k], ends.p_WO[k]
        if body in self._number:
            q, p = ends.others_q[k, self._number[body]], ends.others_p[k, self._number[body]]
        return make_pose(Rotation.from_quat(q).as_matrix(), p)

    def robot_positions(self, model: str) -> Array | None:
        """Positions of `hand` and `lift`, in the order of a station diagram."""
        if model == "lift":
            return np.array([self._ends.travelled[self._k]])
        return (
            self._world.in_plant_order(self._ends.last_fingers[self._k])
            if model == "hand"
            else None
        )


def _filled(values: ArrayLike | None, default: float, n: int) -> Array:
    """(n,) values, with the default in place of None and NaN."""
    given = np.broadcast_to(np.nan if values is None else np.asarray(values, dtype=float), (n,))
    return np.where(np.isnan(given), default, given)
