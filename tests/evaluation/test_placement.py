"""Which instance a grasp is about: by hand, and for sampled grasps, whose instance is known."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from burg_drake.core import InvalidInputError, Pose, grasp_from_axes, make_pose, swap_fingers
from burg_drake.evaluation import (
    SamplingSettings,
    group_by_instance,
    held_instances,
    join_in_frame,
    sample_candidates,
)
from burg_drake.formats import PANDA_GRIPPER
from burg_drake.scene import Instance, Scene
from burg_drake.station import Station

DOWN = (0.0, 0.0, -1.0)


def down(x: float, y: float, z: float, closing: tuple[float, float] = (1.0, 0.0)) -> np.ndarray:
    """(4, 4) grasp from above."""
    return grasp_from_axes((*closing, 0.0), DOWN, (x, y, z))


# the left cube is at (0.1, 0.2), the right one at (0.3, 0.2), both 50 mm and with z from 0; the
# bar lies along x at (0.2, 0.35), 30 mm wide and high
KNOWN = {
    "in the middle of the left cube": (down(0.1, 0.2, 0.025), "left", True),
    "in the middle of the right cube": (down(0.3, 0.2, 0.025), "right", True),
    "finger tips just reach down to it": (down(0.1, 0.2, 0.05 + 0.009), "left", True),
    "finger tips above it": (down(0.1, 0.2, 0.05 + 0.0105), "left", False),
    "one finger in it": (down(0.1 + 0.035, 0.2, 0.025), "left", True),
    "beside it": (down(0.1 + 0.0655, 0.2, 0.025), "left", False),
    "nearer to the right one": (down(0.3 - 0.0655, 0.2, 0.025), "right", False),
    "across the bar": (down(0.2, 0.35, 0.015, (0.0, 1.0)), "bar", True),
    "high above the bar": (down(0.2, 0.35, 0.3), "bar", False),
}


@pytest.mark.parametrize("name", KNOWN)
def test_by_hand(name: str, scene: Scene) -> None:
    X_SG, instance, between = KNOWN[name]
    for X in (X_SG, swap_fingers(X_SG)):
        owner, held = held_instances(scene, X[None], PANDA_GRIPPER)
        assert (owner.tolist(), held.tolist()) == ([instance], [between])


def test_alone_as_in_a_batch(scene: Scene) -> None:
    X_SG = np.array([X for X, _, _ in KNOWN.values()])
    owner, held = held_instances(scene, X_SG, PANDA_GRIPPER)
    assert owner.tolist() == [instance for _, instance, _ in KNOWN.values()]
    assert held.tolist() == [between for _, _, between in KNOWN.values()]


def crowded(scene: Scene) -> Scene:
    """The cubes 2 mm apart, so that the open hand around one has a face of the other in it."""
    right = Instance(name="right", object="cube", X_SO=Pose((0.152, 0.2, 0.025), (0, 0, 90.0)))
    instances = (scene.document.instances[0], right, *scene.document.instances[2:])
    document = dataclasses.replace(scene.document, instances=instances)
    return Scene(document, scene.library, scene.path)


def test_the_nearer_one_of_two_between_the_fingers(scene: Scene) -> None:
    X_SG = np.array([down(0.1, 0.2, 0.025), down(0.124, 0.2, 0.025), down(0.128, 0.2, 0.025)])
    owner, held = held_instances(crowded(scene), X_SG, PANDA_GRIPPER)
    assert owner.tolist() == ["left", "left", "right"] and held.all()


def test_some_instances_only(scene: Scene) -> None:
    X_SG = down(0.1, 0.2, 0.025)[None]
    owner, held = held_instances(scene, X_SG, PANDA_GRIPPER, ["right", "bar"])
    assert owner.tolist() == ["bar"] and not held.any()  # 123 mm away; the right cube 175 mm
    with pytest.raises(InvalidInputError, match="has no free objects to grasp"):
        held_instances(scene, X_SG, PANDA_GRIPPER, [])
    nothing, _ = held_instances(scene, np.empty((0, 4, 4)), PANDA_GRIPPER)
    assert len(nothing) == 0


def turned(scene: Scene) -> Scene:
    """The scene with its objects in other poses."""
    poses = {"left": (20, 30, 40), "right": (90, 0, 10), "bar": (0, -90, 5)}
    instances = tuple(
        dataclasses.replace(i, X_SO=Pose(i.X_SO.translation, poses[i.name or i.object]))
        for i in scene.document.instances
    )
    document = dataclasses.replace(scene.document, instances=instances)
    return Scene(document, scene.library, scene.path)


@pytest.mark.parametrize("seed", range(3))
def test_sampled_grasps_return_to_their_instance(seed: int, scene: Scene, station: Station) -> None:
    scene = turned(scene)
    sampled = sample_candidates(
        scene, station, 100, seed, SamplingSettings(blind=True, approach_angle_deg=180.0)
    )
    sets = {
        name: sampled.grasps.select(sampled.instance == name).with_columns(mark=float(k))
        for k, name in enumerate(scene.instances)
    }
    rng = np.random.default_rng(seed)
    X_SC = make_pose(Rotation.random(rng=rng).as_matrix(), rng.uniform(-1, 1, 3))
    seen = join_in_frame(scene, sets, X_SC)
    assert seen.column("instance").tolist() == sampled.instance.tolist()
    X_SG = X_SC @ seen.X_OG
    owner, held = held_instances(scene, X_SG, PANDA_GRIPPER)
    assert held.all()
    np.testing.assert_array_equal(owner, sampled.instance)
    back = group_by_instance(scene, seen, X_SG, owner)
    assert list(back) == list(sets)
    for name, grasps in sets.items():
        np.testing.assert_allclose(back[name].X_OG, grasps.X_OG, atol=1e-12)
        for column in ("width", "score", "object", "mark"):
            np.testing.assert_array_equal(back[name].column(column), grasps.column(column))


def test_no_grasps(scene: Scene) -> None:
    none = join_in_frame(scene, {}, np.eye(4))
    assert len(none) == 0 and none.column("instance").tolist() == []
    assert group_by_instance(scene, none, none.X_OG, none.column("instance")) == {}
