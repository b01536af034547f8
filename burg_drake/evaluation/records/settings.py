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
        "number of grasps to sample on each object; only those at which the open hand collides"
        " with nothing, and its pads meet the object within the friction cones",
        flags=("-n",),
        low=1,
    )
    until_balanced: int | None = setting(
        None,
        "after the first grasps, go on sampling until each object has N that are lifted and N that"
        " are not, so that trials on the robot can be balanced; of one scene",
        low=1,
    )
    balanced_among: Among = setting(
        "executed",
        "with {until_balanced}, count the grasps that were tried in simulation, those that the arm"
        " can be at, those at which the hand is clear, or all, as `trials plan` chooses among them"
        " (default: executed)",
        choices=get_args(Among),
    )
    max_grasps_per_object: int = setting(
        1000, "with {until_balanced}, sample no more than N grasps on each object", low=1
    )
    approach_angle_deg: float = setting(
        DEFAULT_APPROACH_ANGLE_DEG,
        "in a scene, sample grasps whose approach is within this angle of straight down"
        f" (default: {DEFAULT_APPROACH_ANGLE_DEG:g}; 180: any)",
        name="approach_angle",
        metavar="DEG",
        above=0,
        high=180,
        noun="an angle in degrees",
    )
    blind: bool = setting(
        False,
        "sample by contact points alone, regardless of the hand, as in the literature",
    )
    only: Iterable[str] | None = None
    mode: Mode | None = setting(
        None,
        "hand: simulate all grasps with the hand alone, which begins at the grasp, open: its"
        " approach is not simulated (see {approach}); reach: likewise those that the arm can"
        " execute; arm: those, with the whole arm from the pregrasp on (default: reach, or hand if"
        " there is no arm)",
        choices=MODES,
    )
    engine: Engine | str = setting(
        DEFAULT_ENGINE,
        "engine preset: for reference values, for results, for a first look, or a second opinion"
        " by MuJoCo (needs burg-drake[mujoco])",
        choices=tuple(ENGINES),
    )
    tilt_limit_deg: float = setting(
        DEFAULT_TILT_LIMIT_DEG,
        "what is held, but turned in the hand by more than this, ends as lifted_turned and not as"
        " lifted (180: no limit)",
        name="tilt_limit",
        metavar="DEG",
        above=0,
        high=180,
        noun="an angle in degrees",
    )
    slip_limit_mm: float = setting(
        DEFAULT_SLIP_LIMIT_MM,
        "likewise what slid in the hand by more than this (inf: no limit)",
        metavar="MM",
        above=0,
        infinite=True,
    )
    approach: bool = setting(
        False,
        "with the hand alone, simulate its approach, too: straight from the pregrasp, open;"
        " otherwise it begins at the grasp. The whole arm (mode arm) does so anyway",
    )
    motion: GraspMotion | None = None
    seed: int = setting(0, "seed of the sampling", high=LARGEST_SEED)
    shard: Shard | str | None = setting(
        None,
        "judge a share of the work, such as 2/8, on one of several machines: every N-th scene, or"
        " of fewer than N scenes every N-th grasp; merge them with burg-drake merge",
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
