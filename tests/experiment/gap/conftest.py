"""A run of the hand alone, shared by all tests of the gap."""

from __future__ import annotations

import math
from collections.abc import Generator, Iterable, Iterator

import numpy as np
import pytest

from burg_drake.core import GraspSet, Verdict, grasp_from_axes, make_pose
from burg_drake.evaluation import (
    Candidate,
    EvaluationSettings,
    Job,
    OnFailure,
    Run,
    evaluate,
    judge_grasp,
)

ABOVE = grasp_from_axes((1, 0, 0), (0, 0, -1), (0.0, 0.0, 0.18))
"""Across the narrow side of the household box, from above."""
TILT = math.radians(115.0)
FROM_BELOW = grasp_from_axes((1, 0, 0), (0, math.sin(TILT), -math.cos(TILT)), (0.0, -0.064, 0.19))
"""At the box's upper edge, from the side and below: the hand lifts the box, but the arm would
collide with the table."""
GRASPS = np.stack([ABOVE, FROM_BELOW, ABOVE @ make_pose(p_AB=(0, 0, 0.1))])


class Here:
    """An executor in this process, as starting others takes longer than these few trials."""

    workers = 1

    def judge(
        self, jobs: Iterable[Job], on_failure: OnFailure | None = None
    ) -> Generator[tuple[Job, Candidate, Verdict], None, None]:
        """Judges one candidate after the other."""
        for job in jobs:
            judge = job.make_judge()
            for candidate in job.candidates:
                yield job, candidate, judge_grasp(judge, candidate)


@pytest.fixture(scope="module", autouse=True)
def no_chart_of_reach() -> Iterator[None]:
    """Leaves out the section on reachability, which takes longest and has tests in
    `tests/evaluation`."""
    with pytest.MonkeyPatch.context() as patch:
        place = "burg_drake.evaluation.report.pages.reachability_section"
        patch.setattr(place, lambda run: None)
        yield


@pytest.fixture(scope="session")
def run(tmp_path_factory: pytest.TempPathFactory) -> Run:
    """A run on the household box; its grasps are lifted, lifted but out of the arm's reach, and in
    collision with the box."""
    return evaluate(
        "tabletop_six",
        "panda_tabletop",
        tmp_path_factory.mktemp("gap_source") / "run",
        settings=EvaluationSettings(engine="screening", mode="hand"),
        grasps={"box": GraspSet.create(GRASPS, object="box", width=0.06)},
        executor=Here(),
        progress=False,
    )
