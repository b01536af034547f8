"""Grasps for the tests of formats: random ones, and a cube that is gripped from above."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from burg_drake.core import Array, GraspSet, make_pose


@pytest.fixture
def random_grasps() -> Callable[..., GraspSet]:
    """Makes poses within 0.2 m in any direction, with widths that the Panda has."""

    def make(n: int, seed: int, *, object: str = "mug", success: bool = False) -> GraspSet:
        rng = np.random.default_rng(seed)
        R = Rotation.random(n, rng=rng).as_matrix()
        score = rng.integers(0, 2, n).astype(float) if success else rng.random(n)
        return GraspSet.create(
            make_pose(R, rng.uniform(-0.2, 0.2, (n, 3))),
            object=object,
            width=rng.uniform(0.0, 0.08, n),
            score=score,
        )

    return make


@pytest.fixture
def assert_grips_the_cube() -> Callable[[Array], None]:
    """Checks (4, 4) G at the centre of a cube at the origin, straight down, fingers along y."""

    def check(X_OG: Array) -> None:
        np.testing.assert_allclose(X_OG[:3, 3], 0.0, atol=1e-9)
        np.testing.assert_allclose(X_OG[:3, 2], [0.0, 0.0, -1.0], atol=1e-9)
        assert abs(X_OG[1, 0]) == pytest.approx(1.0, abs=1e-9)

    return check
