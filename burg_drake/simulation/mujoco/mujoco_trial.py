"""The floating-hand trial on MuJoCo: a second engine, so that verdicts need not hang on one.

Screen, phases, force, speed, geometry, masses, friction and decisions are those of
`trials.HandTrial`. Physics is another: objects touch as their convex pieces, also where pads meet
them: a neck that tapers in them by two degrees is lost with little friction. Pads are beds of
springs (`export.mjcf`). The target alone can move, as in Drake's trials; if it meets another
object, or leans on one, the trial runs in the complete world, where all can from the start.
"""

from __future__ import annotations

from functools import lru_cache, partial

from pydrake.geometry import Meshcat

from burg_drake.core import Array, InvalidInputError
from burg_drake.export import lay_out
from burg_drake.grasping.clearance import HandClearance
from burg_drake.scene.document import SceneLike, as_scene
from burg_drake.simulation.mujoco.mujoco_carrier import MujocoCarrier
from burg_drake.simulation.mujoco.mujoco_world import MujocoWorld
from burg_drake.simulation.mujoco.objects_check import check_objects
from burg_drake.simulation.mujoco.package import load_mujoco
from burg_drake.simulation.mujoco.world_picture import WorldPicture
from burg_drake.simulation.trials import (
    DEFAULT_TRIAL,
    KEPT_WORLDS,
    Execution,
    HandAloneTrial,
    HandLiftClearance,
    TrialResult,
    TrialSettings,
    check_overrides,
)
from burg_drake.station.diagram import StationDiagram, build_station_diagram, read_hand
from burg_drake.station.document import (
    ENGINES,
    Engine,
    GraspMotion,
    StationLike,
    as_engine,
    as_station,
)


class MujocoTrial(HandAloneTrial[MujocoWorld]):
    """Executes grasps of one scene with the hand alone, on MuJoCo.

    Args:
        scene: the scene.
        station: table, board pose and hand.
        engine: has the time step, or the name of a preset.
        settings: phases of a trial.
        motion: where the hand goes, if not as the settings or else the station say.
        lock: run in worlds of the target alone, where that is the same.
        meshcat: where to show the trials; recording is the caller's.

    Attributes:
        scene, station, engine, settings, motion, clearance: see `GraspTrial`.

    Raises:
        MissingDependencyError: MuJoCo is not installed.
        InvalidInputError: the engine is Drake; an object has no convex pieces; a pad of the hand is
            not flat, or its fingers are more than two joints.
    """

    def __init__(
        self,
        scene: SceneLike,
        station: StationLike,
        *,
        engine: Engine | str = ENGINES["mujoco"],
        settings: TrialSettings = DEFAULT_TRIAL,
        motion: GraspMotion | None = None,
        lock: bool = True,
        meshcat: Meshcat | None = None,
    ) -> None:
        scene, station, engine = as_scene(scene), as_station(station), as_engine(engine)
        mujoco = load_mujoco()
        if engine.simulator != "mujoco":
            raise InvalidInputError(
                f"engine {engine.name!r} has simulator {engine.simulator}; a MujocoTrial needs an"
                " engine with simulator mujoco"
            )
        self.failures = (*self.failures, mujoco.FatalError)
        check_objects(scene)
        self._plain = build_station_diagram(scene, station, robot="hand")
        self._picture: WorldPicture | None = None
        if meshcat is not None:
            self._picture = WorldPicture(scene, station, meshcat)
        self._layout, self._parts = lay_out(scene, station), read_hand(self._plain)
        super().__init__(
            scene,
            station,
            engine,
            settings=settings,
            clearance=HandClearance(self._plain),
            motion=motion,
            lock=lock,
        )
        kept = lru_cache(maxsize=KEPT_WORLDS)
        self._lift_clearance = kept(partial(HandLiftClearance, self._plain))

    @property
    def diagram(self) -> StationDiagram:
        """Of Drake: scene and hand, which is shown where the trial is."""
        return self._plain if self._picture is None else self._picture.diagram

    def run(
        self,
        instance: str,
        X_OG: Array,
        *,
        friction: float | None = None,
        mass: float | None = None,
        lift: float | None = None,
    ) -> TrialResult:
        """Executes one grasp; see `HandTrial.run`."""
        X_WG = self.X_WG(instance, X_OG)
        check_overrides(friction, mass)
        paths = self.lift_paths(X_WG, lift)

        def begin(world: MujocoWorld) -> Execution:
            self._enter(world)
            approach, target = self._approach(X_WG), world.free[instance]
            X_WF = X_WG if approach is None else self._pregrasp(X_WG)
            closed = self.closed_before_contact(instance, X_WG) if approach is None else None
            direction_W = (approach or paths[0]).direction_W
            world.prepare(instance, X_WF, closed, direction_W, friction=friction, mass=mass)
            lift_clearance = partial(self._lift_clearance, instance)
            carrier = MujocoCarrier(world, paths, lift_clearance, approach, target)
            return Execution(world, target, set(world.free.values()), carrier)

        return self.execute(instance, X_WG, begin, friction=friction, mass=mass)

    def _build(self, alone: str | None) -> MujocoWorld:
        return MujocoWorld(
            self.scene,
            self.station,
            self._layout,
            self._parts,
            engine=self.engine,
            settings=self.settings,
            alone=alone,
            shown=None if self._picture is None else self._picture.show,
        )
