"""Settings of suites and of benchmarks."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import ClassVar, Literal, get_args

from burg_drake.benchmark.conditions import Conditions
from burg_drake.core import Ranges, require_ranges, setting

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
