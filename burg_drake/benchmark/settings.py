"""Settings of suites and of benchmarks."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, fields
from typing import Any, ClassVar, Literal, get_args

from burg_drake.core import Ranges, Units, require_ranges, setting

Split = Literal["tuning", "test"]
Protocol = Literal["single", "clear"]
SUITE_FOLDER = "scenes/suites"
"""Kind of the built-in suites, for `resolve_reference`."""
VERIFIED_GRASPS = 20
"""Number of grasps that are judged again by default."""


@dataclass(frozen=True, kw_only=True)
class Budget:
    """What a planner may use for one observation.

    Attributes:
        grasps: number of grasps that are judged: the best of the answer, without those that are
            near a better one.
        seconds: time for the answer [s].
        picks: number of grasps that are executed to clear a scene.
    """

    WRITTEN_WHOLE: ClassVar[bool] = True
    RANGES: ClassVar[Ranges] = {
        "grasps": (1, 10_000),
        "seconds": (0.001, 86_400.0),
        "picks": (1, 99),
    }

    grasps: int = setting(10, "grasps of each answer that are judged", low=1)
    seconds: float = setting(60.0, "time for an answer [s]", above=0)
    picks: int = setting(20, "grasps executed to clear a scene", low=1, high=99)

    def __post_init__(self) -> None:
        require_ranges(self)


@dataclass(frozen=True, kw_only=True)
class Conditions:
    """How far sensor, calibration and friction are from what the suite says. Change one at a time.

    Attributes:
        depth_noise: standard deviations of the depth, as a multiple of the sensor's. Holes and
            flying pixels stay.
        camera_shift: standard deviation of the error of the camera's position along each axis, in
            the pose that the planner is told [m].
        camera_turn: standard deviation of the error of its orientation about each axis [rad].
        friction: friction coefficient of the object that is grasped, as a multiple of its own.
    """

    WRITTEN_WHOLE: ClassVar[bool] = True
    RANGES: ClassVar[Ranges] = {
        "depth_noise": (0.0, 10.0),
        "camera_shift": (0.0, 1.0),
        "camera_turn": (0.0, math.pi),
        "friction": (0.01, 100.0),
    }

    depth_noise: float = setting(
        1.0,
        "standard deviations of depth, as a multiple of the sensor's",
        metavar="FACTOR",
        low=0,
        high=10,
    )
    camera_shift: float = setting(
        0.0,
        "error of the camera's position in the told pose",
        unit=Units.millimetres,
        low=0,
        high=1000,
    )
    camera_turn: float = setting(
        0.0,
        "error of the camera's orientation in the told pose",
        unit=Units.degrees,
        low=0,
        high=180,
    )
    friction: float = setting(
        1.0,
        "friction of grasped objects, as a multiple of their own",
        metavar="FACTOR",
        low=0.01,
        high=100,
    )

    def __post_init__(self) -> None:
        require_ranges(self)

    @property
    def changes(self) -> dict[str, float]:
        """Values that differ from those of the suite, by name."""
        return {
            field.name: getattr(self, field.name)
            for field in fields(self)
            if getattr(self, field.name) != field.default
        }

    def __str__(self) -> str:
        """Such as `depth noise x 2`; `as in the suite` if nothing differs."""
        return ", ".join(_TEXTS[name](value) for name, value in self.changes.items()) or (
            "as in the suite"
        )


_TEXTS: dict[str, Any] = {
    "depth_noise": lambda value: f"depth noise x {value:g}",
    "camera_shift": lambda value: f"camera shift {1e3 * value:g} mm",
    "camera_turn": lambda value: f"camera turn {math.degrees(value):g} deg",
    "friction": lambda value: f"friction x {value:g}",
}


@dataclass(frozen=True, kw_only=True)
class BenchmarkSettings:
    """Settings of a benchmark.

    Attributes:
        name: name of the method in tables; the planner's own if empty.
        protocol: `single`: the answer to each observation is judged. `clear`: of each answer the
            best grasp that can be executed is executed in simulation; an object that is held is
            taken away, the others come to rest, and the planner is asked again; until a scene is
            empty, three attempts in a row fail, or the suite's budget of picks ends.
        split: the scenes that are observed: those for the `test`, or for `tuning`.
        depth_only: give the planner no colour images, which need a renderer.
        settle: engine that judges contested grasps again; none if empty.
        conditions: how sensor, calibration and friction differ from the suite.
        depth_unit: unit of the depth images of a real camera [m]; if None, whole numbers are
            millimetres, others metres.
    """

    name: str = setting("", "name of the method in tables (default: the planner's)", metavar="NAME")
    protocol: Protocol = setting(
        "single",
        "single: judge one answer for each image; clear: execute the best feasible grasp, take the"
        " object away, look again, until the scene is empty",
        choices=get_args(Protocol),
    )
    split: Split = setting(
        "test", "scenes that count, or those for tuning a planner", choices=get_args(Split)
    )
    depth_only: bool = setting(False, "give the planner no colour images, which need a renderer")
    settle: str = setting(
        "",
        "judge contested grasps again with this engine, such as reference (default: none)",
        metavar="ENGINE",
    )
    conditions: Conditions = field(default_factory=Conditions)
    depth_unit: float | None = None
