"""What a call of `evaluate` asks about a scene, the same of one scene or of each of many."""

from __future__ import annotations

import math
import shlex
import sys
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from burg_drake.core import (
    JUDGING,
    InvalidInputError,
    content_hash,
    software_versions,
)
from burg_drake.core.grasps import GraspSet, Mode
from burg_drake.core.paths import PACKAGE_URI, portable_reference
from burg_drake.evaluation.candidates import INSTANCE, chosen_instances, on_chosen
from burg_drake.evaluation.grasp_sets import by_names, correction_of
from burg_drake.evaluation.records import (
    AS_MEASURED,
    EvaluationSettings,
    Grasps,
    Library,
    RunDocument,
    Shard,
    as_shard,
    input_of,
    numbers,
)
from burg_drake.evaluation.stages import arm_settings, mode_for, require_engine_for
from burg_drake.scene.document import Scene
from burg_drake.station.document import Engine, GraspMotion, Station, as_engine

if TYPE_CHECKING:
    from burg_drake.simulation.trials import TrialSettings

ByInstance = Mapping[str, GraspSet]
GraspsLike = GraspSet | ByInstance | Callable[[Scene], ByInstance]
"""Grasps that a user has: a set, sets by instance, or a function that has those of a scene.
Attributes `content` and `correction` of a function, if it has them, are a hash of all that its
grasps come from, and the correction with which it reads them."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Request:
    """What is asked.

    Attributes:
        station: where.
        settings: as the user has them.
        engine, mode, motion, shard: what the settings come to on this station.
        only: names of objects or instances; all if empty.
        grasps: given in place of sampled ones.
        retry_failed: whether grasps that could not be simulated are tried again.
    """

    station: Station
    settings: EvaluationSettings
    engine: Engine
    mode: Mode
    motion: GraspMotion
    shard: Shard | None
    only: tuple[str, ...]
    grasps: GraspsLike | None
    retry_failed: bool

    @classmethod
    def of(
        cls,
        station: Station,
        settings: EvaluationSettings,
        grasps: GraspsLike | None = None,
        *,
        retry_failed: bool = False,
    ) -> Request:
        """What settings ask for on a station.

        Raises:
            UnknownNameError: there is no engine of this name.
            InvalidInputError: there is no such mode or share, the station or the engine lacks the
                arm, or the approach is asked for of the whole arm, or without a standoff.
            MissingDependencyError: the engine is not installed.
        """
        engine, mode = as_engine(settings.engine), mode_for(station, settings.mode)
        if settings.approach and mode == "arm":
            raise InvalidInputError(
                "approach is given with mode arm, in which the whole arm approaches"
                " anyway; leave approach out, or give mode hand or reach"
            ).about("approach")
        motion = settings.motion or station.document.motion
        if settings.approach and motion.standoff <= 0.0:
            own = motion == station.document.motion
            where = f"of station {station.name!r}" if own else "asked for"
            raise InvalidInputError(
                f"the approach of the hand cannot be simulated, as the standoff {where}"
                " is 0 mm; give a standoff above 0, or leave approach out"
            ).about("approach", "standoff_mm")
        if settings.balanced_among == "reachable" and mode == "hand":
            raise InvalidInputError(
                "balanced_among is 'reachable', but mode hand does not check what the"
                " arm can reach; balance among executed, clear or all, or give mode"
                " reach or arm"
            ).about("balanced_among", "mode")
        require_engine_for(engine, mode)
        return cls(
            station=station,
            settings=settings,
            engine=engine,
            mode=mode,
            motion=motion,
            shard=as_shard(settings.shard),
            only=tuple(settings.only or ()),
            grasps=grasps,
            retry_failed=retry_failed,
        )

    def given(self, scene: Scene) -> ByInstance | None:
        """The user's grasps on the instances of a scene; None where they are sampled.

        Raises:
            BurgError: they do not fit the scene.
        """
        if self.grasps is None:
            return None
        found = self.grasps(scene) if callable(self.grasps) else self.grasps
        found = by_names(scene, found) if isinstance(found, GraspSet) else found
        return on_chosen(scene, found, self.only)

    def of_scene(self, scene: Scene) -> Request | None:
        """What is asked about one scene of many: `only` and grasps may be for others alone.

        Returns:
            The same without what is not for this scene; None if that leaves no grasps.

        Raises:
            BurgError: the grasps do not fit the scene.
        """
        known = {n for name, i in scene.instances.items() for n in (name, i.object)}
        only = tuple(name for name in self.only if name in known)
        if self.only and not only:
            return None
        if self.grasps is None:
            return replace(self, only=only) if scene.instances else None
        grasps: GraspsLike = self.grasps
        if isinstance(grasps, GraspSet):
            by = grasps.columns.get(INSTANCE, grasps.object)
            among = list(scene.instances) if INSTANCE in grasps.columns else sorted({*known, ""})
            grasps = grasps.select(np.isin(by, among))
        elif isinstance(grasps, Mapping):
            grasps = {name: grasps[name] for name in grasps if name in scene.instances}
        else:
            grasps = grasps(scene)
        if not isinstance(grasps, GraspSet):
            grasps = {name: part for name, part in grasps.items() if len(part)}
        if not len(grasps):
            return None
        chosen = set(chosen_instances(scene, only))
        found = by_names(scene, grasps) if isinstance(grasps, GraspSet) else grasps
        found = {name: part for name, part in found.items() if name in chosen}
        return replace(self, only=only, grasps=found) if found else None

    def requested(self, scene: Scene) -> Grasps:
        """What is asked of the grasps; what comes of it is filled in when it is known.

        Raises:
            UnknownNameError: `only` has a name that is not in the scene.
        """
        chosen = chosen_instances(scene, self.only)
        only = () if chosen == tuple(scene.instances) else chosen
        return replace(self.requested_of_all(), only=only)

    def _balance(self) -> dict[str, Any]:
        """What a run that grows says of its grasps; nothing where they are sampled once."""
        if self.settings.until_balanced is None:
            return {}
        return {
            "until_balanced": self.settings.until_balanced,
            "balanced_among": self.settings.balanced_among,
            "max_per_object": self.settings.max_grasps_per_object,
        }

    def requested_of_all(self) -> Grasps:
        """The same, whatever the scene."""
        if self.grasps is not None:
            return Grasps(origin="given", only=self.only, count=0, objects={}, content="")
        return Grasps(
            origin="sampled",
            per_object=self.settings.grasps_per_object,
            approach_angle_deg=float(self.settings.approach_angle_deg),
            blind=self.settings.blind,
            only=self.only,
            **self._balance(),
            count=0,
            objects={},
            content="",
        )

    def document(self, folder: Path, scene: Scene) -> RunDocument:
        """The document of a run; what comes of the grasps is filled in later."""
        instances = [*scene.instances.values(), *scene.background.values()]
        library = portable_reference(scene.library.root, folder)
        return RunDocument(
            command=command(),
            scene=input_of(scene, "scenes"),
            station=input_of(self.station, "stations"),
            library=Library(
                name=scene.library.name,
                path=library
                if library.startswith(PACKAGE_URI)
                else str(scene.library.root.resolve()),
                objects={i.object: scene.library.entry(i.object).build for i in instances},
            ),
            grasps=self.requested(scene),
            engine=self.engine,
            trial=self.trial,
            mode=self.mode,
            arm=self.arm,
            seed=self.settings.seed,
            shard="" if self.shard is None else str(self.shard),
            table=self.settings.table,
            versions=software_versions({**JUDGING, **self.engine.packages}),
        )

    @property
    def trial(self) -> dict[str, float]:
        """Settings of the trial's phases, and how its results are measured, by name."""
        return {**numbers(self.phases), **AS_MEASURED}

    @property
    def phases(self) -> TrialSettings:
        """Settings of the trial's phases."""
        from burg_drake.simulation.trials import TrialSettings

        return TrialSettings(
            motion=self.motion,
            tilt_limit=math.radians(self.settings.tilt_limit_deg),
            slip_limit=self.settings.slip_limit_mm / 1000.0,
            approach=self.settings.approach,
        )

    @property
    def arm(self) -> dict[str, float]:
        """Settings of the search for the arm's motions, by name; none where it is not asked."""
        return {} if self.mode == "hand" else numbers(arm_settings(self.motion))


def command() -> str:
    """The command that is running, as one can type it again."""
    program = Path(sys.argv[0]).name if sys.argv and sys.argv[0] else "python"
    return shlex.join([program, *sys.argv[1:]])


def given_content(grasps: GraspsLike | None) -> str:
    """Hash of the grasps that are given for many scenes; empty of those of a function that does not
    say it: each scene's run has a hash of its own."""
    if grasps is None or callable(grasps):
        return str(getattr(grasps, "content", ""))
    sets = {"": grasps} if isinstance(grasps, GraspSet) else grasps
    parts = {
        name: [part.X_OG, part.width, part.object, part.columns.get(INSTANCE)]
        for name, part in sets.items()
    }
    return content_hash(parts)


def given_correction(grasps: GraspsLike | None) -> tuple[str, ...]:
    """The correction with which the grasps that are given for many scenes were read."""
    if grasps is None or callable(grasps):
        return tuple(getattr(grasps, "correction", ()))
    sets = [grasps] if isinstance(grasps, GraspSet) else grasps.values()
    return next((found for part in sets if (found := correction_of(part))), ())
