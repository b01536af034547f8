"""GraspGen as a planner of burg_drake: a client of its server, github.com/NVlabs/GraspGen.

Start GraspGen's server with the checkpoint of the station's hand (client-server/README.md there)::

    bash docker/run_server.sh $(pwd) --models /path/to/GraspGenModels

This file needs numpy, pyzmq and msgpack, but not GraspGen. Copy it to any folder, with
burg_planner.py beside it, and run::

    python graspgen_planner.py --port 9000

Facts from that repository:

- Requests and replies are maps in msgpack, over ZMQ from a REQ to a REP socket, at port 5556. A
  request holds `action: infer`, `point_cloud` (N, 3) of one object [m], and `grasp_threshold`,
  `num_grasps`, `topk_num_grasps`, `min_grasps`, `max_tries`, `remove_outliers`. A reply holds
  `grasps` (N, 4, 4) and `confidences` (N,), or `error` (grasp_gen/serving/zmq_server.py).
- Arrays are packed as by the package msgpack-numpy: a map with a mark that it is an array, and
  `type`, `kind`, `shape` and `data`; its keys are bytes.
- A pose is that of the gripper's base in the frame of the points, z towards the tips and x along
  the closing direction (docs/GRIPPER_DESCRIPTION.md); burg_drake calls this frame graspgen. The
  published demonstrations centre the points, so does this file.
"""

from __future__ import annotations

import os
from typing import Any, Mapping  # noqa: UP035  # Python 3.8

import numpy as np

try:
    from burg_planner import Observation, run
except ModuleNotFoundError:  # in the repository of burg_drake
    from burg_drake.benchmark.burg_planner import Observation, run

SERVER = os.environ.get("GRASPGEN_SERVER", "tcp://127.0.0.1:5556")
"""Address of GraspGen's server."""
REPLY_TIMEOUT = 60.0
"""Seconds to wait for a reply."""
MAX_POINTS = 12000
"""Number of points of an object that are sent, as in scripts/demo_orbbec_gemini2.py."""
MIN_POINTS = 50
"""Objects with fewer points are left out."""
NUM_GRASPS = 200
"""Grasps that GraspGen samples for an object."""
TOPK_NUM_GRASPS = 100
"""Grasps of an object that it returns, those of highest confidence."""


def make_input(observation: Observation) -> list[Any]:
    """The points (N, 3) of each object in the camera's frame, float32 [m]; only the target's if
    there is one.

    Raises:
        ValueError: the observation has no segmentation.
    """
    if observation.segmentation is None:
        raise ValueError("GraspGen plans for one object: the observation has no segmentation")
    numbers = np.unique(observation.segmentation[observation.segmentation > 0])
    if observation.target is not None:
        numbers = np.array([observation.target])
    rng, p_C, found = observation.rng(), observation.points(), []
    for number in numbers:
        points = p_C[(observation.segmentation == number) & (observation.depth > 0.0)]
        if len(points) > MAX_POINTS:
            points = points[rng.choice(len(points), MAX_POINTS, replace=False)]
        if len(points) >= MIN_POINTS:
            found.append(points.astype(np.float32))
    return found


def make_request(points: Any) -> bytes:
    """A request for grasps of an object with these points (N, 3)."""
    import msgpack

    packed: bytes = msgpack.packb(
        {
            "action": "infer",
            "point_cloud": _pack_array(np.asarray(points, dtype="<f4")),
            "grasp_threshold": -1.0,  # the best `topk_num_grasps`, whatever their confidence
            "num_grasps": NUM_GRASPS,
            "topk_num_grasps": TOPK_NUM_GRASPS,
            "min_grasps": 40,
            "max_tries": 6,
            "remove_outliers": True,
        }
    )
    return packed


def read_reply(reply: bytes) -> tuple[Any, Any]:
    """Poses (N, 4, 4) in the frame of the points, and confidences (N,), of a reply.

    Raises:
        RuntimeError: the server reports an error.
    """
    import msgpack

    found = msgpack.unpackb(reply, object_hook=_unpack_map)
    if "error" in found:
        raise RuntimeError(f"GraspGen: {found['error']}")
    X = np.reshape(found["grasps"], (-1, 4, 4)).astype(float)
    X[:, 3] = (0.0, 0.0, 0.0, 1.0)  # the demonstrations set the last number, too
    return X, np.ravel(found["confidences"]).astype(float)


def _pack_array(array: Any) -> dict[bytes, Any]:
    return {
        b"nd": True,  # codespell:ignore
        b"type": array.dtype.str,
        b"kind": b"",
        b"shape": list(array.shape),
        b"data": array.tobytes(),
    }


def _unpack_map(found: Mapping[Any, Any]) -> Any:
    """An array, or the map itself."""
    if found.get(b"nd") is not True:  # codespell:ignore
        return found
    return np.frombuffer(found[b"data"], found[b"type"]).reshape(found[b"shape"])


def make_answer(parts: list[tuple[Any, Any]]) -> dict[str, Any]:
    """The answer to burg_drake, from poses (N, 4, 4) in the camera's frame and confidences (N,) of
    each object."""
    return {
        "X_CG": np.concatenate([np.empty((0, 4, 4)), *(X_CF for X_CF, _ in parts)]),
        "score": np.concatenate([np.empty(0), *(confidence for _, confidence in parts)]),
        "frame": "graspgen",
    }


def exchange(request: bytes) -> bytes:
    """Sends a request to the server and returns the reply.

    Raises:
        TimeoutError: no reply came.
    """
    import zmq

    socket: Any
    with zmq.Context.instance().socket(zmq.REQ) as socket:
        socket.setsockopt(zmq.LINGER, 0)
        socket.connect(SERVER)
        socket.send(request)
        if not socket.poll(int(1e3 * REPLY_TIMEOUT)):
            raise TimeoutError(
                f"GraspGen's server at {SERVER} sent no reply in {REPLY_TIMEOUT:g} s"
            )
        reply: bytes = socket.recv()
        return reply


def plan(observation: Observation) -> dict[str, Any]:
    """Grasps of the target, or of all objects."""
    parts = []
    for points in make_input(observation):
        center = points.mean(axis=0, dtype=float)
        X_CF, confidence = read_reply(exchange(make_request(points - center)))
        X_CF[:, :3, 3] += center
        parts.append((X_CF, confidence))
    return make_answer(parts)


if __name__ == "__main__":
    run(plan)
