"""Figures of sets whose grasps were laid out by hand."""

from __future__ import annotations

import math

import numpy as np
import pytest
from grasp_samples import about, crowded_grasps

from burg_drake.core import GraspSet, make_pose, swap_fingers
from burg_drake.grasping import (
    DISTANCE_VERSION,
    DISTRIBUTION_QUANTILES,
    Share,
    Tolerance,
    compare_grasps,
    coverage,
    distribution,
    precision,
    summarize,
)

NAN = math.nan


def line(*x: float, object: str | list[str] = "mug") -> GraspSet:
    """Grasps at these places along x [m]."""
    return GraspSet.create(
        make_pose(p_AB=np.array(x)[:, None] * np.array([1.0, 0.0, 0.0])), object=object
    )


def test_distribution_by_hand() -> None:
    d = distribution([3.0, NAN, 1.0, math.inf, 2.0])
    assert (d.count, d.missing, d.mean, d.median) == (3, 2, 2.0, 2.0)
    assert d.quantiles == (1.0, 1.1, 1.5, 2.0, 2.5, 2.9, 3.0)
    assert len(d.quantiles) == len(DISTRIBUTION_QUANTILES)


def test_distribution_of_nothing() -> None:
    d = distribution([NAN])
    assert (d.count, d.missing) == (0, 1)
    assert math.isnan(d.mean)
    assert math.isnan(d.median)


def test_summary_by_hand() -> None:
    grasps = line(0.0, 0.0, 0.02, 0.5, object=["mug", "mug", "mug", "box"])
    grasps = GraspSet.create(
        np.concatenate([grasps.X_OG, swap_fingers(grasps.X_OG[:1])]),
        object=[*grasps.object, "mug"],
        width=[0.01, 0.03, NAN, 0.05, 0.02],
        score=[1, 2, 3, 4, 0],
        columns={
            "instance": ["a", "a", "a", "c", "b"],
            "outcome": ["lifted", "slipped", "lifted", "lifted", ""],
            "ok": [True, False, True, True, False],
            "clearance": [0.001, NAN, NAN, 0.003, 0.002],
        },
    )
    summary = summarize(grasps)
    mug = summary.objects["mug"]
    assert (mug.grasps, mug.instances, mug.duplicates) == (4, 2, 2)
    assert mug.neighbour.count == 3  # the one on b is alone there
    assert mug.neighbour.quantiles[-1] == 0.02
    assert mug.width.mean == pytest.approx(0.02)
    assert mug.score.mean == 1.5
    assert (summary.overall.grasps, summary.overall.instances) == (5, 3)
    assert summary.numbers["x"].quantiles[-1] == 0.5
    assert (summary.numbers["clearance"].count, summary.numbers["clearance"].missing) == (3, 2)
    assert summary.truths == {"ok": Share(3, 5)}
    assert summary.texts["outcome"] == {"lifted": 3, "": 1, "slipped": 1}
    assert list(summary.texts["outcome"]) == ["lifted", "", "slipped"]
    assert set(summary.texts) == {"instance", "outcome"}
    assert summary.version == DISTANCE_VERSION


def test_duplicates_count_in_either_finger_form() -> None:
    X = crowded_grasps(5, 1)
    twice = GraspSet.create(np.concatenate([X, swap_fingers(X[:3])]), object="mug")
    assert summarize(twice).overall.duplicates == 6


def test_comparison_by_hand() -> None:
    a = line(0.0, 0.1, 0.2, 0.9, object=["mug", "mug", "mug", "box"])
    b = GraspSet.concatenate(
        [line(0.0, 0.11, 0.5, 0.7, object=["mug", "mug", "mug", "can"]), line(0.2)]
    )
    b = GraspSet.concatenate(
        [b.select([0, 1, 2, 3]), GraspSet.create(b.X_OG[4] @ about("y", 5.0), object="mug")]
    )
    comparison = compare_grasps(a, b, Tolerance(translation=0.02, angle=math.radians(4.0)))
    mug = comparison.objects["mug"]
    assert mug.coverage == Share(2, 3)
    assert mug.precision == Share(2, 4)
    np.testing.assert_allclose(
        mug.to_grasps.quantiles, np.quantile([0.0, 0.01, 0.005], DISTRIBUTION_QUANTILES), atol=1e-15
    )
    np.testing.assert_allclose(
        mug.to_reference.quantiles,
        np.quantile([0.0, 0.01, 0.3, 0.005], DISTRIBUTION_QUANTILES),
        atol=1e-15,
    )
    np.testing.assert_allclose(mug.translation.quantiles[-1], 0.01, atol=1e-15)
    np.testing.assert_allclose(mug.angle.quantiles[-1], math.radians(5.0), atol=1e-15)
    assert comparison.objects["box"].coverage == Share(0, 1)
    assert comparison.objects["box"].precision == Share(0, 0)
    assert comparison.objects["can"].precision == Share(0, 1)
    assert comparison.objects["box"].to_grasps.missing == 1
    assert comparison.overall.coverage == Share(2, 4)
    assert comparison.overall.precision == Share(2, 5)
    assert comparison.shared_ids == 1
    assert list(comparison.objects) == ["box", "can", "mug"]


def test_a_comparison_is_coverage_and_precision() -> None:
    a = GraspSet.create(crowded_grasps(300, 2), object="mug")
    b = GraspSet.create(crowded_grasps(40, 3), object="mug")
    there, back = compare_grasps(a, b), compare_grasps(b, a)
    assert there.overall.coverage == coverage(a, b).overall == back.overall.precision
    assert there.overall.precision == precision(b, a).overall == back.overall.coverage
    assert there.overall.to_grasps == back.overall.to_reference
    assert 0 < there.overall.coverage.count < 300


def test_a_set_and_itself() -> None:
    a = GraspSet.create(crowded_grasps(50, 4), object="mug")
    comparison = compare_grasps(a, a)
    assert comparison.overall.coverage == comparison.overall.precision == Share(50, 50)
    assert comparison.overall.to_grasps.quantiles[-1] == 0.0
    assert comparison.shared_ids == 50


def test_empty_sets() -> None:
    none, some = line(), line(0.0)
    assert summarize(none).objects == {}
    assert compare_grasps(none, none).overall.coverage == Share(0, 0)
    assert compare_grasps(some, none).objects["mug"].coverage == Share(0, 1)
