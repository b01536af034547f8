"""Settings of evaluation, sampling and robustness, and shards of runs."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
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
from burg_drake.simulation import DEFAULT_TRIAL, FrictionSettings, LoadSettings, Noise
from burg_drake.station import DEFAULT_ENGINE, ENGINES

if TYPE_CHECKING:
    from burg_drake.core import Array, Mode
    from burg_drake.station import Engine, GraspMotion

TableFormat = Literal["csv", "parquet"]

DEFAULT_APPROACH_ANGLE_DEG = 75.0
"""Keeps the hand above the horizontal, and leaves out pairs of an object's bottom and top for
friction up to tan(15 deg) = 0.27: one of the two fingers would be below the table."""

SLIPPERY_FRICTION_FACTOR = 4.0
"""Slippery grasps need up to so many times the friction that there is. On the objects of
`tabletop_six` two thirds of them fail in simulation, where a tenth of ordinary ones do; with 2 a
sixth fails, and none on two of the objects."""


@dataclass(frozen=True, kw_only=True)
class SamplingSettings:
    """How grasps are sampled on each object; more on these in `grasping.antipodal_sampling`.

    Example::

        wide = burg.SamplingSettings(approach_angle_deg=90.0)
        burg.sample_grasps("tabletop_six", "panda_tabletop", 20, settings=wide)

    Attributes:
        friction: coefficient; the object's own if None.
        approaches: approach angles for each pair of contacts.
        approach_angle_deg: in a scene, largest angle between the approach and straight down, above
            0 to 180; with 180 the hand comes from anywhere. `DEFAULT_APPROACH_ANGLE_DEG` if None.
        from_arm_side: in a scene, the approach has no part that points back to the arm: its inner
            product with the horizontal direction from the arm's base to the middle of the object
            is not negative.
        standoffs: distances between G and the contacts that every pose is given with [m].
        weights: density of contacts on the faces (F,) of `ObjectLibrary.surface`, by object.
        blind: know only points of contact, not the hand, as published samplers do. Otherwise the
            open hand overlaps nothing at the grasps, in a scene neither the object nor anything
            else, in a library not the object; and its pads, all that they meet of the object,
            touch it within the friction cones.
        margin: unless `blind`, least signed clearance that a grasp has to have [m].
        conservative: unless `blind`, the screen's mode of that name: faster, but it leaves out a
            tenth of the clear grasps.
        diverse: of this many times n grasps the most diverse n are kept.
        slippery: only grasps that the friction does not hold at both points of contact: they need
            more than there is, up to `SLIPPERY_FRICTION_FACTOR` times as much, and their scores are
            below 0. Many of them fail in simulation. There are fewer than n, as some of the n that
            are sampled need less.
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


Shared = TypeVar("Shared")


@dataclass(frozen=True)
class Shard:
    """One of several shares.

    Attributes:
        number: of this one, from 1.
        count: how many there are.
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
            InvalidInputError: it is something else.
        """
        found = re.fullmatch(r"(\d{1,7})/(\d{1,7})", text)
        if found is None:
            raise InvalidInputError(f"{quote_value(text)} is not a shard; give K/N, such as 2/8")
        return cls(int(found[1]), int(found[2]))

    def __str__(self) -> str:
        return f"{self.number}/{self.count}"

    def has(self, place: int) -> bool:
        """Whether what has this place, from 0, is in it."""
        return place % self.count == self.number - 1

    def divides_scenes(self, scenes: int) -> bool:
        """Whether scenes are shared out as wholes, as they are if there are enough; otherwise the
        grasps of each."""
        return scenes >= self.count


def as_shard(shard: Shard | str | None) -> Shard | None:
    """A shard, or what `K/N` says; none if there are no others.

    Raises:
        InvalidInputError: it does not exist.
    """
    found = Shard.parse(shard) if isinstance(shard, str) else shard
    return None if found is None or found.count == 1 else found


def select_share(items: Sequence[Shared], shard: Shard | str | None) -> Sequence[Shared]:
    """What of some items is in a shard; all of them without one."""
    found = as_shard(shard or None)
    return items if found is None else items[found.number - 1 :: found.count]


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
        "physics: reference (most accurate), standard, screening (fast), or mujoco for a second"
        " opinion (needs burg-drake[mujoco])",
        choices=tuple(ENGINES),
    )
    tilt_limit_deg: float = setting(
        round(math.degrees(DEFAULT_TRIAL.tilt_limit), 9),
        "objects that turned more in the hand are lifted_turned (180: no limit)",
        name="tilt_limit",
        metavar="DEG",
        above=0,
        high=180,
        noun="an angle in degrees",
    )
    slip_limit_mm: float = setting(
        round(1000.0 * DEFAULT_TRIAL.slip_limit, 9),
        "likewise for objects that slid (inf: no limit)",
        metavar="MM",
        above=0,
        infinite=True,
    )
    approach: bool = setting(False, "with the hand alone, simulate its straight approach, too")
    motion: GraspMotion | None = None
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


ROBUSTNESS_TESTS = ("tug", "shake", "friction", "noise")  # Names of the tests.
LOADED_TESTS = ("tug", "shake")
"""Those that put loads on a grip, which needs Drake."""
DEFAULT_BEST_COUNT = 3
"""Best grasps of each object that are tested if none are named."""


@dataclass(frozen=True, kw_only=True)
class RobustnessSettings:
    """What is asked about each grasp.

    Attributes:
        tests: some of `ROBUSTNESS_TESTS`.
        loads: of tug and shake.
        friction: coefficients that are tried.
        noise: standard deviations of the perturbed repeats.
        repeats: number of perturbed repeats.
        seed: of the perturbations.
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
        """What decides about the answers of a test."""
        if test == "friction":
            return [vars(self.friction)]
        return [vars(self.noise), self.seed] if test == "noise" else [vars(self.loads)]
