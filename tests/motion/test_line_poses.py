"""Where the hand goes, against the frames' own rules."""

import numpy as np

from burg_drake.core import inverse, make_pose, pregrasp, rotation_from_rpy
from burg_drake.motion import HandPath
from burg_drake.station import GraspMotion

X_HG = make_pose(rotation_from_rpy((0.0, 0.0, np.pi / 2)), (0.0, 0.0, 0.1034))
X_WA = make_pose(rotation_from_rpy((0.4, -0.2, 1.1)), (0.3, -0.1, 0.05))
X_WG = make_pose(rotation_from_rpy((2.8, 0.3, -0.5)), (0.5, 0.1, 0.12))
PATH = HandPath.of(X_HG, X_WA[:3, :3], GraspMotion())
BACK_AND_ASIDE = GraspMotion(retreat=0.08, lift_height=0.2, lift_direction=(0.0, 3.0, 4.0))


def grasp_in_world(way: float, path: HandPath = PATH) -> np.ndarray:
    X_AH = path.X_AH(inverse(X_WA) @ X_WG, np.array(way))
    return X_WA @ X_AH @ X_HG


def test_at_the_grasp_itself() -> None:
    np.testing.assert_allclose(grasp_in_world(0.0), X_WG, atol=1e-12)


def test_before_the_grasp_the_hand_is_back_along_the_approach() -> None:
    np.testing.assert_allclose(grasp_in_world(-0.1), pregrasp(X_WG, 0.1), atol=1e-12)


def test_after_it_the_hand_is_straight_above_whatever_the_base() -> None:
    risen = X_WG.copy()
    risen[2, 3] += 0.3
    np.testing.assert_allclose(grasp_in_world(0.3), risen, atol=1e-12)


def test_after_a_retreat_the_lift_begins_back_on_the_approach() -> None:
    path = HandPath.of(X_HG, X_WA[:3, :3], BACK_AND_ASIDE)
    back, aside = pregrasp(X_WG, 0.08), pregrasp(X_WG, 0.08)
    aside[:3, 3] += 0.2 * np.array((0.0, 0.6, 0.8))
    np.testing.assert_allclose(grasp_in_world(0.08, path), back, atol=1e-12)
    np.testing.assert_allclose(grasp_in_world(0.28, path), aside, atol=1e-12)
    np.testing.assert_allclose(path.layers[[0, path.at_retreated, -1]], [-0.1, 0.08, 0.28])
    carried = path.target_displacement(inverse(X_WA) @ X_WG, np.array((-0.1, 0.0, 0.28))[:, None])
    np.testing.assert_allclose(
        carried[:, 0], [np.zeros(3), np.zeros(3), aside[:3, 3] - X_WG[:3, 3]], atol=1e-12
    )


def test_shapes_broadcast() -> None:
    X_AG = np.broadcast_to(X_WG, (3, 2, 4, 4))
    ways = np.linspace(-0.1, 0.3, 5)[:, None, None]
    X_AH = PATH.X_AH(X_AG[None], ways)
    assert X_AH.shape == (5, 3, 2, 4, 4)
    np.testing.assert_array_equal(X_AH[4, 1, 0], PATH.X_AH(X_WG, ways[4, 0, 0]))
