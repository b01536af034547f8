"""What is asked about the grasps of scenes, in one object: the settings of `evaluate`."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass
from typing import TYPE_CHECKING, get_args

from burg_drake.core import LARGEST_SEED, InvalidInputError, nearest, quoted, setting
from burg_drake.core.grasps import MODES, Among
from burg_drake.evaluation.candidates import DEFAULT_APPROACH_ANGLE_DEG
from burg_drake.simulation.trials import DEFAULT_TRIAL
from burg_drake.station.document import DEFAULT_ENGINE, ENGINES

if TYPE_CHECKING:
    from burg_drake.core.grasps import Mode
    from burg_drake.evaluation.records.run_document import TableFormat
    from burg_drake.evaluation.records.shard import Shard
    from burg_drake.station.document import Engine, GraspMotion

DEFAULT_TILT_LIMIT_DEG = round(math.degrees(DEFAULT_TRIAL.tilt_limit), 9)
DEFAULT_SLIP_LIMIT_MM = round(1000.0 * DEFAULT_TRIAL.slip_limit, 9)


@dataclass(frozen=True, kw_only=True)
class EvaluationSettings:
    """Which grasps are judged, and how.

    Example::

        settings = burg.EvaluationSettings(grasps_per_object=20, only=("mug",), engine="screening")
        burg.evaluate("tabletop_six", "panda_tabletop", "runs/mug", settings=settings)

    Attributes:
        grasps_per_object: antipodal grasps to sample for each free instance, unless grasps are
            given; the same ones as those of `sample_grasps` with these settings. Of an object that
            has fewer, `Summary.notes` says why.
        until_balanced: go on sampling until so many grasps of each object are lifted, and so many
            are not: first the grasps of a longer sampling with the same seed, then, where failures
            are missing, slippery ones (see `SamplingSettings`). `Summary.notes` says what is still
            missing. Of one scene only. None samples `grasps_per_object` alone.
        balanced_among: which grasps count for that, as in `trials.SelectionSettings`.
        max_grasps_per_object: with `until_balanced`, sample no more for each free instance.
        approach_angle_deg: largest angle between the approach of sampled grasps and straight down,
            above 0; 90 is as far as from the side, 180 from anywhere.
        blind: sample without regard to the hand; otherwise it is clear of the scene at all grasps,
            see `SamplingSettings`.
        only: names of free instances, or of objects for all their instances, to judge grasps of;
            all if None.
        mode: `hand`: the hand alone executes grasps that are clear. `reach`: those that the arm can
            execute, too, with a path, a straight approach and a straight lift. `arm`: those, and
            the whole arm executes them. None is `reach` if the station has an arm, else `hand`.
        engine: how trials are stepped; an engine or the name of a preset.
        tilt_limit_deg: a target that turns in the hand by more than this since the grip, and is
            held, ends as `lifted_turned`, above 0; 180 is no limit.
        slip_limit_mm: likewise of one that slides; infinite is no limit.
        approach: whether the hand alone begins at the pregrasp and goes straight to the grasp in
            simulation, too. Otherwise it begins at the grasp, open. The whole arm does so anyway.
        motion: how the hand goes to a grasp and away from it; as the station says if None.
        seed: of the sampling.
        shard: a share of the work, such as `2/8`: of at least as many scenes every eighth one, of
            fewer every eighth grasp of each. `merge_runs` merges the shares.
        table: format of the results file.
        scene_reports: whether each of several scenes gets a report of its own; None if they are at
            most a hundred, as one takes some tenths of a second. `write_report` makes it later.

    Raises:
        InvalidInputError: no grasps are asked for, or a limit is not one.
    """

    grasps_per_object: int = setting(
        100,
        "grasps to sample on each object, of those where the open hand is clear",
        flags=("-n",),
        low=1,
    )
    until_balanced: int | None = setting(
        None,
        "sample until each object has N lifted and N failed grasps (one scene)",
        low=1,
    )
    balanced_among: Among = setting(
        "executed",
        "with {until_balanced}, which grasps count (default: executed)",
        choices=get_args(Among),
    )
    max_grasps_per_object: int = setting(
        1000, "with {until_balanced}, at most N grasps on each object", low=1
    )
    approach_angle_deg: float = setting(
        DEFAULT_APPROACH_ANGLE_DEG,
        "largest angle of the approach from straight down (default:"
        f" {DEFAULT_APPROACH_ANGLE_DEG:g}; 180: any)",
        name="approach_angle",
        metavar="DEG",
        above=0,
        high=180,
        noun="an angle in degrees",
    )
    blind: bool = setting(
        False,
        "also sample grasps where the hand collides",
    )
    only: Iterable[str] | None = None
    mode: Mode | None = setting(
        None,
        "hand: simulate the hand alone, from the grasp on; reach: the same, only grasps that the"
        " arm can execute; arm: the whole arm, from the pregrasp on (default: reach, or hand"
        " without an arm)",
        choices=MODES,
    )
    engine: Engine | str = setting(
        DEFAULT_ENGINE,
        "physics: reference (most accurate), standard, screening (fast), or mujoco for a second"
        " opinion (needs burg-drake[mujoco])",
        choices=tuple(ENGINES),
    )
    tilt_limit_deg: float = setting(
        DEFAULT_TILT_LIMIT_DEG,
        "objects that turned more in the hand are lifted_turned (180: no limit)",
        name="tilt_limit",
        metavar="DEG",
        above=0,
        high=180,
        noun="an angle in degrees",
    )
    slip_limit_mm: float = setting(
        DEFAULT_SLIP_LIMIT_MM,
        "likewise for objects that slid (inf: no limit)",
        metavar="MM",
        above=0,
        infinite=True,
    )
    approach: bool = setting(
        False,
        "with the hand alone, simulate its straight approach, too",
    )
    motion: GraspMotion | None = None
    seed: int = setting(0, "random seed of the sampling", high=LARGEST_SEED)
    shard: Shard | str | None = setting(
        None,
        "evaluate one share of the work, such as 2/8; burg-drake merge joins them",
        metavar="K/N",
    )
    table: TableFormat = setting(
        "csv", "format of the table of results", choices=("csv", "parquet")
    )
    scene_reports: bool | None = None

    def __post_init__(self) -> None:
        only = (self.only,) if isinstance(self.only, str) else tuple(self.only or ()) or None
        object.__setattr__(self, "only", only)
        if self.grasps_per_object < 1:
            raise InvalidInputError(
                f"grasps_per_object is {self.grasps_per_object}; give 1 or more"
            )
        if self.until_balanced is not None:
            self._require_balance()
        else:
            self._require_no_balance()
        if not 0.0 < self.tilt_limit_deg <= 180.0:
            raise InvalidInputError(
                f"tilt_limit_deg is {self.tilt_limit_deg:g}; give more than 0 (180: no limit)"
            )
        if not self.slip_limit_mm > 0.0:
            raise InvalidInputError(
                f"slip_limit_mm is {self.slip_limit_mm:g}; give more than 0 (inf: no limit)"
            )

    def _require_no_balance(self) -> None:
        """Refuses what would have no effect without `until_balanced`."""
        for name in ("balanced_among", "max_grasps_per_object"):
            if getattr(self, name) != getattr(EvaluationSettings, name):
                raise InvalidInputError(
                    f"{name} has no effect without until_balanced; add that, or leave it out"
                ).about(name, "until_balanced")

    def _require_balance(self) -> None:
        """Refuses what cannot be had with `until_balanced`."""
        assert self.until_balanced is not None
        if self.until_balanced < 1:
            raise InvalidInputError(f"until_balanced is {self.until_balanced}; give 1 or more")
        if self.balanced_among not in get_args(Among):
            known = nearest(str(self.balanced_among), get_args(Among))
            raise InvalidInputError(
                f"there is no balanced_among {quoted(self.balanced_among)}; {known}"
            )
        if self.max_grasps_per_object < self.grasps_per_object:
            raise InvalidInputError(
                f"grasps_per_object is {self.grasps_per_object}, but"
                f" max_grasps_per_object only {self.max_grasps_per_object}; give a larger"
                " maximum"
            ).about("max_grasps_per_object")
        if self.shard is not None:
            raise InvalidInputError(
                "until_balanced has to know all grasps, but a shard judges only some of"
                " them; leave out one of the two"
            ).about("until_balanced", "shard")
