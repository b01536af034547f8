"""Objects in rows with their grasps: nothing overlaps, and grasps stay on their objects."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from recording import RecordingMeshcat

from burg_drake.core import GraspSet, UnknownNameError, grasp_from_axes, inverse, transform_points
from burg_drake.objects import load_library
from burg_drake.visualization import grasp_triangles, show_objects_for_grasps

NAMES = ["mug", "bowl", "screwdriver", "marble", "can"]
PER_OBJECT = 6


@pytest.fixture(scope="module")
def grasps() -> GraspSet:
    """Grasps towards the origin of each object from all around, 40 mm before it."""
    rng = np.random.default_rng(4)
    approach = rng.normal(size=(PER_OBJECT * len(NAMES), 3))
    approach /= np.linalg.norm(approach, axis=1, keepdims=True)
    X_OG = grasp_from_axes(rng.normal(size=approach.shape), approach, -0.04 * approach)
    return GraspSet.create(X_OG, object=np.repeat(NAMES, PER_OBJECT), width=0.05)


def test_everything_has_its_own_place(recorder: RecordingMeshcat, grasps: GraspSet) -> None:
    """Bounds on the floor of each object with its drawn grasps are apart, and above the floor."""
    library = load_library("household")
    X_WG = show_objects_for_grasps(library, grasps, grasps.width, recorder)  # type: ignore[arg-type]
    bounds = {}
    for name in NAMES:
        own = grasps.object == name
        drawn, _ = grasp_triangles(X_WG[own], grasps.width[own])
        X_WO = recorder.X_WP(f"/drake/library/visual/{name}")
        points = np.vstack([drawn.T, transform_points(X_WO, library.surface(name).vertices)])
        bounds[name] = points.min(axis=0), points.max(axis=0)
        assert points[:, 2].min() > -1e-6
        assert recorder.HasPath(f"/drake/library/labels/{name}")
    for a, b in itertools.combinations(NAMES, 2):
        apart = np.maximum(bounds[a][0] - bounds[b][1], bounds[b][0] - bounds[a][1])[:2]
        assert apart.max() > 0.0, (a, b)


def test_grasps_stay_where_they_were_on_the_object(
    recorder: RecordingMeshcat, grasps: GraspSet
) -> None:
    library = load_library("household")
    X_WG = show_objects_for_grasps(library, grasps, grasps.width, recorder)  # type: ignore[arg-type]
    for X, name, X_OG in zip(X_WG, grasps.object.tolist(), grasps.X_OG, strict=True):
        X_WO = recorder.X_WP(f"/drake/library/visual/{name}")
        assert inverse(X_WO) @ X == pytest.approx(X_OG, abs=1e-12)


def test_only_the_objects_of_the_grasps(recorder: RecordingMeshcat, grasps: GraspSet) -> None:
    library = load_library("household")
    show_objects_for_grasps(library, grasps, grasps.width, recorder)  # type: ignore[arg-type]
    assert not recorder.HasPath("/drake/library/visual/banana")
    one = grasps.select(grasps.object == "mug")
    show_objects_for_grasps(library, one, one.width, recorder)  # type: ignore[arg-type]
    assert not recorder.HasPath("/drake/library/visual/bowl")


def test_an_object_that_the_library_lacks(recorder: RecordingMeshcat) -> None:
    other = GraspSet.create(np.eye(4), object="mugg", width=0.05)
    with pytest.raises(UnknownNameError, match="did you mean 'mug'"):
        show_objects_for_grasps(load_library("household"), other, other.width, recorder)  # type: ignore[arg-type]
