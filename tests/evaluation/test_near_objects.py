"""Grasps that are far from their objects are refused wherever the two meet."""

from __future__ import annotations

import numpy as np
import pytest

from burg_drake.core import GraspSet, InvalidInputError, make_pose
from burg_drake.evaluation import MAX_BOX_DISTANCE, group_by_names, read_grasps, require_near
from burg_drake.scene import Scene


def at(*positions: tuple[float, float, float], object: str = "cube") -> GraspSet:
    return GraspSet.create(np.stack([make_pose(p_AB=p) for p in positions]), object=object)


def test_the_distance_is_that_of_the_bounding_box(scene: Scene) -> None:
    # the cube has half extents of 25 mm
    corner = 0.025 + MAX_BOX_DISTANCE / np.sqrt(3.0)
    require_near(at((0.0, 0.0, 0.0)), scene.library, "mine.h5")
    require_near(at(3 * (corner - 1e-6,)), scene.library, "mine.h5")
    with pytest.raises(InvalidInputError, match=r"^mine.h5: .* object 'cube' is 0.25 m away"):
        require_near(at(3 * (-corner - 1e-6,)), scene.library, "mine.h5")
    with pytest.raises(InvalidInputError, match=r"'bar' is 0.9 m away .* metres.*right object"):
        require_near(at((1.0, 0.0, 0.0), object="bar"), scene.library, "mine.h5")


def test_one_near_grasp_of_an_object_is_enough(scene: Scene) -> None:
    require_near(at((0.0, 0.0, 0.0), (50.0, 0.0, 0.0)), scene.library, "mine.h5")
    both = GraspSet.concatenate([at((0.0, 0.0, 0.0)), at((0.0, 9.0, 0.0), object="bar")])
    with pytest.raises(InvalidInputError, match="object 'bar'"):
        require_near(both, scene.library, "mine.h5")


def test_millimetres_do_not_get_into_a_scene(scene: Scene, tmp_path) -> None:
    grasps = at((0.0, 0.0, 20.0), (5.0, 0.0, 25.0))
    grasps.save(tmp_path / "mm.h5")
    with pytest.raises(InvalidInputError, match=r"mm.h5: the nearest grasp of object 'cube'"):
        read_grasps(scene, tmp_path / "mm.h5")
    with pytest.raises(InvalidInputError, match="20 m away"):
        group_by_names(scene, grasps)
