"""Prepares runs for a call of `evaluate`: request, folder, candidates, open grasps.

A balanced run samples further grasps in rounds, each once all grasps so far are judged. The grasps
of a round depend only on the verdicts, not on the executor or the order of judging. A later round
repeats the sampling with the same seed and a larger number, so it begins with the same grasps.
"""

from __future__ import annotations

import math
import shlex
import sys
import time
from collections import Counter, defaultdict
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from burg_drake.core import (
    JUDGING_PACKAGES,
    PACKAGE_URI,
    GraspSet,
    InvalidInputError,
    Mode,
    SimulationError,
    content_hash,
    list_names,
    portable_reference,
    software_versions,
)
from burg_drake.evaluation.campaign_folder import Campaign
from burg_drake.evaluation.candidates import (
    INSTANCE_COLUMN,
    Candidates,
    chosen_instances,
    drop_equal_grasps,
    given_candidates,
    join_candidates,
    select_instances,
)
from burg_drake.evaluation.grasp_sets.given_grasps import group_by_names
from burg_drake.evaluation.grasp_sets.pose_mistakes import correction_of
from burg_drake.evaluation.grasp_sets.sampling import sample_on_scene
from burg_drake.evaluation.journal import JOURNAL_FILE
from burg_drake.evaluation.judge import (
    StationJudgeFactory,
    arm_settings,
    mode_for,
    require_engine_for,
    require_scene_for,
)
from burg_drake.evaluation.report.pages import write_report
from burg_drake.evaluation.run_document import (
    DEVICE_ENTRY,
    Grasps,
    Library,
    RunDocument,
    input_of,
    settings_numbers,
)
from burg_drake.evaluation.run_folder import (
    GRASPS_FILE,
    RUN_FILE,
    Run,
    create_run,
    load_run,
    save_run,
    write_copies,
)
from burg_drake.evaluation.run_identity import require_same_run, run_hash
from burg_drake.evaluation.run_summary import lifted_and_failed
from burg_drake.evaluation.settings import (
    EvaluationSettings,
    SamplingSettings,
    Shard,
    TableFormat,
    as_shard,
    grasp_limits,
)
from burg_drake.evaluation.table_file import write_table
from burg_drake.evaluation.trial_origin import MEASURE_NUMBERS
from burg_drake.scene import Scene
from burg_drake.station import Engine, GraspMotion, Station, as_engine

if TYPE_CHECKING:
    from burg_drake.simulation import TrialSettings

ByInstance = Mapping[str, GraspSet]
GraspsLike = GraspSet | ByInstance | Callable[[Scene], ByInstance]
"""Grasps given by the user: a set, sets by instance, or a function that returns those of a scene.

A function may have attributes `content`, a hash of the source of its grasps, and `correction`, the
correction that it applies to them."""


def current_command() -> str:
    """Command line of this process, quoted for a shell."""
    program = Path(sys.argv[0]).name if sys.argv and sys.argv[0] else "python"
    return shlex.join([program, *sys.argv[1:]])


@dataclass(frozen=True, eq=False, kw_only=True)
class RunRequest:
    """A request to `evaluate`, for one scene or for many.

    Attributes:
        station: the station.
        settings: settings of the user.
        engine, mode, motion, shard: values that follow from the settings on this station.
        only: names of objects or instances; all if empty.
        grasps: grasps given by the user; None to sample.
        retry_failed: whether to retry grasps that could not be simulated.
        local: whether this machine judges, and not a cluster.
        command: command line of the process that makes the request; others may prepare its runs.
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
    local: bool = True
    command: str = field(default_factory=current_command)

    @classmethod
    def of(
        cls,
        station: Station,
        settings: EvaluationSettings,
        grasps: GraspsLike | None = None,
        *,
        retry_failed: bool = False,
    ) -> RunRequest:
        """Makes the request from settings on a station.

        Raises:
            UnknownNameError: there is no engine of this name.
            InvalidInputError: there is no such mode or shard, the mode needs an arm that the
                station lacks or the engine does not support, or the approach is requested with the
                whole arm or without a standoff.
            MissingDependencyError: the engine is not installed.
        """
        engine, mode = as_engine(settings.engine), mode_for(station, settings.mode)
        if settings.approach and mode == "arm":
            raise InvalidInputError(
                "approach is given with mode arm, in which the whole arm approaches"
                " anyway; leave approach out, or give mode hand or reach"
            ).about("approach")
        if settings.protocol == "shake" and (mode != "hand" or settings.approach):
            raise InvalidInputError(
                "protocol shake is for the hand alone, which begins at the grasp; give mode hand,"
                " without approach"
            ).about("protocol", "mode", "approach")
        motion = settings.motion or station.document.motion
        if settings.protocol == "shake" and motion != station.document.motion:
            raise InvalidInputError(
                "a motion of the hand is given, but with protocol shake it neither approaches nor"
                " lifts; leave the motion out"
            ).about("protocol")
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

    def given_candidates(self, scene: Scene) -> Candidates | None:
        """The user's grasps on a scene as candidates; None if grasps are sampled.

        Raises:
            BurgError: the grasps do not fit the scene.
        """
        if self.grasps is None:
            return None
        found = self.grasps(scene) if callable(self.grasps) else self.grasps
        found = group_by_names(scene, found) if isinstance(found, GraspSet) else found
        return given_candidates(scene, select_instances(scene, found, self.only))

    def judge_factory(self, scene: Scene) -> StationJudgeFactory:
        """Builds the judges of a scene in worker processes."""
        return StationJudgeFactory(
            scene,
            self.station,
            self.engine,
            self.mode,
            self.trial_settings,
            self.settings.device,
        )

    def narrow_to_scene(self, scene: Scene) -> RunRequest | None:
        """Narrows a request for many scenes to one of them.

        Returns:
            The request with only the names and grasps of this scene; None if no grasps are left.

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
            targets = grasps.columns.get(INSTANCE_COLUMN, grasps.object)
            by_instance = INSTANCE_COLUMN in grasps.columns
            accepted = list(scene.instances) if by_instance else sorted({*known, ""})
            grasps = grasps.select(np.isin(targets, accepted))
        elif isinstance(grasps, Mapping):
            grasps = {name: grasps[name] for name in grasps if name in scene.instances}
        else:
            grasps = grasps(scene)
        if not isinstance(grasps, GraspSet):
            grasps = {name: part for name, part in grasps.items() if len(part)}
        if not len(grasps):
            return None
        chosen = set(chosen_instances(scene, only))
        found = group_by_names(scene, grasps) if isinstance(grasps, GraspSet) else grasps
        found = {name: part for name, part in found.items() if name in chosen}
        return replace(self, only=only, grasps=found) if found else None

    def describe_grasps(self, scene: Scene) -> Grasps:
        """Record of the requested grasps; counts and hash are filled in later.

        Raises:
            UnknownNameError: `only` has a name that is not in the scene.
        """
        chosen = chosen_instances(scene, self.only)
        only = () if chosen == tuple(scene.instances) else chosen
        return replace(self.describe_all_grasps(), only=only)

    def describe_all_grasps(self) -> Grasps:
        """Record of the requested grasps, independent of the scene."""
        if self.grasps is not None:
            return Grasps(origin="given", only=self.only, count=0, objects={}, content="")
        settings = self.settings
        found = Grasps(
            origin="sampled",
            per_object=settings.grasps_per_object,
            approach_angle_deg=float(grasp_limits(settings).approach_angle_deg),
            blind=settings.blind,
            only=self.only,
            count=0,
            objects={},
            content="",
        )
        if settings.until_balanced is None:
            return found
        return replace(
            found,
            until_balanced=settings.until_balanced,
            balanced_among=settings.balanced_among,
            max_per_object=settings.max_grasps_per_object,
        )

    def document_fields(self) -> dict[str, Any]:
        """Fields of a run's document that do not depend on the scene."""
        return {
            "command": self.command,
            "station": input_of(self.station, "stations"),
            "engine": self.engine,
            "protocol": self.settings.protocol,
            "trial": {**settings_numbers(self.trial_settings), **MEASURE_NUMBERS},
            "mode": self.mode,
            "arm": {} if self.mode == "hand" else settings_numbers(arm_settings(self.motion)),
            "seed": self.settings.seed,
            "shard": "" if self.shard is None else str(self.shard),
            "table": self.settings.table,
            "versions": software_versions({**JUDGING_PACKAGES, **self.engine.packages})
            | ({DEVICE_ENTRY: device} if (device := self.device_text()) else {}),
        }

    def device_text(self) -> str:
        """The devices of this machine on which an engine with parallel trials runs; empty if there
        are none, or a cluster has them."""
        if not self.engine.parallel or not self.local:
            return ""
        from burg_drake.simulation import describe_devices, find_devices

        try:
            return describe_devices(find_devices(self.settings.device))
        except InvalidInputError:
            return ""

    def document(self, folder: Path, scene: Scene) -> RunDocument:
        """Document of a run; counts and hash of the grasps are filled in later."""
        instances = [*scene.instances.values(), *scene.background.values()]
        library = portable_reference(scene.library.root, folder)
        packaged = library.startswith(PACKAGE_URI)
        return RunDocument(
            **self.document_fields(),
            scene=input_of(scene, "scenes"),
            library=Library(
                name=scene.library.name,
                path=library if packaged else str(scene.library.root.resolve()),
                objects={i.object: scene.library.entry(i.object).build for i in instances},
            ),
            grasps=self.describe_grasps(scene),
        )

    @property
    def trial_settings(self) -> TrialSettings:
        """Settings of the trials."""
        from burg_drake.simulation import ShakeSettings, TrialSettings

        limits = grasp_limits(self.settings)
        return TrialSettings(
            motion=self.motion,
            tilt_limit=math.radians(limits.tilt_limit_deg),
            slip_limit=limits.slip_limit_mm / 1000.0,
            approach=self.settings.approach,
            shake=ShakeSettings() if self.settings.protocol == "shake" else None,
        )


def given_content(grasps: GraspsLike | None) -> str:
    """Hash of the grasps given for many scenes.

    Empty for a function without the attribute `content`; each scene's run has its own hash.
    """
    if grasps is None or callable(grasps):
        return str(getattr(grasps, "content", ""))
    sets = {"": grasps} if isinstance(grasps, GraspSet) else grasps
    parts = {
        name: [part.X_OG, part.width, part.object, part.columns.get(INSTANCE_COLUMN)]
        for name, part in sets.items()
    }
    return content_hash(parts)


def given_correction(grasps: GraspsLike | None) -> tuple[str, ...]:
    """Correction with which the grasps given for many scenes were read."""
    if grasps is None or callable(grasps):
        return tuple(getattr(grasps, "correction", ()))
    sets = [grasps] if isinstance(grasps, GraspSet) else grasps.values()
    return next((found for part in sets if (found := correction_of(part))), ())


RequestedCounts = dict[str, tuple[int, int]]
"""Numbers of ordinary and of slippery grasps to sample, by object."""


def sample_requested(
    scene: Scene, station: Station, document: RunDocument, before: Run | None = None
) -> Candidates:
    """Samples the grasps that a run's document asks for.

    Args:
        scene: scene to sample on.
        station: station with hand and arm.
        document: document of the run; without `Grasps.asked`, every object gets `per_object`
            ordinary grasps.
        before: the run with the grasps so far; objects whose number of grasps does not change keep
            their grasps. None to sample all.
    """
    names = instances_to_sample(scene, document)
    kept = {} if before is None else _unchanged_grasps(scene, before, document.grasps)
    new = [name for name in names if name not in kept]
    found = {**kept, **sample_instances(scene, station, document, new)}
    return join_candidates({name: found[name] for name in names})


def instances_to_sample(scene: Scene, document: RunDocument) -> tuple[str, ...]:
    """Names of the instances of which a run samples grasps, in the order of its candidates."""
    return document.grasps.only or tuple(scene.instances)


def sample_instances(
    scene: Scene, station: Station, document: RunDocument, names: Sequence[str]
) -> dict[str, GraspSet]:
    """Samples the grasps that a run's document asks for on some instances.

    They do not depend on which other instances are named.

    Args:
        scene, station, document: see `sample_requested`.
        names: names of the instances.
    """
    grasps = document.grasps
    found: defaultdict[str, list[GraspSet]] = defaultdict(list)
    for slippery in (False, True):
        by_count: defaultdict[int, list[str]] = defaultdict(list)
        for name in names:
            by_count[_requested_counts(grasps, scene.instance(name).object)[slippery]].append(name)
        for count, instances in sorted(by_count.items()):
            if count:
                settings = SamplingSettings(
                    approach_angle_deg=grasps.approach_angle_deg,
                    blind=grasps.blind,
                    slippery=slippery,
                )
                sampled = sample_on_scene(scene, station, count, document.seed, settings, instances)
                for name, part in sampled:
                    found[name].append(part)
    return {name: _join_sets(found[name]) for name in names}


def _unchanged_grasps(scene: Scene, before: Run, grasps: Grasps) -> dict[str, GraspSet]:
    """Grasps of the instances whose requested number has not changed, by instance."""
    candidates = before.candidates
    provenance = candidates.grasps.provenance["parts"]
    kept = {}
    for name in provenance:
        object = scene.instance(name).object
        if _requested_counts(grasps, object) == _requested_counts(before.document.grasps, object):
            own = candidates.grasps.select(candidates.instance == name)
            kept[name] = replace(own, provenance=provenance[name])
    return kept


def next_round(run: Run) -> RunDocument | None:
    """Document of a judged run that asks for more grasps; None if no more are needed.

    No more are needed if each object has enough lifted and failing grasps, or the maximum number of
    grasps. A run that a second engine has judged again gets no further round.
    """
    grasps = run.document.grasps
    if not grasps.until_balanced or run.index.judged_again.any():
        return None
    counts = lifted_and_failed(run)
    requested: RequestedCounts = {
        name: _increase_counts(grasps, name, counts[name]) for name in counts
    }
    if all(requested[name] == _requested_counts(grasps, name) for name in requested):
        return None
    return replace(run.document, grasps=replace(grasps, asked=requested))


def _requested_counts(grasps: Grasps, object: str) -> tuple[int, int]:
    return grasps.asked.get(object, (grasps.per_object or 0, 0))


def _increase_counts(grasps: Grasps, object: str, counts: tuple[int, int]) -> tuple[int, int]:
    """Numbers of grasps for the next round: doubled for the kind that is missing."""
    ordinary, slippery = _requested_counts(grasps, object)
    lifted, failed = (n < grasps.until_balanced for n in counts)
    room = grasps.max_per_object - ordinary - slippery
    more = np.array([ordinary * lifted, (slippery or grasps.per_object or 0) * failed])
    more = np.minimum(more, room // max(1, int((more > 0).sum())))
    return ordinary + int(more[0]), slippery + int(more[1])


def _join_sets(parts: list[GraspSet]) -> GraspSet:
    """Joins ordinary and slippery grasps without duplicates; keeps the first provenance."""
    if len(parts) == 1:
        return parts[0]
    return replace(drop_equal_grasps(GraspSet.concatenate(parts)), provenance=parts[0].provenance)


def require_sound(scene: Scene, request: RunRequest) -> None:
    """Refuses a scene that cannot be judged.

    Raises:
        InvalidInputError: invalid scene, an arm that overlaps it or does not reach the board, or
            objects or a hand that the engine or the protocol does not support.
    """
    from burg_drake.motion import require_usable_arm
    from burg_drake.simulation import require_single_object
    from burg_drake.station import require_valid_scene

    station = request.station
    require_valid_scene(scene, station)
    if request.mode != "hand":
        require_usable_arm(scene, station)
    if request.settings.protocol == "shake":
        require_single_object(scene, station)
    require_scene_for(request.engine, scene, station)


def open_run(
    folder: Path,
    scene: Scene,
    request: RunRequest,
    given: Candidates | None,
    before_sampling: Callable[[], None] = lambda: None,
    *,
    sample: bool = True,
) -> Run:
    """Continues the run in a folder, or begins a new one there.

    Args:
        folder: folder of the run.
        scene: scene to judge.
        request: the request for the scene.
        given: the user's grasps; None to sample.
        before_sampling: called before grasps are sampled.
        sample: whether to sample grasps; if not, the run may return without, see `Run.is_sampled`.

    Raises:
        InvalidInputError: the folder holds another run.
    """
    document = request.document(folder, scene)
    candidates = given
    if candidates is not None:
        document = _record_grasps(document, scene, candidates, 0.0)
    if (folder / RUN_FILE).exists():
        run = load_run(folder)
        require_same_run(folder, run.document, document)
        write_copies(folder, scene, request.station)
        if not run.is_sampled:  # killed while it sampled and judged
            if not sample:
                return run
            before_sampling()
            return resample_run(run, run.document, scene, request.station)
        if document.grasps.until_balanced and run.candidates.content != run.document.grasps.content:
            # killed after the grasps of a round were written, but before run.yaml
            return resample_run(run, run.document, scene, request.station)
        return run
    if candidates is None and not sample:
        return create_run(folder, _expected_document(document, scene), scene, request.station)
    if candidates is None:
        before_sampling()
        start = time.process_time()
        candidates = sample_requested(scene, request.station, document)
        document = _record_grasps(document, scene, candidates, time.process_time() - start)
    document = replace(document, hash=run_hash(document))
    run = create_run(folder, document, scene, request.station, candidates)
    return run if given is None else run.with_candidates(given)


def resample_run(
    run: Run, document: RunDocument, scene: Scene, station: Station, before: Run | None = None
) -> Run:
    """Samples the grasps of a document and writes both; see `sample_requested`.

    Writes the candidates before run.yaml: if the call is killed in between, `open_run` notices
    the different hash of the candidates and samples the grasps of run.yaml again.
    """
    start = time.process_time()
    candidates = sample_requested(scene, station, document, before)
    cpu = document.grasps.cpu + time.process_time() - start
    return save_sampled(Run(run.path, document), scene, candidates, cpu)


def save_sampled(run: Run, scene: Scene, candidates: Candidates, cpu: float) -> Run:
    """Writes sampled grasps of a run, then its document, with the CPU time of sampling [s]."""
    document = _record_grasps(run.document, scene, candidates, cpu)
    candidates.save(run.path / GRASPS_FILE)
    document = replace(document, hash=run_hash(document))
    return save_run(Run(run.path, document).with_candidates(candidates))


def _expected_document(document: RunDocument, scene: Scene) -> RunDocument:
    """The document of a run before its grasps are sampled, with the numbers that are expected."""
    each = document.grasps.per_object or 0
    names = instances_to_sample(scene, document)
    objects: Counter[str] = Counter()
    for name in names:
        objects[scene.instance(name).object] += each
    grasps = replace(document.grasps, count=each * len(names), objects=dict(objects))
    return replace(document, grasps=grasps)


def _record_grasps(
    document: RunDocument, scene: Scene, candidates: Candidates, cpu: float
) -> RunDocument:
    names = instances_to_sample(scene, document)
    counts = Counter({scene.instance(name).object: 0 for name in names})
    for name, count in candidates.counts.items():
        counts[scene.instance(name).object] += count
    return replace(
        document,
        grasps=replace(
            document.grasps,
            correction=correction_of(candidates.grasps),
            count=len(candidates),
            objects=dict(counts),
            content=candidates.content,
            cpu=cpu,
        ),
    )


def open_rows(run: Run, *, retry_failed: bool) -> NDArray[np.int64]:
    """Rows of the assigned candidates that have no verdict, or are to be retried."""
    return np.flatnonzero(run.is_assigned & run.index.open(retry_failed=retry_failed))


def finish_run(run: Run, table: TableFormat, *, report: bool = True) -> Run:
    """Writes table and report unless they are up to date.

    Without `report`, only removes an outdated report.
    """
    if run.document.table != table:
        run = save_run(run.with_document(replace(run.document, table=table)))
    journal = run.path / JOURNAL_FILE
    if not _is_up_to_date(run.table_path, journal):
        write_table(run.table_path, run.rows(), asdict(run.document))
    if not _is_up_to_date(run.report_path, journal):
        run.report_path.unlink(missing_ok=True)
        if report:
            write_report(run)
    return run


def _is_up_to_date(path: Path, journal: Path) -> bool:
    return path.exists() and path.stat().st_mtime_ns >= journal.stat().st_mtime_ns


def require_judged(run: Run) -> None:
    """Refuses a run in which assigned grasps have no verdict.

    Raises:
        SimulationError: there are such grasps.
    """
    left = run.left
    if len(left):
        raise SimulationError(
            f"{len(left)} of {len(run.assigned_ids)} grasps have no verdict yet, such as"
            f" {run.candidates.id[left[0]]}; the results so far are kept: run the same command to"
            " continue"
        )


def require_scenes_judged(campaign: Campaign) -> None:
    """Refuses a run over many scenes with unfinished scenes; failed scenes count as finished.

    Raises:
        SimulationError: there are such scenes.
    """
    if left := campaign.open_scenes:
        raise SimulationError(
            f"{len(left)} of {len(campaign.names)} scenes are not complete ("
            f"{list_names(left)}); the results so far are kept: run the same command to"
            " continue"
        )
