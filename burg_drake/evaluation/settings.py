"""Settings of evaluation, sampling and robustness, and shards of runs."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Literal, TypeVar, get_args

from burg_drake.core import (
    MAX_DOCUMENT_SEED,
    MODES,
    Among,
    InvalidInputError,
    Units,
    UnknownNameError,
    quote_value,
    setting,
    suggest_names,
)
from burg_drake.simulation import (
    DEFAULT_TRIAL,
    TRIAL_PROTOCOLS,
    FrictionSettings,
    LoadSettings,
    Noise,
    TrialProtocol,
)
from burg_drake.station import DEFAULT_ENGINE, ENGINES

if TYPE_CHECKING:
    from burg_drake.core import Array, Mode
    from burg_drake.station import Engine, GraspMotion

TableFormat = Literal["csv", "parquet"]

DEFAULT_APPROACH_ANGLE_DEG = 75.0
"""Keeps the hand above the horizontal. For friction up to tan(15 deg) = 0.27 it also excludes
contacts on bottom and top of an object, for which one finger would be below the table."""

SLIPPERY_FRICTION_FACTOR = 4.0
"""Slippery grasps need up to this many times the available friction. On the objects of
`tabletop_six` two thirds of them fail in simulation, compared to a tenth of ordinary grasps; with a
factor of 2 a sixth fails, and none on two of the objects."""


@dataclass(frozen=True, kw_only=True)
class SamplingSettings:
    """Settings of the grasp sampling on each object; details in `grasping.antipodal_sampling`.

    Example::

        wide = burg.SamplingSettings(approach_angle_deg=90.0)
        burg.sample_grasps("tabletop_six", "panda_tabletop", 20, settings=wide)

    Attributes:
        friction: friction coefficient; the object's if None.
        approaches: number of approach angles for each pair of contacts.
        approach_angle_deg: in a scene, largest angle between the approach and straight down, above
            0 and at most 180, which allows all directions. `DEFAULT_APPROACH_ANGLE_DEG` if None.
        from_arm_side: in a scene, exclude approaches that point back to the arm: the inner product
            with the horizontal direction from the arm's base to the middle of the object must not
            be negative.
        standoffs: distances between G and the contacts; every pose is returned for each [m].
        weights: density of contacts on the faces (F,) of `ObjectLibrary.surface`, by object.
        blind: only consider contact points, not the hand, as published samplers do. Otherwise the
            open hand overlaps neither the object nor, in a scene, anything else at the grasps, and
            the pads touch the object within the friction cones wherever they meet it.
        margin: unless `blind`, smallest signed clearance of a grasp [m].
        conservative: unless `blind`, the screen's mode of that name, which is faster but excludes a
            tenth of the clear grasps.
        diverse: sample this many times n grasps, and keep the n most diverse.
        slippery: only grasps that friction does not hold at both contacts: they need more than the
            available friction, up to `SLIPPERY_FRICTION_FACTOR` times as much, and their scores are
            below 0. Many of them fail in simulation. Fewer than n are returned, as some of the n
            sampled grasps need less.
    """

    friction: float | None = setting(
        None, "friction coefficient (default: the object's)", metavar="MU", above=0
    )
    approaches: int = setting(
        1, "approach directions for each pair of contacts", metavar="K", low=1
    )
    approach_angle_deg: float | None = None
    from_arm_side: bool = setting(
        False, "in a scene, leave out approaches that point back to the arm"
    )
    standoffs: tuple[float, ...] = (0.0,)
    weights: Mapping[str, Array] = field(default_factory=dict)
    blind: bool = False
    margin: float = setting(
        0.0, "smallest clearance of the open hand", unit=Units.millimetres, low=0
    )
    conservative: bool = setting(
        False, "faster clearance test that loses a tenth of the clear grasps"
    )
    diverse: int = setting(
        1, "sample K times as many, keep those farthest apart", metavar="K", low=1
    )
    slippery: bool = False

    def __post_init__(self) -> None:
        angle = self.approach_angle_deg
        if angle is not None and not 0.0 < angle <= 180.0:
            raise InvalidInputError(
                f"approach angle is {angle:g} degrees; give more than 0, at most 180"
            )
        if not 0.0 <= self.margin < math.inf:
            raise InvalidInputError(f"margin is {self.margin} m; give a clearance of 0 or more")
        if (self.margin or self.conservative) and self.blind:
            raise InvalidInputError(
                "margin and conservative concern the hand, which blind sampling ignores;"
                " leave them out, or do not sample blindly"
            )


@dataclass(frozen=True, kw_only=True)
class GraspLimits:
    """Limits on sampled grasps, and on the motion of a held target in the hand.

    Attributes:
        approach_angle_deg: largest angle between the approach of sampled grasps and straight down;
            180 for all directions.
        tilt_limit_deg: largest turn in the hand; 180 for no limit.
        slip_limit_mm: largest slide in the hand; infinite for no limit.
    """

    approach_angle_deg: float = DEFAULT_APPROACH_ANGLE_DEG
    tilt_limit_deg: float = round(math.degrees(DEFAULT_TRIAL.tilt_limit), 9)
    slip_limit_mm: float = round(1000.0 * DEFAULT_TRIAL.slip_limit, 9)


DEFAULT_LIMITS: Mapping[TrialProtocol, GraspLimits] = {
    "lift": GraspLimits(),
    "shake": GraspLimits(approach_angle_deg=180.0, tilt_limit_deg=180.0, slip_limit_mm=math.inf),
}
"""Limits that apply unless settings say otherwise. None to shaking, as in ACRONYM: no table is in
the way, and an object may move in the hand as long as both fingers touch it at the end."""

Shared = TypeVar("Shared")


@dataclass(frozen=True)
class Shard:
    """A shard `K/N`: one of N shares of the work.

    Attributes:
        number: number of this shard, from 1.
        count: number of shards.
    """

    number: int
    count: int

    def __post_init__(self) -> None:
        if not 1 <= self.number <= self.count <= 1_000_000:
            raise InvalidInputError(
                f"there is no shard {self.number}/{self.count}; give K/N with K from 1 to"
                " N, such as 2/8"
            )

    @classmethod
    def parse(cls, text: str) -> Shard:
        """Reads `K/N`.

        Raises:
            InvalidInputError: the text is not a shard.
        """
        found = re.fullmatch(r"(\d{1,7})/(\d{1,7})", text)
        if found is None:
            raise InvalidInputError(f"{quote_value(text)} is not a shard; give K/N, such as 2/8")
        return cls(int(found[1]), int(found[2]))

    def __str__(self) -> str:
        return f"{self.number}/{self.count}"

    def has(self, index: int) -> bool:
        """Whether the item with this index, from 0, belongs to the shard."""
        return index % self.count == self.number - 1

    def divides_scenes(self, scenes: int) -> bool:
        """Whether the shards divide scenes, as they do if there are enough; else their grasps."""
        return scenes >= self.count


def as_shard(shard: Shard | str | None) -> Shard | None:
    """Converts `K/N` to a shard; None for `1/1`, which is all of the work.

    Raises:
        InvalidInputError: there is no such shard.
    """
    found = Shard.parse(shard) if isinstance(shard, str) else shard
    return None if found is None or found.count == 1 else found


def select_share(items: Sequence[Shared], shard: Shard | str | None) -> Sequence[Shared]:
    """Selects the items of a shard; all items without one."""
    found = as_shard(shard or None)
    return items if found is None else items[found.number - 1 :: found.count]


@dataclass(frozen=True, kw_only=True)
class EvaluationSettings:
    """Settings of `evaluate`: selection of grasps, mode, engine, limits and outputs.

    Example::

        settings = burg.EvaluationSettings(grasps_per_object=20, only=("mug",), engine="screening")
        burg.evaluate("tabletop_six", "panda_tabletop", "runs/mug", settings=settings)

    Attributes:
        grasps_per_object: number of antipodal grasps to sample for each free instance, unless
            grasps are given; `sample_grasps` returns the same grasps for these settings. If an
            object gets fewer, `Summary.notes` says why.
        until_balanced: sample until this many grasps of each object are lifted, and as many are
            not: first more grasps with the same seed, then, if failures are missing, slippery
            grasps (see `SamplingSettings`). `Summary.notes` names objects that still have too few.
            For one scene only. None samples `grasps_per_object` once.
        balanced_among: grasps that count for `until_balanced`, as in `trials.SelectionSettings`.
        max_grasps_per_object: with `until_balanced`, largest number of grasps per free instance.
        approach_angle_deg: largest angle between the approach of sampled grasps and straight down,
            above 0; 90 includes approaches from the side, 180 all directions. If None, 75 with
            protocol `lift`, and 180 with `shake`.
        blind: sample without regard to the hand; otherwise it is clear of the scene at all grasps,
            see `SamplingSettings`.
        only: names of free instances, or of objects for all their instances, whose grasps are
            judged; all if None.
        mode: `hand`: the hand alone executes clear grasps. `reach`: the same, of grasps that the
            arm can also execute, with a path, a straight approach and a straight lift. `arm`: the
            whole arm executes those grasps. None for `reach` if the station has an arm, else
            `hand`.
        engine: physics engine of the trials; an engine or the name of a preset.
        device: where an engine with parallel trials runs: `cuda:0` and so on, or `cpu`; all cards
            if None. It is recorded with the versions.
        tilt_limit_deg: a held target that turned in the hand by more than this since the grip ends
            as `lifted_turned`, above 0; 180 for no limit. If None, 30 with protocol `lift`, and no
            limit with `shake`.
        slip_limit_mm: the same for a target that slid; infinite for no limit. If None, 20 with
            protocol `lift`, and no limit with `shake`.
        approach: whether trials of the hand alone also simulate the straight approach from the
            pregrasp. Otherwise they begin with the open hand at the grasp. The whole arm always
            approaches.
        motion: approach, retreat and lift of the hand; the station's if None.
        protocol: `lift`: the hand lifts a gripped object. `shake`: it is shaken with the object,
            which is alone and has no weight; only in mode `hand`. See `ShakeSettings`.
        seed: seed of the sampling.
        shard: a share of the work, such as `2/8`: every eighth scene, or every eighth grasp of each
            scene if there are fewer than eight. `merge_runs` merges the shards.
        table: format of the results file.
        scene_reports: whether each of several scenes gets its own report; None for at most 100
            scenes, as one takes some tenths of a second. `write_report` can make it later.

    Raises:
        InvalidInputError: no grasps are asked for, or a limit is not positive.
        UnknownNameError: there is no such protocol.
    """

    grasps_per_object: int = setting(
        100,
        "grasps to sample on each object, of those where the open hand is clear",
        flags=("-n",),
        low=1,
    )
    until_balanced: int | None = setting(
        None, "sample until each object has N lifted and N failed grasps (one scene)", low=1
    )
    balanced_among: Among = setting(
        "executed",
        "with {until_balanced}, which grasps count (default: executed)",
        choices=get_args(Among),
    )
    max_grasps_per_object: int = setting(
        1000, "with {until_balanced}, at most N grasps on each object", low=1
    )
    approach_angle_deg: float | None = setting(
        None,
        "largest angle of the approach from straight down (default for objects on a table:"
        f" {DEFAULT_APPROACH_ANGLE_DEG:g}; 180: any)",
        name="approach_angle",
        metavar="DEG",
        above=0,
        high=180,
        noun="an angle in degrees",
    )
    blind: bool = setting(False, "also sample grasps where the hand collides")
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
        "physics: reference (most accurate), standard, screening (fast), mujoco for a second"
        " opinion (needs burg-drake[mujoco]), or mujoco-gpu for a great many grasps (needs"
        " burg-drake[gpu] and an NVIDIA card)",
        choices=tuple(ENGINES),
    )
    device: str | None = setting(
        None,
        "with engine mujoco-gpu: cuda:0, cuda:1, ..., or cpu for a try (default: all cards)",
        metavar="DEVICE",
    )
    tilt_limit_deg: float | None = setting(
        None,
        "objects that turned more in the hand are lifted_turned (default for objects on a table:"
        f" {GraspLimits.tilt_limit_deg:g}; 180: no limit)",
        name="tilt_limit",
        metavar="DEG",
        above=0,
        high=180,
        noun="an angle in degrees",
    )
    slip_limit_mm: float | None = setting(
        None,
        "likewise for objects that slid (default for objects on a table:"
        f" {GraspLimits.slip_limit_mm:g}; inf: no limit)",
        metavar="MM",
        above=0,
        infinite=True,
    )
    approach: bool = setting(False, "with the hand alone, simulate its straight approach, too")
    motion: GraspMotion | None = None
    protocol: TrialProtocol = setting(
        "lift",
        "with the hand alone, lift: lift the object off the table; shake: shake it alone in the"
        " air, without gravity",
        choices=TRIAL_PROTOCOLS,
    )
    seed: int = setting(0, "random seed of the sampling", high=MAX_DOCUMENT_SEED)
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
        if self.protocol not in TRIAL_PROTOCOLS:
            known = suggest_names(str(self.protocol), TRIAL_PROTOCOLS)
            raise UnknownNameError(
                f"protocol {quote_value(self.protocol)} does not exist; {known}"
            ).about("protocol")
        if self.tilt_limit_deg is not None and not 0.0 < self.tilt_limit_deg <= 180.0:
            raise InvalidInputError(
                f"tilt_limit_deg is {self.tilt_limit_deg:g}; give more than 0 (180: no limit)"
            )
        if self.slip_limit_mm is not None and not self.slip_limit_mm > 0.0:
            raise InvalidInputError(
                f"slip_limit_mm is {self.slip_limit_mm:g}; give more than 0 (inf: no limit)"
            )

    def _require_no_balance(self) -> None:
        """Refuses settings that have no effect without `until_balanced`."""
        for name in ("balanced_among", "max_grasps_per_object"):
            if getattr(self, name) != getattr(EvaluationSettings, name):
                raise InvalidInputError(
                    f"{name} has no effect without until_balanced; add that, or leave it out"
                ).about(name, "until_balanced")

    def _require_balance(self) -> None:
        """Refuses settings that cannot be combined with `until_balanced`."""
        assert self.until_balanced is not None
        if self.until_balanced < 1:
            raise InvalidInputError(f"until_balanced is {self.until_balanced}; give 1 or more")
        if self.balanced_among not in get_args(Among):
            known = suggest_names(str(self.balanced_among), get_args(Among))
            raise InvalidInputError(
                f"there is no balanced_among {quote_value(self.balanced_among)}; {known}"
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


def grasp_limits(settings: EvaluationSettings) -> GraspLimits:
    """The limits that apply: those that the settings give, else those of their protocol."""
    names = GraspLimits.__dataclass_fields__
    given = {name: value for name in names if (value := getattr(settings, name)) is not None}
    return replace(DEFAULT_LIMITS[settings.protocol], **given)


ROBUSTNESS_TESTS = ("tug", "shake", "friction", "noise")  # Names of the tests.
LOADED_TESTS = ("tug", "shake")
"""Tests that apply loads to a grip, which needs Drake."""
DEFAULT_BEST_COUNT = 3
"""Number of best grasps of each object that are tested by default."""


@dataclass(frozen=True, kw_only=True)
class RobustnessSettings:
    """Settings of the robustness tests.

    Attributes:
        tests: names of the tests, from `ROBUSTNESS_TESTS`.
        loads: loads of tug and shake.
        friction: range of tested friction coefficients.
        noise: standard deviations of the perturbed repeats.
        repeats: number of perturbed repeats.
        seed: seed of the perturbations.
    """

    tests: tuple[str, ...] = ROBUSTNESS_TESTS
    loads: LoadSettings = field(default_factory=LoadSettings)
    friction: FrictionSettings = field(default_factory=FrictionSettings)
    noise: Noise = field(default_factory=Noise)
    repeats: int = setting(20, "repeats of each grasp with noise", metavar="K", low=1)
    seed: int = 0

    def __post_init__(self) -> None:
        for test in self.tests:
            if test not in ROBUSTNESS_TESTS:
                raise UnknownNameError(
                    f"test {test!r} does not exist; {suggest_names(test, ROBUSTNESS_TESTS)}"
                )
        if not self.tests or self.repeats < 1:
            raise InvalidInputError("give at least one test, and repeats from 1")

    def content(self, test: str) -> list[object]:
        """JSON values of the settings that determine the answers of a test."""
        if test == "friction":
            return [vars(self.friction)]
        return [vars(self.noise), self.seed] if test == "noise" else [vars(self.loads)]
