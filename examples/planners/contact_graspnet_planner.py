"""Contact-GraspNet as a planner of burg_drake: github.com/NVlabs/contact_graspnet.

Copy this file and burg_planner.py into the folder contact_graspnet/ of that repository, beside
inference.py, and run from the repository's root::

    python contact_graspnet/contact_graspnet_planner.py --port 9000

Facts from the repository:

- The network is given depth [m], K and a segmentation with 0 for the background, the images of one
  camera (`load_available_input_data` in contact_graspnet/data.py, `extract_point_clouds` in
  contact_graspnet/contact_grasp_estimator.py). Colours are for pictures only.
- `predict_scene_grasps` returns four dicts by segment, -1 without segmentation: poses (N, 4, 4) in
  the camera's frame as in OpenCV, scores (N,), contact points, and openings (N,) of the hand.
- A pose has x from the predicted contact to the other one, z along the approach, and its origin
  0.1034 m behind the middle between both contacts (`build_6d_grasp` in contact_graspnet.py).
- An opening is the distance of the contacts and `extra_opening`, 0.005 m, of config.yaml
  (`predict_grasps`).
"""

from __future__ import annotations

import functools
import time
from typing import Any, Mapping  # noqa: UP035  # Python 3.8

import numpy as np

try:
    from burg_planner import Observation, run
except ModuleNotFoundError:  # in the repository of burg_drake
    from burg_drake.benchmark.burg_planner import Observation, run

CHECKPOINT = "checkpoints/scene_test_2048_bs3_hor_sigma_001"
"""Folder of weights and config.yaml, the default of inference.py."""
FORWARD_PASSES = 1
"""More of them propose more grasps."""
DEPTH_RANGE = (0.2, 1.8)
"""Depths that the network is given [m], the default of inference.py."""
CONTACT_DISTANCE = 0.1034
"""Distance from the origin of a pose to the middle between the contacts [m]."""
EXTRA_OPENING = 0.005
"""How much farther the hand opens than the contacts are apart [m]."""


def make_input(observation: Observation) -> dict[str, Any]:
    """Depth, K and segmentation by the names that inference.py reads from .npz files.

    Returns:
        `depth`: (H, W) [m], 0 where none was measured; `K`: (3, 3); `segmap`: (H, W) number of the
        object in each pixel, only of the target if there is one, or None without segmentation.
    """
    segmap = observation.segmentation
    if segmap is not None and observation.target is not None:
        segmap = np.where(segmap == observation.target, segmap, 0)
    return {"depth": observation.depth, "K": observation.K, "segmap": segmap}


def make_answer(
    grasps: Mapping[Any, Any],
    scores: Mapping[Any, Any],
    openings: Mapping[Any, Any] | None = None,
) -> dict[str, Any]:
    """The answer to burg_drake.

    Args:
        grasps: (N, 4, 4) predicted poses of each segment in the camera's frame.
        scores: (N,) their scores.
        openings: (N,) openings of the hand [m]; None if they are unknown, as in files that
            inference.py writes.
    """
    segments = list(grasps)
    X_CG = _join([np.reshape(grasps[k], (-1, 4, 4)) for k in segments], (0, 4, 4))
    # In burg_drake the origin is between the contacts. The axes are the same.
    X_CG[:, :3, 3] += CONTACT_DISTANCE * X_CG[:, :3, 2]
    answer = {"X_CG": X_CG, "score": _join([np.ravel(scores[k]) for k in segments], (0,))}
    if openings is not None:
        opening = _join([np.ravel(openings[k]) for k in segments], (0,))
        answer["width"] = np.maximum(opening - EXTRA_OPENING, 0.0)
    return answer


def _join(parts: list[Any], empty_shape: tuple[int, ...]) -> Any:
    return np.concatenate([np.empty(empty_shape), *parts]).astype(float)


@functools.lru_cache
def load_model() -> tuple[Any, Any]:
    """The network with its weights, and the session of TensorFlow that it runs in."""
    import config_utils
    import tensorflow.compat.v1 as tf
    from contact_grasp_estimator import GraspEstimator

    tf.disable_eager_execution()
    config = config_utils.load_config(CHECKPOINT, batch_size=FORWARD_PASSES, arg_configs=[])
    estimator = GraspEstimator(config)
    estimator.build_network()
    saver = tf.train.Saver(save_relative_paths=True)
    options = tf.ConfigProto(allow_soft_placement=True)
    options.gpu_options.allow_growth = True
    session = tf.Session(config=options)
    estimator.load_weights(session, saver, CHECKPOINT, mode="test")
    return estimator, session


def plan(observation: Observation) -> dict[str, Any]:
    """Grasps of the target, of all objects, or of the whole scene without segmentation."""
    estimator, session = load_model()
    begun = time.perf_counter()
    given = make_input(observation)
    is_segmented = given["segmap"] is not None
    points, segments, _ = estimator.extract_point_clouds(
        given["depth"], given["K"], segmap=given["segmap"], z_range=list(DEPTH_RANGE)
    )
    grasps, scores, _, openings = estimator.predict_scene_grasps(
        session,
        points,
        pc_segments=segments,
        local_regions=is_segmented,
        filter_grasps=is_segmented,
        forward_passes=FORWARD_PASSES,
    )
    answer = make_answer(grasps, scores, openings)
    return {**answer, "time": time.perf_counter() - begun}


if __name__ == "__main__":
    run(plan)
